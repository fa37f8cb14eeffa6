"""The command `fpp` as a whole, and `fpp dataset`: what it prints, and its exit codes."""

import shutil
import subprocess
import sys
from dataclasses import fields
from functools import reduce

import pytest
from cyclopts import App

from fpputil.cli import GO_ON, app, main
from fpputil.cli import train as training
from fpputil.learning.config import TrainingConfig
from fpputil.networks.losses import Weights
from fpputil.networks.methods import METHODS
from fpputil.optics.parts import part

COMMANDS = ("patterns", "render", "decode", "calibrate", "system", "dataset", "train", "evaluate",
            "predict", "results")  # fmt: skip


def test_generate_check_info_export_import(tmp_path, fpp):
    out = tmp_path / "set"
    code, said, error = fpp(
        "dataset", "generate", out, "--models", 3, "--held-out", 1, "--views", 1
    )
    assert code == 0 and "training         1 models       1 views" in said
    assert "held-out" in said and "content " in said
    assert "view/s" in error  # rate and time left
    assert fpp("dataset", "check", out)[1].startswith("every byte is as it was written")
    assert "grey levels of training 0 to" in fpp("dataset", "info", out)[1]
    code, said, _ = fpp("dataset", "export", out, tmp_path / "png", "--noise", 1)
    assert said.startswith("4 scenes in ")
    assert "held-out" in fpp("dataset", "import", tmp_path / "png", tmp_path / "back")[1]
    assert fpp("dataset", "check", tmp_path / "back")[0] == 0


def test_a_damaged_dataset_is_named_and_fails(data, tmp_path, fpp):
    out = shutil.copytree(data, tmp_path / "set")
    (out / "mask/c/0/0/0").unlink()
    code, said, _ = fpp("dataset", "check", out)
    assert code == 1 and "mask/c/0/0/0: missing" in said


def test_bad_meshes_are_told_of(tmp_path, fpp):
    folder = tmp_path / "meshes"
    folder.mkdir()
    for seed in range(3):
        part(seed).export(folder / f"part{seed}.ply")
    (folder / "empty.off").write_text("OFF\n0 0 0\n")
    (folder / "twin.ply").write_bytes((folder / "part0.ply").read_bytes())
    code, said, _ = fpp("dataset", "generate", tmp_path / "set", "--folder", folder, "--views", 2)
    assert code == 0 and "skipped empty.off: empty.off has no faces" in said and "twin.ply" in said


def test_help_lists_every_command_and_every_option(fpp):
    code, said, _ = fpp("--help")
    assert code == 0 and "exit codes" in said and "Train a network." in said
    groups = ("system", "dataset", "results")
    verbs = [(name,) for name in COMMANDS if name not in groups]
    verbs += [(group, verb) for group in groups for verb in app[group] if verb.isalpha()]
    for verb in verbs:
        code, said, _ = fpp(*verb, "--help")
        options = reduce(lambda group, name: group[name], verb, app).assemble_argument_collection()
        names = [option.name for option in options if option.name.startswith("--")]
        assert code == 0 and [name for name in names if name not in said] == [], verb
    assert "torchrun" in fpp("train", "--help")[1]
    assert "The mask is a guess" in fpp("predict", "--help")[1]
    assert "[default: 36]" in fpp("dataset", "generate", "--help")[1]


def test_train_has_an_option_for_every_setting():
    """As long as no dataclass of the library has gained or lost one."""

    def names(kind):
        return {f.name for f in fields(kind)}

    assert names(training.Settings) | {"augmentation"} == names(TrainingConfig)
    of_methods = set().union(*(names(kind) for kind in METHODS.values()))
    assert names(training.Network) | {"weights"} == of_methods
    assert names(training.Losses) - {"modulo"} | {"order"} == names(Weights)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_stop_says_what_goes_on(command, fpp, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(App, "parse_args", stopped)
    code, _, error = fpp(command)
    assert (
        code == 130
        and error == f"\nstopped; {GO_ON.get(command, 'the same command goes on from here')}\n"
    )


@pytest.mark.slow
def test_commands_load_nothing_heavy_and_name_the_extra_they_lack():
    heavy = "{'torch', 'numba', 'cv2', 'scipy', 'matplotlib', 'numpy'} & set(sys.modules)"
    code = (
        "import sys; from fpputil.cli import main\n"
        f"main(['train', '--help']); print({heavy})\n"
        "sys.modules['torch'] = None\n"
        "print(main(['evaluate', 'w.safetensors', '--data', 'x']))"
    )
    command = [sys.executable, "-c", code]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    assert run.stdout.endswith("set()\n1\n"), run.stdout
    assert run.stderr.count("\n") == 1 and "pip install 'fpputil[learning]'" in run.stderr


def test_the_module_is_the_command():
    from importlib.metadata import entry_points

    (script,) = entry_points(group="console_scripts", name="fpp")
    assert script.load() is main
