"""Runs that take seconds."""

from dataclasses import replace

import pytest
from matplotlib.figure import Figure

from fpputil.experiments import assessment
from fpputil.experiments import learning_rate as rates
from fpputil.experiments import registry as experiments
from fpputil.experiments import runs as results
from fpputil.experiments.registry import budget
from fpputil.learning.metrics import Score

KINDS = ("sfnet", "sido", "psnet", "dlalnet")
SHORT = {
    "epochs": 2,
    "training_views": 4,
    "batch": 4,
    "validation_views": 2,
    "precision": "float32",
}


@pytest.fixture(scope="module")
def short_runs():
    """The runs as they are, but of small networks that see eight views; curves are not drawn."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(experiments, "sized", lambda name, unit: 2)
        short = replace(budget("tiny"), **SHORT)
        patched.setattr(results, "budget", lambda preset: short)
        patched.setattr(rates, "SEARCHED", KINDS)
        patched.setattr(rates, "SEARCH_CONFIG", replace(short, epochs=1))
        patched.setattr(assessment, "CONDITION_VIEWS", 1)
        patched.setattr(Score.summary, "__defaults__", (0, 50))  # draws of models
        patched.setattr(Figure, "savefig", lambda self, file, **_: file.write(b"no picture"))
        yield
