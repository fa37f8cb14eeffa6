"""`fpp train` and `fpp evaluate`, as a user types them: what they print and leave behind."""

import json
import shutil

import pytest
import safetensors
import torch
import trimesh
from safetensors.torch import load_file, save_file

from fpputil.dataset.augmentation import Augmentation
from fpputil.learning import evaluation
from fpputil.learning.log import read_log
from fpputil.learning.weights import load_weights, read_metrics


@pytest.fixture
def evaluate(fpp, data, weights):
    def run(*options, weights=weights, data=data, how=fpp):
        return how("evaluate", weights, "--data", data, "--workers", 0, *options)

    return run


def test_train_says_how_it_went(train, tmp_path):
    code, said, error = train(tmp_path / "run", "--epochs", 2)
    assert code == 0 and said.startswith("2 epochs, ") and said.count("\n") == 1
    assert "image/s" in error and "validation MAE" in error
    best = min(read_log(tmp_path / "run/log.csv"), key=lambda row: row["validation_mae"])
    assert f"best validation MAE {best['validation_mae']:.4f} rad" in said
    assert f"after epoch {best['epoch']:.0f}, in {tmp_path / 'run/weights.safetensors'}" in said


def test_every_option_of_train_arrives(train, tmp_path):
    options = """--learning-rate 0.002 --schedule plateau --weight-decay 0.5 --max-grad-norm 2
        --plateau-patience 3 --early-stopping 7 --training-views 3 --batch 3 --seed 11 --frames 2
        --reference mid --gain 0.5 2 --gamma 0.9 1.1 --dropout 0.25 --mixing none --target phase
        --phase 2 --consistency 0.5 --geometric 0.25 --modulo --mean --l1"""
    assert train(tmp_path / "run", *options.split())[0] == 0
    written = json.loads((tmp_path / "run/config.json").read_text())
    settings, method = written["config"], written["method"]
    wanted = {"learning_rate": 0.002, "schedule": "plateau", "weight_decay": 0.5}
    wanted |= {"max_grad_norm": 2, "early_stopping": 7, "plateau_patience": 3}
    wanted |= {"training_views": 3, "batch": 3, "seed": 11, "epochs": 1, "validation_views": 2}
    assert {k: settings[k] for k in wanted} == wanted
    wanted = {"frames": 2, "dropout": 0.25, "mixing": "none", "target": "phase", "base": 2}
    wanted |= {"reference": "mid", "levels": 2}
    assert {k: method[k] for k in wanted} == wanted
    weights = {"phase": 2, "consistency": 0.5, "geometric": 0.25}
    assert method["weights"] == weights | {"order": False, "mean": True, "l1": True}
    camera = {"gain": [0.5, 2.0], "noise": [0.0, 1.0], "gamma": [0.9, 1.1]}  # noise as the recipe
    assert settings["augmentation"] == camera


def test_settings_of_a_rival_arrive(train, tmp_path):
    assert train(tmp_path / "sido", "--no-plane", method="sido")[0] == 0
    options = ("--modulo", "--geometric", 0)
    assert train(tmp_path / "dlalnet", *options, method="dlalnet")[0] == 0
    assert load_weights(tmp_path / "sido" / "weights.safetensors").method.plane is False
    weights = load_weights(tmp_path / "dlalnet" / "weights.safetensors").method.weights
    assert (weights.order, weights.geometric, weights.consistency) == (False, 0, 1e-2)


def test_a_run_begins_with_weights(train, weights, tmp_path):
    assert train(tmp_path / "run", "--start", weights, "--learning-rate", "1e-12")[0] == 0
    first, second = (load_file(f) for f in (weights, tmp_path / "run/weights.safetensors"))
    for name in first:
        torch.testing.assert_close(first[name], second[name], rtol=0, atol=1e-3)


def test_resume_needs_a_run_and_a_run_needs_resume(train, refused, weights, tmp_path):
    assert "no run to resume" in train(tmp_path / "none", "--resume", how=refused)
    run = shutil.copytree(weights.parent, tmp_path / "run")
    assert f"{run} holds a run already; resume it" in train(run, how=refused)
    error = train(run, "--resume", "--learning-rate", 0.5, how=refused)
    assert "learning_rate" in error and "0.5" in error
    assert "1 epochs" in train(run, "--resume")[1]


