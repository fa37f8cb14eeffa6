"""Runs by name: what they find, that a killed one goes on, and that none is made twice."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from filelock import FileLock

from fpputil.cli import main
from fpputil.learning import experiments, rates, results, tables
from fpputil.learning.evaluation import evaluate, open_split
from fpputil.learning.experiments import ROWS, SEEDS, budget, methods, seeded_name
from fpputil.learning.inspection import DISTANCES
from fpputil.learning.methods import METHODS
from fpputil.learning.weights import load_weights

SHORT = {"epochs": 2, "views": 4, "batch": 4, "validate": 2, "precision": "float32"}


@pytest.fixture(scope="module", autouse=True)
def short_runs():
    """The runs as they are, but of small networks that see eight views."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(experiments, "sized", lambda name, unit: 2)
        short = replace(budget("tiny"), **SHORT)
        patched.setattr(results, "budget", lambda preset: short)
        patched.setattr(rates, "SEARCH", replace(short, epochs=1))
        patched.setattr(rates, "RATES", (1e-3, 4e-3))
        patched.setattr(results, "CONDITION_VIEWS", 1)
        yield


@pytest.fixture(scope="module")
def found(small_set, tmp_path_factory):
    """A folder of results with the search and the runs of Table 3 but one."""
    out = tmp_path_factory.mktemp("results")
    rates.search(small_set, out / "tiny" / "rates.json")
    for name in ("sfnet", "sido", "psnet", "sfnet-seed-1"):
        results.run(name, "tiny", small_set, out / "work", out)
    return out


def make(name, data, out):
    return results.run(name, "tiny", data, out / "work", out)


def test_every_row_is_a_run_and_sixteen_are_distinct():
    for preset in ("tiny", "small", "paper"):
        known = experiments.experiments(preset)
        rows = [name for number in (3, 4, 5, 6) for name in ROWS[number].values()]
        assert len(rows) == 19 and len(set(rows)) == 16
        for name in (*rows, *ROWS["ours"].values()):
            assert {known[seeded_name(name, s)].seed for s in SEEDS.get(name, (0,))} == set(
                SEEDS.get(name, (0,))
            )
        assert len(known) == 16 + 6 + 2 * 6
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
    assert known["dlalnet"].weights is None and known["dlalnet-losses"].weights == sfnet.weights


def test_what_a_run_leaves(found, small_set):
    run = json.loads((found / "tiny" / "sfnet.json").read_text())
    assert run["seed"] == 0 and run["images"] == 8 and run["preset"] == "tiny"
    assert run["settings"]["rate"] == rates.best_rates(found / "tiny" / "rates.json")["sfnet"]
    assert len(run["history"]) == 2 and run["seconds"] > 0
    assert run["hardware"]["torch"] == torch.__version__
    trained = load_weights(found / "work" / "tiny" / "sfnet" / "weights.safetensors")
    data = open_split(trained, small_set, "test")
    both, alone = evaluate(trained, data)
    expected = both.summary()
    for name, values in run["splits"]["test"]["measures"].items():
        assert values == pytest.approx(expected[name], rel=1e-3, nan_ok=True), name
    assert run["splits"]["test"]["alone"]["order_errors"] == pytest.approx(
        alone.summary()["order_errors"], rel=1e-3
    )
    assert run["models"] == list(both.models)
    number, total, square = np.array(run["sums"]["rad"]).sum(axis=0)
    assert total / number == pytest.approx(expected["mae_rad"][0], rel=1e-4)
    assert math.sqrt(square / number) == pytest.approx(expected["rmse_rad"][0], rel=1e-4)
    wrong = np.array(run["sums"]["order"]).sum(axis=0)
    assert wrong[1] / wrong[0] == pytest.approx(expected["order_errors"][0], rel=1e-4)
    assert set(run["conditions"]) == set(results.CONDITIONS)
    assert len(run["inspection"]["edge_mae"]) == len(DISTANCES) - 1
    assert run["splits"]["held-out"]["views"] == 2


def test_pictures_are_errors_of_test_views(found, small_set):
    trained = load_weights(found / "work" / "tiny" / "psnet" / "weights.safetensors")
    data = open_split(trained, small_set, "test")
    with np.load(found / "tiny" / "psnet.npz") as file:
        assert set(file) == {str(i) for i in data.indices}
        for k, index in enumerate(data.indices):
            assert file[str(index)].shape == (int(data[k]["mask"].sum()),)
            assert file[str(index)].dtype == np.float32


def test_the_truth_of_the_pictures_is_kept_once(found, small_set):
    data = open_split(load_weights(found / "work/tiny/sido/weights.safetensors"), small_set, "test")
    with np.load(found / "tiny" / results.VIEWS) as file:
        for k, index in enumerate(data.indices):
            for name in results.TRUTH:
                np.testing.assert_array_equal(file[f"{index}-{name}"], data[k][name].numpy())


def test_a_finished_run_is_not_made_again(found, small_set, monkeypatch):
    before = (found / "tiny" / "sido.json").read_bytes()
    monkeypatch.setattr(results, "fit", None)
    assert make("sido", small_set, found)["name"] == "sido"
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
    again, before = make("psnet", small_set, tmp_path), make("psnet", small_set, found)
    for name in ("splits", "sums", "inspection", "conditions", "images"):
        assert again[name] == before[name], name


def test_a_run_under_way_elsewhere_is_left_alone(found, small_set, capsys):
    work = found / "work" / "tiny" / "dlalnet"
    work.mkdir(parents=True)
    with FileLock(work / ".lock"):
        with pytest.raises(BlockingIOError, match="another process is making the run dlalnet"):
            make("dlalnet", small_set, found)
        places = ("--data", small_set, "--work", found / "work", "--results", found)
        assert main(["results", "run", "dlalnet", "sido", *map(str, places)]) == 1
    said = capsys.readouterr().out
    assert "another process" in said and "sido " in said  # the others are made all the same


