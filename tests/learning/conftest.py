"""A small dataset, made once a run."""

import pytest

from fpputil.learning.generate import generate
from fpputil.learning.plan import seeded_models


@pytest.fixture(scope="session")
def small_set(tmp_path_factory):
    """Ten models and one held out, two views each, at the preset "tiny"."""
    out = tmp_path_factory.mktemp("data") / "set"
    generate(out, "tiny", *seeded_models(10, 1), views=2)
    return out