def test_a_dataset_of_ones_own_trains_by_any_recipe(train, fpp, data, tmp_path):
    assert fpp("dataset", "export", data, tmp_path / "png")[0] == 0
    assert fpp("dataset", "import", tmp_path / "png", tmp_path / "own")[0] == 0
    assert train(tmp_path / "run", "--preset", "small", data=tmp_path / "own")[0] == 0


@pytest.mark.parametrize("name", ["sido", "psnet", "dlalnet"])
def test_rivals_are_trained_and_measured_alike(train, evaluate, tmp_path, name):
    assert train(tmp_path / "run", method=name)[0] == 0
    code, said, _ = evaluate("--texture", 0.5, weights=tmp_path / "run" / "weights.safetensors")
    assert code == 0 and "test: 1 views of 1 models" in said and "wrong fringe orders" in said


def numbers(line):
    """Value, lower and upper end of each column of a row."""
    cells = line[32:].replace("[", " ").replace(",", " ").replace("]", " ").split()
    return [float(c) for c in cells]


def test_evaluate_prints_two_photographs_beside_one(evaluate):
    lines = evaluate()[1].splitlines()
    assert lines[0] == "test: 1 views of 1 models"
    assert lines[1].split() == "as its paper decodes range given phi_h alone".split()
    rows = {line[:32].strip(): numbers(line) for line in lines[2:]}
    assert [len(row) for row in rows.values()] == [9, 9, 9, 9, 3, *[9] * 8]
    for value, low, high in (r[:3] for r in rows.values()):
        assert low == high == pytest.approx(value, abs=1e-4)  # one model has no spread
    assert rows["MAE of wrapped phi_h, rad"] == 3 * rows["MAE of wrapped phi_h, rad"][:3]


def test_evaluate_is_the_library(evaluate, data, weights):
    options = "--split training --views 3 --noise 2 --gain 0.9 --seed 5"
    lines = evaluate(*options.split())[1].splitlines()
    assert lines[0] == "training: 3 views of 3 models"
    trained = load_weights(weights)
    camera = Augmentation(gain=(0.9, 0.9), noise=(2.0, 2.0))
    split = evaluation.open_split(trained, data, "training", camera, seed=5)
    both, told, alone = evaluation.evaluate(trained, split, views=[0, 4, 7])
    expected = [x for score in (both, told, alone) for x in score.summary(5)["mae_rad"]]
    assert numbers(lines[2]) == pytest.approx(expected, abs=6e-5)


def test_evaluate_saves_points(evaluate, data, weights, tmp_path):
    path = tmp_path / "view.ply"
    options = ("--split", "training", "--views", 1, "--view", 2, "--save", path)
    said = evaluate(*options)[1].split()
    assert len(trimesh.load(path).vertices) == int(said[0]) > 100
    split = evaluation.open_split(load_weights(weights), data, "training")
    assert int(said[4]) == split.indices[2]


def test_evaluate_keeps_the_numbers(evaluate, weights, tmp_path):
    mine = shutil.copytree(weights.parent, tmp_path / "run") / "weights.safetensors"
    before = mine.read_bytes()
    evaluate("--json", weights=mine)
    said = evaluate("--split", "held-out", "--json", weights=mine)[1]
    metrics = read_metrics(mine)
    assert set(metrics) == {"test", "held-out"}
    held_out = metrics["held-out"]
    printed = numbers(said.splitlines()[2])[:3]
    assert held_out["two photographs"]["mae_rad"] == pytest.approx(printed, abs=6e-5)
    assert held_out["views"] == 1
    assert held_out["camera"] == {"gain": 1.0, "noise": 0.0, "gamma": 1.0}
    assert mine.read_bytes() == before


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"camera": [240, 320]}, "the network was trained for [240, 320]"),
        (
            {"pitches": {"high": 18, "mid": 114, "zmin": 304, "unit": 912}},
            "the network was trained for {'high': 18, 'mid': 114",
        ),
        ({"pitches": {"high": 18}}, "is for no system that there is: no pitches.mid"),
        ({"sha256": "0" * 64}, "is not as it was written: its SHA-256 is another"),
        ({"method": {"method": "unet"}}, "method 'unet' is not known"),
    ],
)
def test_a_network_for_something_else_is_one_line(
    evaluate, refused, weights, tmp_path, changes, said
):
    with safetensors.safe_open(weights, "pt") as file:
        about = json.loads(file.metadata()["metadata"])
    del about["sha256"]  # as of weights that ship
    other = tmp_path / "other.safetensors"
    save_file(load_file(weights), other, {"metadata": json.dumps({**about, **changes})})
    assert said in evaluate(weights=other, how=refused)
