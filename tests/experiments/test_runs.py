"""Runs by name: what they find, that a killed one goes on, and that none is made twice."""

import json
import math
import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch
from filelock import FileLock

import fpputil.experiments
from fpputil.cli import main
from fpputil.dataset.store import open_store
from fpputil.experiments import assessment, tables
from fpputil.experiments import learning_rate as rates
from fpputil.experiments import registry as experiments
from fpputil.experiments import runs as results
from fpputil.experiments.error_analysis import DISTANCES, ErrorAnalysis
from fpputil.experiments.statistics import IN_RANGE
from fpputil.learning.evaluation import evaluate, open_split
from fpputil.learning.loaders import spread
from fpputil.learning.weights import load_weights


@pytest.fixture(scope="module")
def found(short_runs, small_set, tmp_path_factory):
    """A folder of results with the runs of Table 3 but one, and a search that is made up."""
    out = tmp_path_factory.mktemp("results")
    (out / "tiny").mkdir()
    tried = {"0.001": {"mae": 2}, "0.002": {"mae": 1}, "0.004": {"mae": 3}}
    text = json.dumps(
        {"data": "", "settings": {}, "methods": {}, "runs": dict.fromkeys(rates.SEARCHED, tried)}
    )
    (out / "tiny" / "rates.json").write_text(text)
    for name in ("sfnet", "sido", "psnet", "sfnet-seed-1"):
        results.make_run(name, "tiny", small_set, out / "work", out)
    return out


def weights_of(out, name):
    (path,) = (out / "work" / "tiny").glob(f"{name}-????????/weights.safetensors")
    return path


def make(name, data, out):
    return results.make_run(name, "tiny", data, out / "work", out)


def test_what_a_run_leaves(found, small_set):
    run = json.loads((found / "tiny" / "sfnet.json").read_text())
    assert run["seed"] == 0 and run["images"] == 8 and run["preset"] == "tiny"
    assert run["settings"]["learning_rate"] == rates.best_learning_rate(
        found / "tiny" / "rates.json", "sfnet"
    )
    assert len(run["history"]) == 2 and run["seconds"] > 0
    assert run["hardware"]["torch"] == torch.__version__
    store = open_store(small_set)
    assert (run["data"], run["checksum"]) == (store.name, store.checksum)
    trained = load_weights(weights_of(found, "sfnet"))
    data = open_split(trained, small_set, "test")
    both, told, alone = evaluate(trained, data)
    expected = both.summary()
    for name, values in run["splits"]["test"]["measures"].items():
        assert values == pytest.approx(expected[name], rel=1e-3, nan_ok=True), name
    assert run["splits"]["test"]["alone"]["order_errors"] == pytest.approx(
        alone.summary()["order_errors"], rel=1e-3
    )
    test = run["splits"]["test"]
    assert test["models"] == list(both.models)
    number, total, square = np.array(test["sums"]["rad"]).sum(axis=0)
    assert total / number == pytest.approx(expected["mae_rad"][0], rel=1e-4)
    assert math.sqrt(square / number) == pytest.approx(expected["rmse_rad"][0], rel=1e-4)
    for kind, name in (("order", "order_errors"), ("high", "mae_high"), ("low", "mae_low")):
        number, total, _ = np.array(test["sums"][kind]).sum(axis=0)
        assert total / number == pytest.approx(expected[name][0], rel=1e-4)
    names = {*assessment.CONDITIONS}
    assert set(run["conditions"]) == names | {name + IN_RANGE for name in names}
    ranged = run["splits"]["test" + IN_RANGE]
    assert ranged["measures"]["mae_rad"] == pytest.approx(told.summary()["mae_rad"], rel=1e-3)
    assert set(ranged["sums"]) == {"rad", "mm", "order"}
    inspection = ErrorAnalysis()
    evaluate(trained, data, inspection.add)
    for name, values in results.read_result(found / "tiny" / "sfnet.json").analysis.items():
        assert values == pytest.approx(inspection.summary()[name], rel=1e-4, nan_ok=True), name
    assert len(inspection.summary()["edge_mae"]) == len(DISTANCES) - 1
    assert run["splits"]["held-out"]["views"] == 2


def test_darkness_hides_no_pixel(found):
    """Brightness changes photographs, not what counts."""
    run = json.loads((found / "tiny" / "sfnet.json").read_text())
    numbers = {k: np.array(c["sums"]["rad"])[:, 0] for k, c in run["conditions"].items()}
    assert (numbers["a quarter as bright"] == numbers["as trained"]).all()
    errors = [run["conditions"][k]["measures"]["mae_rad"][0] for k in ("as trained", "noise 8")]
    assert errors[0] != errors[1]


def test_texture_changes_surface_and_truth(found, small_set):
    run = json.loads((found / "tiny" / "sfnet.json").read_text())
    trained = load_weights(weights_of(found, "sfnet"))
    plain, printed = (open_split(trained, small_set, "test", texture=t) for t in (0.0, 0.5))
    (view,) = spread(plain, 1)
    before, after = (int(data[view]["mask"].sum()) for data in (plain, printed))
    ((number, *_),) = run["conditions"]["texture 0.5"]["sums"]["rad"]
    assert number == after < before


