"""Files of results: what they hold is read, and what is cut or foreign is named."""

import json
import math
import shutil
from functools import reduce
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fpputil.cli import main
from fpputil.experiments import runs as results
from fpputil.experiments.rows import ROWS

STORED = Path(__file__).parents[2] / "data" / "results"


@pytest.mark.parametrize(
    "text, said",
    [('{"a": 1}', "(no name); remove it"), ('{"na', "no file of results"), ("[]", "a table is")],
)
def test_a_cut_or_foreign_file_is_named(tmp_path, capsys, text, said):
    (tmp_path / "tiny").mkdir()
    (tmp_path / "tiny" / "sfnet.json").write_text(text)
    assert main(["results", "table", "3", "--results", str(tmp_path)]) == 1
    error = capsys.readouterr().err
    assert "sfnet.json" in error and said in error and error.count("\n") == 1


def test_effort_is_what_finished_runs_counted():
    stored = results.load("tiny", STORED)
    for name, work in results.training_cost("tiny", ROWS[3].values()).items():
        assert work == stored.runs[name].images * stored.runs[name].multiply_adds


def test_speed_is_the_median_of_the_runs():
    runs = {s: SimpleNamespace(images=10, multiply_adds=6e9, seconds=s) for s in (1, 2, 60)}
    assert results.training_speed(runs) == pytest.approx(3e10)
    assert results.training_speed({}) is None


@pytest.mark.parametrize(
    "place, value, said",
    [
        (("seed",), "0", "seed '0' given; a whole number of 0 or more is needed"),
        (("data",), ["a"], "data .'a'. given; a text is needed"),
        (("seconds",), math.nan, "seconds nan given"),
        (("history",), {"epoch": 1}, "history .* given; a list is needed"),
        (
            ("splits", "test", "measures", "mae_rad"),
            [1, 2],
            "mae_rad .1, 2. given; a list of 3",
        ),
        (("splits", "test", "inspection"), [{}], "no splits.test.inspection.0.classes"),
        (("splits", "test", "models"), [1], "not as many sums of test as models"),
        (("conditions", "noise 4", "sums"), {}, "no conditions.noise 4.sums.rad"),
        (("method", "base"), "8", "of no method of this version .base '8' given"),
        (("settings", "augmentation"), 3, "settings.augmentation 3 given; a table is needed"),
    ],
)
def test_a_result_of_another_structure(place, value, said, tmp_path):
    stored = json.loads((STORED / "tiny" / "sfnet.json").read_bytes())
    *way, last = place
    reduce(lambda at, key: at[key], way, stored)[last] = value
    (tmp_path / "sfnet.json").write_text(json.dumps(stored))
    with pytest.raises(ValueError, match=f"sfnet.json is .*{said}"):
        results.read_result(tmp_path / "sfnet.json")


def test_errors_of_views_that_are_cut_or_of_other_views(tmp_path):
    for name in ("views.npz", "sfnet.npz"):
        shutil.copy(STORED / "tiny" / name, tmp_path)
    loaded = results.Results("", tmp_path, {}, {})
    view = loaded.views[0]
    np.savez(tmp_path / "sfnet.npz", **{str(view.number): np.zeros(3)})
    with pytest.raises(ValueError, match=f"sfnet.npz has not .* errors of view {view.number}"):
        view.error("sfnet")
    (tmp_path / "sfnet.npz").write_bytes((tmp_path / "sfnet.npz").read_bytes()[:-9])
    with pytest.raises(ValueError, match="sfnet.npz is cut or no file of arrays"):
        view.error("sfnet")
    np.savez(tmp_path / "views.npz", **{"7-mask": np.ones((2, 2), bool)})
    with pytest.raises(ValueError, match="views.npz has not all of view 7"):
        _ = results.Results("", tmp_path, {}, {}).views
