"""Names of the runs, and what a list of them reads."""

import json
import subprocess
import sys

import pytest

from fpputil.experiments.registry import TRAINING, experiments, methods
from fpputil.experiments.rows import NEAR, ROWS, Finished, finished, run_names

RESULT = {"seconds": 90.5, "splits": {"test": {"measures": {"mae_rad": [0.1, 0.09, 0.11]}}}}


@pytest.mark.parametrize("preset", TRAINING)
def test_names_are_those_of_the_experiments(preset):
    names = run_names(preset)
    assert list(names) == list(experiments(preset))
    assert {row for row, _ in names.values()} <= set(methods(preset))


def test_rows_name_every_method_once():
    known = {name for table in ROWS.values() for name in table.values()}
    assert known == set(methods("tiny"))
    assert set(run_names("near")) == set(NEAR) < known


def test_finished_runs_are_those_with_a_file(tmp_path):
    assert finished("tiny", tmp_path) == {}
    (tmp_path / "tiny").mkdir()
    (tmp_path / "tiny" / "sido-seed-2.json").write_text(json.dumps(RESULT))
    (tmp_path / "tiny" / "foreign.json").write_text("{")
    assert finished("tiny", tmp_path) == {"sido-seed-2": Finished(0.1, 90.5)}


@pytest.mark.parametrize("damage", ["{", "[]", json.dumps(RESULT | {"seconds": "90"})])
def test_a_damaged_result_is_named(tmp_path, damage):
    (tmp_path / "tiny").mkdir()
    (tmp_path / "tiny" / "sfnet.json").write_text(damage)
    with pytest.raises(ValueError, match=r"sfnet\.json is cut or no file of results .*; remove it"):
        finished("tiny", tmp_path)


@pytest.mark.slow
def test_a_list_needs_no_torch(tmp_path):
    (tmp_path / "tiny").mkdir()
    (tmp_path / "tiny" / "sfnet.json").write_text(json.dumps(RESULT))
    code = f"""
import sys
from fpputil.cli import main
for folder in ({str(tmp_path)!r}, {str(tmp_path / "empty")!r}):
    try:
        main(["results", "list", "--results", folder])
    except SystemExit as end:
        assert not end.code
assert not {{"torch", "scipy", "zarr", "numba"}} & set(sys.modules)
"""
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert "MAE 0.1000 rad, 1.5 min" in said.stdout
    assert "about 2 min" in said.stdout
    assert "sfnet                    to be made\n" in said.stdout