def test_pictures_are_errors_of_test_views(found, small_set):
    trained = load_weights(weights_of(found, "psnet"))
    data = open_split(trained, small_set, "test")
    with np.load(found / "tiny" / "psnet.npz") as file:
        assert set(file) == {str(i) for i in data.indices}
        for k, index in enumerate(data.indices):
            assert file[str(index)].shape == (int(data[k]["mask"].sum()),)
            assert file[str(index)].dtype == np.float32


def test_the_truth_of_the_pictures_is_kept_once(found, small_set):
    data = open_split(load_weights(weights_of(found, "sido")), small_set, "test")
    with np.load(found / "tiny" / assessment.VIEWS) as file:
        for k, index in enumerate(data.indices):
            for name in assessment.TRUTH:
                np.testing.assert_array_equal(file[f"{index}-{name}"], data[k][name].numpy())


def test_a_finished_run_is_not_made_again(found, small_set, monkeypatch):
    before = (found / "tiny" / "sido.json").read_bytes()
    monkeypatch.setattr(results, "fit", None)
    assert make("sido", small_set, found).name == "sido"
    assert (found / "tiny" / "sido.json").read_bytes() == before


def test_a_stopped_run_goes_on_to_the_same_numbers(found, small_set, tmp_path, monkeypatch):
    (tmp_path / "tiny").mkdir()
    (tmp_path / "tiny" / "rates.json").write_bytes((found / "tiny" / "rates.json").read_bytes())
    trained_once = results.fit

    def killed(*args, **how):
        trained_once(*args, **how)
        raise KeyboardInterrupt  # after the last epoch, before anything is measured

    monkeypatch.setattr(results, "fit", killed)
    with pytest.raises(KeyboardInterrupt):
        make("psnet", small_set, tmp_path)
    assert not (tmp_path / "tiny" / "psnet.json").exists()
    monkeypatch.setattr(results, "fit", trained_once)
    make("psnet", small_set, tmp_path)
    again, before = (
        json.loads((out / "tiny" / "psnet.json").read_text()) for out in (tmp_path, found)
    )
    for name in ("splits", "conditions", "images"):
        assert again[name] == before[name], name


