"""`fpp train` and `fpp evaluate`, as a user types them: what they print, and their exit codes."""

import json
import shutil

import pytest
import safetensors
import torch
import trimesh
from matplotlib.figure import Figure
from safetensors.torch import load_file, save_file

from fpputil.cli import main
from fpputil.dataset.augmentation import Augmentation
from fpputil.dataset.generation import generate
from fpputil.dataset.models import seeded_models
from fpputil.learning import evaluation
from fpputil.learning.log import read_log
from fpputil.learning.weights import load_weights, read_metrics

SMALL = (
    *("--epochs", "1", "--batch", "4", "--base", "2", "--levels", "2", "--validation-views", "2"),
    *("--precision", "float32", "--threads", "1", "--workers", "0"),
)


@pytest.fixture(scope="module", autouse=True)
def small_and_quick():
    """Threads as they were; no drawing, which takes longer than a small epoch."""
    before = torch.get_num_threads()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Figure, "savefig", lambda self, file, **_: file.write(b"no picture"))
        yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Ten models, one held out, a view of each."""
    out = tmp_path_factory.mktemp("cli") / "set"
    generate(out, "tiny", *seeded_models(10, 1), views=1)
    return out


@pytest.fixture(scope="module")
def weights(data, tmp_path_factory):
    """What `fpp train` leaves behind."""
    out = tmp_path_factory.mktemp("run")
    assert main(["train", "sfnet", "--data", str(data), "--out", str(out), *SMALL]) == 0
    return out / "weights.safetensors"


def train(data, out, *options):
    return main(["train", "sfnet", "--data", str(data), "--out", str(out), *SMALL, *options])


def evaluate(weights, data, *options):
    return main(["evaluate", str(weights), "--data", str(data), "--workers", "0", *options])


def one_line(capsys):
    """The error, if it is one line and no traceback."""
    error = capsys.readouterr().err
    assert error.startswith("fpp: ") and error.count("\n") == 1, error
    return error


def test_train_says_how_it_went(data, tmp_path, capsys):
    assert train(data, tmp_path / "run", "--epochs", "2") == 0
    said = capsys.readouterr()
    assert said.out.startswith("2 epochs, ") and said.out.count("\n") == 1
    assert "image/s" in said.err and "validation MAE" in said.err
    best = min(read_log(tmp_path / "run/log.csv"), key=lambda row: row["validation_mae"])
    assert f"best validation MAE {best['validation_mae']:.4f} rad" in said.out
    assert f"after epoch {best['epoch']:.0f}, in {tmp_path / 'run/weights.safetensors'}" in said.out


def test_every_option_of_train_arrives(data, tmp_path):
    given = (
        *(
            "--learning-rate",
            "0.002",
            "--schedule",
            "plateau",
            "--weight-decay",
            "0.5",
            "--max-grad-norm",
            "2",
        ),
        *(
            "--plateau-patience",
            "3",
            "--early-stopping",
            "7",
            "--training-views",
            "3",
            "--batch",
            "3",
            "--seed",
            "11",
        ),
        *("--frames", "2", "--reference", "mid", "--gain", "0.5", "2", "--gamma", "0.9", "1.1"),
        *("--dropout", "0.25", "--mixing", "none", "--target", "phase", "--phase", "2"),
        *("--consistency", "0.5", "--geometric", "0.25", "--modulo", "--mean", "--l1"),
    )
    assert train(data, tmp_path / "run", *given) == 0
    config = json.loads((tmp_path / "run/config.json").read_text())
    settings, method = config["config"], config["method"]
    wanted = {
        "learning_rate": 0.002,
        "schedule": "plateau",
        "weight_decay": 0.5,
        "max_grad_norm": 2,
        "early_stopping": 7,
        "plateau_patience": 3,
    }
    wanted |= {"training_views": 3, "batch": 3, "seed": 11, "epochs": 1, "validation_views": 2}
    assert {k: settings[k] for k in wanted} == wanted
    wanted = {"frames": 2, "dropout": 0.25, "mixing": "none", "target": "phase", "base": 2}
    wanted |= {"reference": "mid"}
    assert {k: method[k] for k in wanted} == wanted and method["levels"] == 2
    weights = {"phase": 2, "consistency": 0.5, "geometric": 0.25}
    weights |= {"order": False, "mean": True, "l1": True}
    assert method["weights"] == weights
    camera = {"gain": [0.5, 2.0], "noise": [0.0, 1.0], "gamma": [0.9, 1.1]}  # noise as the recipe
    assert settings["augmentation"] == camera


def test_a_run_begins_with_weights(data, weights, tmp_path):
    assert train(data, tmp_path / "run", "--start", str(weights), "--learning-rate", "1e-12") == 0
    first, second = (load_file(f) for f in (weights, tmp_path / "run/weights.safetensors"))
    for name in first:
        torch.testing.assert_close(first[name], second[name], rtol=0, atol=1e-3)


def test_resume_needs_a_run_and_a_run_needs_resume(data, weights, tmp_path, capsys):
    assert train(data, tmp_path / "none", "--resume") == 1
    assert "no run to resume" in one_line(capsys)
    run = shutil.copytree(weights.parent, tmp_path / "run")
    assert train(data, run) == 1
    assert f"{run} holds a run already; resume it" in one_line(capsys)
    assert train(data, run, "--resume", "--learning-rate", "0.5") == 1
    error = one_line(capsys)
    assert "learning_rate" in error and "0.5" in error
    assert train(data, run, "--resume") == 0
    assert "1 epochs" in capsys.readouterr().out


@pytest.mark.parametrize(
    "options, said",
    [
        (["--preset", "small"], "was made with the preset tiny, and small is given"),
        (["--preset", "huge"], "preset 'huge' given; the presets are tiny, small, paper"),
        (["--epochs", "0"], "epochs 0 given"),
        (["--batch", "-1"], "batch -1 given"),
        (["--learning-rate", "nan"], "learning_rate nan given"),
        (["--schedule", "cosine"], "schedule 'cosine' given"),
        (["--precision", "half"], "precision 'half' given"),
        (["--mixing", "some"], "mixing 'some' given"),
        (["--dropout", "1"], "dropout 1.0 given"),
        (["--frames", "4"], "4 frames of each pitch given"),
        (["--target", "depth"], "target 'depth' given"),
        (["--phase", "-1"], "weight of the phase loss -1.0 given"),
        (["--base", "0"], "base 0 given"),
        (["--workers", "-1"], "workers -1 given"),
        (["--threads", "0"], "threads 0 given"),
        (["--device", "abacus"], "abacus"),
        (["--start", "none.safetensors"], "none.safetensors given; there is no such file"),
        (["--learning-rate", "1e20", "--epochs", "2"], "a lower learning rate may help"),
    ],
)
def test_wrong_options_of_train_are_one_line(data, tmp_path, capsys, options, said):
    assert train(data, tmp_path / "run", *options) == 1
    error = capsys.readouterr().err.split("\r")[-1].splitlines()  # after a bar, if there is one
    assert said in error[-1] and error[-1].startswith("fpp: ")
    assert not any("Traceback" in line for line in error)


def test_what_failed_at_once_leaves_no_folder(data, tmp_path):
    assert train(data, tmp_path / "run", "--mixing", "some") == 1
    assert not (tmp_path / "run").exists()


def test_a_dataset_of_ones_own_trains_by_any_recipe(data, tmp_path):
    folder, own = str(tmp_path / "photographs"), str(tmp_path / "own")
    assert main(["dataset", "export", str(data), folder]) == 0
    assert main(["dataset", "import", folder, own]) == 0
    assert train(own, tmp_path / "run", "--preset", "small") == 0


def test_datasets_that_cannot_train(tmp_path, capsys):
    assert train(tmp_path / "none", tmp_path / "run") == 1
    assert "there is no such folder" in one_line(capsys)
    assert train(tmp_path, tmp_path / "run") == 1
    assert "it is not a dataset" in one_line(capsys)
    generate(tmp_path / "one", "tiny", *seeded_models(1, 0), views=1)
    assert train(tmp_path / "one", tmp_path / "run") == 1
    assert "holds no view of the split" in one_line(capsys)


def numbers(line):
    """Value, lower and upper end of each column of a row."""
    cells = line[32:].replace("[", " ").replace(",", " ").replace("]", " ").split()
    return [float(c) for c in cells]


def test_evaluate_prints_two_photographs_beside_one(data, weights, capsys):
    assert evaluate(weights, data) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "test: 1 views of 1 models"
    assert lines[1].split() == ["with", "phi_r", "phi_h", "alone"]
    rows = {line[:32].strip(): numbers(line) for line in lines[2:]}
    for name in ("MAE, rad", "RMSE, rad", "median, rad", "wrong fringe orders, %", "spikes, %",
                 "spikes of the truth, %", "MAE, mm", "RMSE, mm", "median, mm",
                 "left out of the mm, %", "MAE of wrapped phi_h, rad"):  # fmt: skip
        assert len(rows[name]) == 6, name
    assert len(rows["MAE of wrapped phi_r, rad"]) == 3
    for value, low, high in (r[:3] for r in rows.values()):
        assert low == high == pytest.approx(value, abs=1e-4)  # one model has no spread
    assert rows["MAE of wrapped phi_h, rad"][:3] == rows["MAE of wrapped phi_h, rad"][3:]


def test_evaluate_is_the_library(data, weights, capsys):
    options = (
        "--split",
        "training",
        "--views",
        "3",
        "--noise",
        "2",
        "--gain",
        "0.9",
        "--seed",
        "5",
    )
    assert evaluate(weights, data, *options) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "training: 3 views of 3 models"
    trained = load_weights(weights)
    camera = Augmentation(gain=(0.9, 0.9), noise=(2.0, 2.0))
    split = evaluation.open_split(trained, data, "training", camera, seed=5)
    both, alone = evaluation.evaluate(trained, split, views=[0, 4, 7])
    expected = [*both.summary(5)["mae_rad"], *alone.summary(5)["mae_rad"]]
    assert numbers(lines[2]) == pytest.approx(expected, abs=6e-5)


def test_evaluate_saves_points(data, weights, tmp_path, capsys):
    path = tmp_path / "view.ply"
    options = ("--split", "training", "--views", "1", "--view", "2", "--save", str(path))
    assert evaluate(weights, data, *options) == 0
    said = capsys.readouterr().out
    number, index = int(said.split()[0]), int(said.split()[4])
    assert len(trimesh.load(path).vertices) == number > 100
    assert index == evaluation.open_split(load_weights(weights), data, "training").indices[2]
    assert evaluate(weights, data, "--view", "1", "--save", str(tmp_path / "x.ply")) == 1
    assert "view 1 given; the split has views 0 to 0" in one_line(capsys)
    assert evaluate(weights, data, "--save", str(tmp_path / "no" / "x.ply")) == 1
    assert "does not exist" in one_line(capsys)


def test_evaluate_keeps_the_numbers(data, weights, tmp_path, capsys):
    run = shutil.copytree(weights.parent, tmp_path / "run")
    mine = run / "weights.safetensors"
    before = load_file(mine)
    for split in ("test", "held-out"):
        assert evaluate(mine, data, "--split", split, "--json") == 0
    shown = numbers(capsys.readouterr().out.split("held-out: ")[1].splitlines()[2])
    metrics = read_metrics(mine)
    assert set(metrics) == {"test", "held-out"}
    found = metrics["held-out"]
    assert found["two photographs"]["mae_rad"] == pytest.approx(shown[:3], abs=6e-5)
    assert found["views"] == 1 and found["camera"] == {"gain": 1.0, "noise": 0.0, "gamma": 1.0}
    after = load_file(mine)
    assert all(torch.equal(before[k], after[k]) for k in before)


def test_a_split_of_nothing_is_one_line(weights, tmp_path, capsys):
    generate(tmp_path / "few", "tiny", *seeded_models(3, 0), views=1)
    assert evaluate(weights, tmp_path / "few", "--split", "held-out") == 1
    assert "holds no view of the split 'held-out'" in one_line(capsys)
    assert evaluate(weights, tmp_path / "few", "--split", "exam") == 1
    assert "split 'exam' given; the splits are training" in one_line(capsys)


@pytest.mark.parametrize(
    "options, said",
    [
        (["--views", "0"], "views 0 given"),
        (["--noise", "-1"], "noise -1.0 given"),
        (["--gain", "0"], "gain 0.0 given"),
        (["--seed", "-1"], "seed -1 given"),
        (["--precision", "half"], "precision 'half' given"),
        (["--device", "abacus"], "abacus"),
        (["--workers", "-1"], "workers -1 given"),
    ],
)
def test_wrong_options_of_evaluate_are_one_line(data, weights, capsys, options, said):
    assert evaluate(weights, data, *options) == 1
    assert said in one_line(capsys)


def rewritten(weights, path, **changes):
    """The weights as if they had been trained for something else."""
    with safetensors.safe_open(weights, "pt") as file:
        about = json.loads(file.metadata()["metadata"])
    save_file(load_file(weights), path, {"metadata": json.dumps({**about, **changes})})
    return path


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"camera": [240, 320]}, "the network was trained for [240, 320]"),
        ({"pitches": {"high": 18}}, "the network was trained for {'high': 18}"),
        ({"method": {"method": "unet"}}, "method 'unet' is not known"),
    ],
)
def test_a_network_for_something_else_is_one_line(data, weights, tmp_path, capsys, changes, said):
    other = rewritten(weights, tmp_path / "other.safetensors", **changes)
    assert evaluate(other, data) == 1
    assert said in one_line(capsys)


def test_files_that_are_no_weights_are_one_line(data, weights, tmp_path, capsys):
    assert evaluate(tmp_path / "none.safetensors", data) == 1
    assert "no such file of weights" in one_line(capsys)
    assert evaluate(tmp_path / "net.pt", data) == 1
    assert "ends in .safetensors" in one_line(capsys)
    assert evaluate(weights.parent / "checkpoint.safetensors", data) == 1
    assert "is the checkpoint of a run" in one_line(capsys)
    (tmp_path / "cut.safetensors").write_bytes(weights.read_bytes()[:-1])
    assert evaluate(tmp_path / "cut.safetensors", data) == 1
    assert "is cut" in one_line(capsys)


def test_help_is_enough_to_begin(capsys):
    def said(*call):
        with pytest.raises(SystemExit) as stop:
            main([*call, "--help"])
        assert stop.value.code == 0
        return capsys.readouterr().out

    assert "train" in said() and "evaluate" in said()
    text = said("train")
    for option in ("--data", "--out", "--resume", "--start", "--epochs", "--preset", "--precision",
                   "--mixing", "torchrun"):  # fmt: skip
        assert option in text
    text = said("evaluate")
    for option in ("--data", "--split", "--views", "--save", "--json", "--noise"):
        assert option in text


@pytest.mark.parametrize(
    "call", [["train"], ["train", "what"], ["train", "sfnet"], ["evaluate"], ["evaluate", "x"]]
)
def test_wrong_usage(call, capsys):
    with pytest.raises(SystemExit) as stop:
        main(call)
    assert stop.value.code == 2 and "usage" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["sido", "psnet", "dlalnet"])
def test_rivals_are_trained_and_measured_alike(data, tmp_path, capsys, name):
    run = tmp_path / "run"
    assert main(["train", name, "--data", str(data), "--out", str(run), *SMALL]) == 0
    capsys.readouterr()
    assert evaluate(run / "weights.safetensors", data, "--texture", "0.5") == 0
    said = capsys.readouterr().out
    assert "test: 1 views of 1 models" in said and "wrong fringe orders" in said


@pytest.mark.parametrize(
    "name, options, said",
    [
        ("sido", ["--mixing", "none"], "mixing given for sido; its settings are base, dropout"),
        ("psnet", ["--geometric", "0.1"], "weights of losses given for psnet"),
        ("dlalnet", ["--no-plane"], "plane given for dlalnet"),
        ("sfnet", ["--reference", "first"], "reference 'first' given"),
        ("sfnet", ["--noise", "2", "1"], "noise from 2.0 to 1.0 given"),
    ],
)
def test_a_setting_of_another_method_is_named(data, tmp_path, capsys, name, options, said):
    place = ("--data", str(data), "--out", str(tmp_path / "run"))
    assert main(["train", name, *place, *SMALL, *options]) == 1
    assert said in one_line(capsys)
    assert not (tmp_path / "run").exists()


def test_settings_of_a_rival_arrive(data, tmp_path):
    for name, options in (("sido", ["--no-plane"]), ("dlalnet", ["--modulo", "--geometric", "0"])):
        out = tmp_path / name
        assert main(["train", name, "--data", str(data), "--out", str(out), *SMALL, *options]) == 0
    method = load_weights(tmp_path / "sido" / "weights.safetensors").method
    assert method.plane is False
    weights = load_weights(tmp_path / "dlalnet" / "weights.safetensors").method.weights
    assert (weights.order, weights.geometric, weights.consistency) == (False, 0, 1e-2)
