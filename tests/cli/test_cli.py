"""The command `fpp`, as a user types it: what it prints, and its exit codes."""

import json
import shutil
import subprocess
import sys

import pytest

from fpputil.cli import main
from fpputil.dataset.generation import generate
from fpputil.dataset.models import seeded_models
from fpputil.optics.parts import part


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("cli") / "set"
    generate(out, "tiny", *seeded_models(3, 1), views=1)
    return out


def test_generate_check_info_export_import(tmp_path, made, capsys):
    out = tmp_path / "set"
    options = ["--models", "3", "--held-out", "1", "--views", "1"]
    assert main(["dataset", "generate", str(out), *options]) == 0
    said = capsys.readouterr()
    assert "training         1 models       1 views" in said.out
    assert "held-out" in said.out and "content " in said.out
    assert "view/s" in said.err  # rate and time left
    assert (out / "manifest.json").read_bytes() == (made / "manifest.json").read_bytes()
    assert main(["dataset", "check", str(out)]) == 0
    assert capsys.readouterr().out.startswith("every byte is as it was written")
    assert main(["dataset", "info", str(out)]) == 0
    assert "grey levels of training 0 to" in capsys.readouterr().out
    assert main(["dataset", "export", str(out), str(tmp_path / "png"), "--noise", "1"]) == 0
    assert capsys.readouterr().out.startswith("4 scenes in ")
    assert main(["dataset", "import", str(tmp_path / "png"), str(tmp_path / "back")]) == 0
    assert "held-out" in capsys.readouterr().out
    assert main(["dataset", "check", str(tmp_path / "back")]) == 0


def test_a_damaged_dataset_is_named_and_fails(made, tmp_path, capsys):
    out = shutil.copytree(made, tmp_path / "set")
    (out / "mask/c/0/0/0").unlink()
    assert main(["dataset", "check", str(out)]) == 1
    assert "mask/c/0/0/0: missing" in capsys.readouterr().out


@pytest.mark.parametrize(
    "options, said",
    [
        (["--models", "0"], "models 0 given"),
        (["--preset", "huge"], "preset 'huge' given; the presets are tiny, small, paper"),
        (["--folder", "nowhere"], "nowhere given; a folder of mesh files"),
        (["--folder", ".", "--held-out", "2"], "only models from seeds have families"),
        (["--models", "3", "--views", "99"], "99 views given"),
        (["--thingi10k", "--cache", "nowhere"], "pip install 'fpputil[thingi10k]'"),
        (["--models", "3", "--seed", "-1"], "seed -1 given"),
        (["--models", "3", "--held-out", "-1"], "held_out -1 given"),
    ],
)
def test_wrong_options_are_one_line(options, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["dataset", "generate", "set", *options]) == 1
    error = capsys.readouterr().err
    assert error.startswith("fpp: ") and said in error and error.count("\n") == 1
    assert not (tmp_path / "set").exists()


def test_download_without_the_package_is_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "thingi10k", None)
    options = ["--thingi10k", "--cache", str(tmp_path / "cache"), "--download"]
    assert main(["dataset", "generate", str(tmp_path / "set"), *options]) == 1
    error = capsys.readouterr().err
    assert "fpputil[thingi10k]" in error and error.count("\n") == 1


def test_bad_meshes_are_told_of(tmp_path, capsys):
    folder = tmp_path / "meshes"
    folder.mkdir()
    for seed in range(3):
        part(seed).export(folder / f"part{seed}.ply")
    (folder / "empty.off").write_text("OFF\n0 0 0\n")
    (folder / "twin.ply").write_bytes((folder / "part0.ply").read_bytes())
    call = ["dataset", "generate", str(tmp_path / "set"), "--folder", str(folder), "--views", "2"]
    assert main(call) == 0
    said = capsys.readouterr().out
    assert "skipped empty.off: empty.off has no faces" in said and "twin.ply" in said


def test_help_is_enough_to_begin():
    def said(*call):
        command = [sys.executable, "-m", "fpputil.cli", *call, "--help"]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    assert "dataset" in said() and "exit codes" in said()
    for verb in ("generate", "check", "info", "export", "import"):
        assert verb in said("dataset")
    for option in ("--preset", "--models", "--views", "--workers", "--folder", "--thingi10k",
                   "--scheduler", "--held-out", "--download"):  # fmt: skip
        assert option in said("dataset", "generate")


@pytest.mark.parametrize("call", [[], ["dataset"], ["dataset", "generate"], ["what"]])
def test_wrong_usage(call, capsys):
    with pytest.raises(SystemExit) as stop:
        main(call)
    assert stop.value.code == 2 and "usage" in capsys.readouterr().err


def test_no_traceback_for_an_unfinished_or_foreign_dataset(tmp_path, capsys):
    assert main(["dataset", "info", str(tmp_path)]) == 1
    assert "is not a dataset" in capsys.readouterr().err
    (tmp_path / "manifest.json").write_text(
        json.dumps({"format": "SynthFringe", "version": 1, "complete": False})
    )
    assert main(["dataset", "check", str(tmp_path)]) == 1
    assert "not finished" in capsys.readouterr().err
