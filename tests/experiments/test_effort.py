"""What runs cost that are not made yet, held against runs that were."""

import math
from pathlib import Path

import pytest

from fpputil.experiments.effort import training_cost, training_speed
from fpputil.experiments.registry import ROWS
from fpputil.experiments.runs import read_results

RESULTS = Path(__file__).parents[2] / "data" / "results"


def test_effort_is_what_finished_runs_counted():
    runs = read_results("tiny", RESULTS)
    for name, work in training_cost("tiny", ROWS[3].values()).items():
        assert work == runs[name]["images"] * runs[name]["multiply_adds"]


def test_speed_is_the_median_of_the_runs():
    runs = {
        str(seconds): {"images": 10, "multiply_adds": 6e9, "seconds": seconds}
        for seconds in (1, 2, 60)
    }
    assert training_speed(runs) == pytest.approx(3e10)
    assert training_speed({}) is None and math.isfinite(
        training_speed(read_results("tiny", RESULTS))
    )