def test_what_is_missing_is_said(found, small_set, tmp_path, capsys):
    with pytest.raises(ValueError, match="run 'unet' given; the runs are sfnet, sido"):
        make("unet", small_set, found)
    with pytest.raises(FileNotFoundError, match="search first: fpp results rates"):
        make("sfnet", small_set, tmp_path)
    with pytest.raises(ValueError, match="made with the preset tiny, and small is asked for"):
        results.run("sfnet", "small", small_set, tmp_path, found)
    half = json.loads((found / "tiny" / "rates.json").read_text())
    half["runs"]["sido"].popitem()
    (tmp_path / "rates.json").write_text(json.dumps(half))
    with pytest.raises(ValueError, match="lacks rates of sido"):
        rates.best_rates(tmp_path / "rates.json")
    half["data"] = "another"
    (tmp_path / "rates.json").write_text(json.dumps(half))
    with pytest.raises(ValueError, match="is a search with other data"):
        rates.search(small_set, tmp_path / "rates.json")
    assert main(["results", "table", "3", "--results", str(tmp_path)]) == 1
    assert "no run of table 3 is finished" in capsys.readouterr().err
    assert main(["results", "table", "9", "--results", str(found)]) == 1
    assert "table 9 given" in capsys.readouterr().err


def test_the_search_tries_each_method_alike(found):
    made = json.loads((found / "tiny" / "rates.json").read_text())
    assert made["runs"].keys() == METHODS.keys()
    for kind, tried in made["runs"].items():
        assert list(tried) == ["0.001", "0.004"]
        best = min(tried.values(), key=lambda r: r["mae"])
        assert tried[f"{rates.best_rates(found / 'tiny/rates.json')[kind]:g}"] == best


def test_the_command_prints_what_the_files_hold(found, capsys):
    assert main(["results", "table", "3", "--results", str(found)]) == 0
    said = capsys.readouterr().out
    mae = tables.table(3, tables.read_runs("tiny", found))[1].measures["mae_rad"][0]
    assert f"{mae:.4f}" in said and "SIDO" in said and "0.3610" in said and "alone" in said
    assert main(["results", "list", "--results", str(found)]) == 0
    said = capsys.readouterr().out
    assert said.count("to be made") == 34 - 4 and "hours in all" in said
    assert main(["results", "list", "--preset", "paper", "--results", str(found)]) == 0
    assert "hours in all" in capsys.readouterr().out


def invented(values, models=20, seed=0, data="d"):
    """Runs of a row, one a value: each with that MAE, a little other in every model."""
    rng = np.random.default_rng(seed)
    runs = []
    for value in values:
        e = value * (1 + 0.1 * rng.standard_normal(models))
        sums = np.stack([np.full(models, 100.0), 100 * e, 100 * e**2], 1)
        kinds = {kind: sums.tolist() for kind, _ in tables.MEASURES.values()}
        runs.append({"models": list(range(models)), "sums": kinds, "data": data})
    return runs


def test_an_interval_holds_models_and_seeds():
    (one,) = invented([1.0])
    value, low, high = tables.interval(tables.drawn([one], "mae_rad"))
    e = np.array(one["sums"]["rad"])[:, 1] / 100
    assert value == pytest.approx(e.mean())
    spread = e.std() / math.sqrt(len(e))
    assert (high - low) / 2 == pytest.approx(1.96 * spread, rel=0.15)
    value, low, high = tables.interval(tables.drawn(invented([1.0, 2.0, 3.0]), "mae_rad"))
    assert value == pytest.approx(2, rel=0.05) and low < 1.4 and high > 2.6
    twice = [tables.drawn(invented([1.0, 2.0]), "rmse_mm") for _ in range(2)]
    np.testing.assert_array_equal(*twice)


def test_differences_are_drawn_in_pairs():
    """Two rows alike in every model but for a constant: the difference has no spread."""
    a, b = invented([1.0])[0], invented([1.0])[0]
    b["sums"]["rad"] = (np.array(b["sums"]["rad"]) + [0, 5, 0]).tolist()
    (row,) = (r for r in tables.table(3, {"sfnet": a, "sido": b}) if r.name == "sido")
    assert row.difference == pytest.approx((0.05, 0.05, 0.05))
    b["models"] = b["models"][::-1]
    with pytest.raises(ValueError, match="different models"):
        tables.drawn([a, b], "mae_rad")


def test_agreement_is_kendalls():
    runs = dict(zip(ROWS[6].values(), invented(range(1, 10)), strict=True))
    rows = tables.table(6, runs)
    assert len(rows) == 9 and rows[4].name == "sfnet" and rows[4].difference is None
    paper = np.array([row.paper[0] for row in rows])
    ours = np.array([row.measures["mae_rad"][0] for row in rows])
    pairs = [(i, j) for i in range(9) for j in range(i)]
    signs = [np.sign((paper[i] - paper[j]) * (ours[i] - ours[j])) for i, j in pairs]
    tied = sum(paper[i] == paper[j] for i, j in pairs)
    tau = sum(signs) / math.sqrt(36 * (36 - tied))
    assert tables.agreement(rows)[0] == pytest.approx(tau)


def test_runs_on_two_datasets_are_no_table(tmp_path):
    (tmp_path / "tiny").mkdir()
    for name, data in (("sfnet", "a"), ("sido", "b")):
        (run,) = invented([1.0], data=data)
        (tmp_path / "tiny" / f"{name}.json").write_text(json.dumps(run))
    with pytest.raises(ValueError, match="2 datasets"):
        tables.read_runs("tiny", tmp_path)