def test_a_run_under_way_elsewhere_is_left_to_others(found, small_set, capsys, monkeypatch):
    """Others come first; then one waits for it."""
    folder = weights_of(found, "sido").parent
    lock, waited = FileLock(folder / ".lock"), []
    lock.acquire()
    with pytest.raises(BlockingIOError, match="another process is making the run sido"):
        make("sido", small_set, found)
    real = results.make_run

    def run(name, *args, **how):
        if args[-1]:  # it waits
            waited.append(name)
            lock.release()
        return real(name, *args, **how)

    monkeypatch.setattr(fpputil.experiments, "make_run", run)  # where the command looks
    places = ("--data", small_set, "--work", found / "work", "--results", found)
    assert main(["results", "run", "sido", "psnet", *map(str, places)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert "another process" in said[0] and said[1].startswith("psnet ")
    assert said[2].startswith("sido ") and waited == ["sido"]


def test_a_run_that_diverges_does_not_stop_the_others(found, small_set, capsys, monkeypatch):
    real = results.fit

    def fit(method, *args, **how):
        if method == experiments.methods("tiny")["dlalnet"]:
            raise FloatingPointError("the loss is nan")
        return real(method, *args, **how)

    monkeypatch.setattr(results, "fit", fit)
    places = ("--data", small_set, "--work", found / "work", "--results", found)
    assert main(["results", "run", "dlalnet", "sido", *map(str, places)]) == 1
    said = capsys.readouterr().out
    assert "dlalnet: the loss is nan" in said and "sido  " in said


def test_other_settings_are_another_run(found, small_set, monkeypatch):
    """Neither taken for finished, nor shown in a table, nor resumed."""
    longer = replace(results.budget("tiny"), epochs=3)
    monkeypatch.setattr(results, "budget", lambda preset: longer)
    with pytest.raises(ValueError, match=r"sfnet\.json was made with other settings .* sfnet"):
        results.read_results("tiny", found)
    monkeypatch.setattr(results, "fit", lambda *_, resume, **how: pytest.fail(f"resume {resume}"))
    with pytest.raises(pytest.fail.Exception, match="resume False"):
        make("psnet", small_set, found)


def test_what_is_missing_is_said(found, small_set, tmp_path, capsys):
    with pytest.raises(ValueError, match="run 'unet' given; the runs are sfnet, sido"):
        make("unet", small_set, found)
    with pytest.raises(FileNotFoundError, match="search first: fpp results rates"):
        make("sfnet", small_set, tmp_path)
    with pytest.raises(ValueError, match="made with the preset tiny, and small is asked for"):
        results.make_run("sfnet", "small", small_set, tmp_path, found)
    half = json.loads((found / "tiny" / "rates.json").read_text())
    half["runs"]["sido"].popitem()
    assert main(["results", "run", "all", "typo", "--data", str(small_set)]) == 1
    assert "run 'typo' given" in capsys.readouterr().err
    (tmp_path / "rates.json").write_text(json.dumps(half))
    with pytest.raises(ValueError, match="lacks rates of sido"):
        rates.best_learning_rate(tmp_path / "rates.json", "sido")
    assert rates.best_learning_rate(tmp_path / "rates.json", "sfnet") == 2e-3
    half["data"] = "another"
    (tmp_path / "rates.json").write_text(json.dumps(half))
    with pytest.raises(ValueError, match="is a search with other data"):
        rates.search_learning_rate(small_set, tmp_path / "rates.json")
    with pytest.raises(ValueError, match="'sfnet-zmin' given; rates are searched for sfnet, sido"):
        rates.search_learning_rate(small_set, tmp_path / "rates.json", ["sfnet-zmin"])
    assert main(["results", "table", "3", "--results", str(tmp_path)]) == 1
    assert "no run of table 3 is finished" in capsys.readouterr().err
    assert main(["results", "table", "9", "--results", str(found)]) == 1
    assert "table 9 given" in capsys.readouterr().err


def test_the_command_prints_what_the_files_hold(found, capsys):
    assert main(["results", "table", "3", "--results", str(found)]) == 0
    said = capsys.readouterr().out
    mae = tables.table(3, results.read_results("tiny", found))[1].measures["mae_rad"][0]
    assert f"{mae:.4g}" in said and "SIDO" in said and "0.3610" in said and "alone" in said
    assert main(["results", "list", "--results", str(found)]) == 0
    said = capsys.readouterr().out
    assert (
        said.count("to be made") == len(experiments.experiments("tiny")) - 4
        and "hours of training in all" in said
    )
    assert main(["results", "list", "--preset", "paper", "--results", str(found)]) == 0
    assert "hours of training in all" in capsys.readouterr().out


def test_a_preset_of_one_seed_says_whose_seeds_it_borrows(found, tmp_path, capsys):
    shutil.copytree(found / "tiny", tmp_path / "tiny")
    (tmp_path / "small").mkdir()
    shutil.copy(found / "tiny" / "sfnet.json", tmp_path / "small")
    for preset, borrowed in (("tiny", False), ("small", True)):
        assert main(["results", "table", "3", "--preset", preset, "--results", str(tmp_path)]) == 0
        assert ("taken from tiny" in capsys.readouterr().out) == borrowed


def test_runs_on_two_datasets_are_no_table(found, tmp_path):
    (tmp_path / "tiny").mkdir()
    for name, data in (("sfnet", "a"), ("sido", "b")):
        run = json.loads((found / "tiny" / f"{name}.json").read_text())
        (tmp_path / "tiny" / f"{name}.json").write_text(json.dumps(run | {"data": data}))
    with pytest.raises(ValueError, match="2 datasets"):
        results.read_results("tiny", tmp_path)


def test_results_say_what_the_files_hold(found, small_set):
    """Numbers by attribute, pictures by view, tables by their number."""
    stored = json.loads((found / "tiny" / "sfnet.json").read_text())
    loaded = results.load("tiny", found)
    run = loaded.runs["sfnet"]
    measures = stored["splits"]["test"]["measures"]
    assert [run.test.mae, run.test.order_errors] == [
        measures[k][0] for k in ("mae_rad", "order_errors")
    ]
    assert (
        run.held_out.views == 2 and run.alone.mae == stored["splits"]["test"]["alone"]["mae_rad"][0]
    )
    assert run.settings.epochs == 2 and run.kind == "sfnet"
    with pytest.raises(AttributeError, match="weight asked for; the measures are mae_rad"):
        _ = run.test.weight
    view, data = (
        loaded.views[0],
        open_split(load_weights(weights_of(found, "sido")), small_set, "test"),
    )
    assert view.number == data.indices[0]
    np.testing.assert_array_equal(view.Phi, data[0]["Phi"].numpy())
    error = view.error("sido")
    assert (np.isfinite(error) == view.mask).all()
    near = view.cropped(error)
    assert np.isfinite(near).sum() == view.mask.sum() and near.size < error.size
    seeds = loaded.seeds("sfnet")
    assert len(seeds) == 2
    assert loaded.mean("sfnet") == pytest.approx(np.mean([r.test.mae for r in seeds]), rel=1e-4)
    difference = loaded.difference("sido", "sfnet")
    assert difference.value == pytest.approx(loaded.mean("sido") - loaded.mean("sfnet"))
    assert list(loaded.rows(3, "sido")) == ["sido"] and loaded.rows(3)["sido"].line.count("±") == 4
    assert "SIDO" in repr(loaded.table(3)) and "<table>" in loaded.differences(3)._repr_html_()
