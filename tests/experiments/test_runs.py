"""Runs by name: what they find, that a killed one goes on, and that none is made twice."""

import json
import math
import shutil
from dataclasses import replace
from functools import reduce
from pathlib import Path
from types import SimpleNamespace

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
from fpputil.experiments.registry import budget, methods
from fpputil.experiments.rows import ROWS, SEEDS, seeded_name
from fpputil.experiments.statistics import IN_RANGE
from fpputil.learning.evaluation import evaluate, open_split
from fpputil.learning.weights import load_weights

STORED = Path(__file__).parents[2] / "data" / "results"
KINDS = ("sfnet", "sido", "psnet", "dlalnet")
SHORT = {
    "epochs": 2,
    "training_views": 4,
    "batch": 4,
    "validation_views": 2,
    "precision": "float32",
}


@pytest.fixture(scope="module", autouse=True)
def short_runs():
    """The runs as they are, but of small networks that see eight views."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(experiments, "sized", lambda name, unit: 2)
        short = replace(budget("tiny"), **SHORT)
        patched.setattr(results, "budget", lambda preset: short)
        patched.setattr(rates, "SEARCHED", KINDS)
        patched.setattr(rates, "SEARCH_CONFIG", replace(short, epochs=1))
        patched.setattr(assessment, "CONDITION_VIEWS", 1)
        yield


@pytest.fixture(scope="module")
def found(small_set, tmp_path_factory):
    """A folder of results with the runs of Table 3 but one, and a search that is made up."""
    out = tmp_path_factory.mktemp("results")
    (out / "tiny").mkdir()
    tried = {"0.001": {"mae": 2}, "0.002": {"mae": 1}, "0.004": {"mae": 3}}
    text = json.dumps(
        {"data": "", "settings": {}, "methods": {}, "runs": dict.fromkeys(KINDS, tried)}
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


def test_every_row_is_a_run_and_sixteen_are_distinct():
    for preset in ("tiny", "small", "paper"):
        known = experiments.experiments(preset)
        rows = [name for number in (3, 4, 5, 6) for name in ROWS[number].values()]
        assert len(rows) == 19 and len(set(rows)) == 16
        for name in (*rows, *ROWS["ours"].values()):
            assert {known[seeded_name(name, s)].seed for s in SEEDS.get(name, (0,))} == set(
                SEEDS.get(name, (0,))
            )
        assert len(known) == 16 + 14 + 2 * 9
        made = [one.method for one in known.values() if not one.seed]
        assert all(made.count(method) == 1 for method in made)  # no row is another by mistake


def test_each_row_differs_from_sfnet_in_what_it_says():
    known = methods("tiny")
    sfnet = known["sfnet"]
    assert known["sfnet-b"] == replace(
        sfnet, weights=replace(sfnet.weights, consistency=0, geometric=0)
    )
    assert known["sfnet-a"] == replace(known["sfnet-b"], mixing="none")
    assert known["sfnet-1e-3-1e-5"].weights == replace(
        sfnet.weights, consistency=1e-3, geometric=1e-5
    )
    assert (sfnet.weights.consistency, sfnet.weights.geometric) == (1e-2, 1e-6)
    assert known["sfnet-3-frames"] == replace(sfnet, frames=3)
    assert known["dlalnet"].weights is None
    assert known["dlalnet-losses"].weights == replace(sfnet.weights, mean=True)


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


def test_the_search_goes_on_where_the_best_is_an_end(small_set, tmp_path, monkeypatch):
    """Least at 1.6e-2 for one method, at 2e-3 for the others."""
    path, seen = tmp_path / "tiny" / "rates.json", []
    known = experiments.methods("tiny")
    monkeypatch.setattr(rates, "methods", lambda preset: known)

    def fit(method, data, settings, **how):
        seen.append(settings.learning_rate)
        if method == known["sido"] and settings.learning_rate > 0.02:
            raise FloatingPointError("the loss is inf")
        best = 1.6e-2 if method == known["sido"] else 2e-3
        found = {
            f"validation_{k}": abs(math.log(settings.learning_rate / best)) for k in rates.MEASURES
        }
        return None, [{**found, "seconds": 1.0}]

    monkeypatch.setattr(rates, "fit", fit)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    monkeypatch.setattr(rates, "hardware", lambda device: device.type)
    found = rates.search_learning_rate(small_set, path)
    assert json.loads(path.read_text())["hardware"] == "cuda"  # where `fit` trains by default
    assert rates.search_learning_rate(small_set, path, ["psnet"]) == {"psnet": 2e-3}
    assert found == {"sfnet": 2e-3, "sido": 1.6e-2, "psnet": 2e-3, "dlalnet": 2e-3}
    made = json.loads(path.read_text())["runs"]
    assert list(made["sfnet"]) == ["0.001", "0.002", "0.004"]
    assert made["sido"]["0.032"] == {"mae": None}
    number = len(seen)
    assert rates.search_learning_rate(small_set, path) == found and len(seen) == number
    made["psnet"].popitem()
    path.write_text(json.dumps({**json.loads(path.read_text()), "runs": made}))
    assert rates.search_learning_rate(small_set, path) == found and len(seen) == number + 1


def test_a_search_is_a_training_run(small_set, tmp_path, monkeypatch):
    monkeypatch.setattr(rates, "_next_rate", lambda tried: None if tried else 1e-3)
    rates.search_learning_rate(small_set, tmp_path / "rates.json")
    found = json.loads((tmp_path / "rates.json").read_text())["runs"]["psnet"]["0.001"]
    assert 0 < found["mae"] < found["rmse"] and 0 < found["order_errors"] <= 1


def test_a_rate_that_diverges_is_not_the_best():
    tried = {"0.001": {"mae": 1.0}, "0.002": {"mae": None}, "0.004": {"mae": None}}
    assert rates._next_rate(tried) == 5e-4
    assert rates._next_rate({**tried, "0.0005": {"mae": 2.0}}) is None


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


def test_effort_is_what_finished_runs_counted():
    """Of the widths that the stored runs have, not those of this file."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(experiments, "sized", lambda name, unit: int(4 * experiments.WIDTHS[name]))
        patched.setattr(results, "budget", experiments.budget)
        stored = results.load("tiny", STORED)
        for name, work in results.training_cost("tiny", ROWS[3].values()).items():
            assert work == stored.runs[name].images * stored.runs[name].multiply_adds


def test_speed_is_the_median_of_the_runs():
    runs = {s: SimpleNamespace(images=10, multiply_adds=6e9, seconds=s) for s in (1, 2, 60)}
    assert results.training_speed(runs) == pytest.approx(3e10)
    assert results.training_speed({}) is None


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


@pytest.mark.parametrize(
    "tried, said",
    [
        ([], r"runs \[\] given; a table is needed"),
        ({"sfnet": [0.001]}, "runs.sfnet .0.001. given; a table is needed"),
        ({"sfnet": {"fast": {"mae": 1}}}, "could not convert string to float: 'fast'"),
        ({"sfnet": {"-1": {"mae": 1}}}, "rate in runs.sfnet -1.0 given; a positive number"),
        ({"sfnet": {"0.001": {}}}, "no runs.sfnet.0.001.mae"),
        ({"sfnet": {"0.001": {"mae": "1"}}}, "runs.sfnet.0.001.mae '1' given"),
    ],
)
def test_rates_of_another_structure(tried, said, tmp_path):
    path = tmp_path / "rates.json"
    path.write_text(json.dumps({"runs": tried}))
    with pytest.raises(ValueError, match=f"{path} is cut or no file of results .*{said}.*; remove"):
        rates.best_learning_rate(path, "sfnet")


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
