"""A dataset keeps its name in results where only its rounding differs."""

import numpy as np
import pytest

from fpputil.dataset.naming import VIEWS, dataset_name
from fpputil.dataset.store import open_store
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.experiments.assessment import TRUTH


@pytest.fixture
def views(small_set):
    """The truth of all test views, as results keep it."""
    data = SynthFringe(small_set, "test")
    return {f"{i}-{n}": data[k][n].numpy() for k, i in enumerate(data.indices) for n in TRUTH}


@pytest.fixture
def named(small_set, tmp_path):
    """The name of the dataset beside the views of one that another machine made."""

    def name(views):
        np.savez(tmp_path / VIEWS, data=np.array("another"), **views)
        return dataset_name(open_store(small_set), tmp_path / VIEWS)

    return name


def changed(views, name, how):
    return views | {k: how(v.copy()) for k, v in views.items() if k.endswith(f"-{name}")}


def one_pixel(values):
    values.flat[np.flatnonzero(values)[0]] = 0
    return values


def test_rounding_keeps_the_name(views, named):
    assert named(views) == "another"
    assert named(changed(views, "Phi", lambda x: np.nextafter(x, np.float32(1e3)))) == "another"
    assert named(changed(views, "mask", one_pixel)) == "another"


@pytest.mark.parametrize(
    "name, how",
    [
        ("Phi", lambda x: x + np.float32(0.01)),
        ("Phi", lambda x: x * np.float32("nan")),
        ("modulation", lambda x: x * np.float32(0.9)),
        ("mask", lambda x: np.zeros_like(x)),
        ("mask", lambda x: x[:-1]),
    ],
)
def test_another_dataset_has_its_own_name(small_set, views, named, name, how):
    assert named(changed(views, name, how)) == open_store(small_set).manifest["content"]


def test_nothing_to_compare_with(small_set, views, named, tmp_path):
    store = open_store(small_set)
    assert dataset_name(store, tmp_path / VIEWS) == store.manifest["content"]
    others = {k.replace("-", "00-"): v for k, v in views.items()}  # of other numbers
    assert named(others) == store.manifest["content"]


@pytest.mark.parametrize("lacking", ["data", "Phi", "-", "all"])
def test_views_that_are_cut(small_set, views, tmp_path, lacking):
    kept = {k: v for k, v in {"data": np.array("another"), **views}.items() if lacking not in k}
    np.savez(tmp_path / VIEWS, **kept)
    if lacking == "all":
        (tmp_path / VIEWS).write_bytes(b"PK")
    with pytest.raises(ValueError, match="views.npz keeps no test views"):
        dataset_name(open_store(small_set), tmp_path / VIEWS)
