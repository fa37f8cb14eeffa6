"""What the command refuses: one line on stderr, by kind of error; 2 for wrong usage."""

import json
import sys

import numpy as np
import pytest

from fpputil.capture import Patterns
from fpputil.dataset.generation import generate
from fpputil.dataset.models import seeded_models
from fpputil.optics import Fringe


@pytest.mark.parametrize(
    "words, said",
    [
        ("", "a command is needed; fpp --help lists them"),
        ("dataset", "a command is needed; fpp dataset --help lists them"),
        ("what", "what"),
        ("dataset generate", "OUT"),
        ("train", "METHOD"),
        ("train what", "sfnet"),
        ("train sfnet", "--data"),
        ("evaluate x", "--data"),
        ("decode . --seed 1", "--seed"),
        ("patterns p --projector 912", "size '912' given; WIDTHxHEIGHT is needed"),
        ("patterns p --steps x", "int"),
        ("patterns p --axis z", "column"),
        ("patterns p q", "q"),
        ("decode", "FOLDER"),
        ("render r --patterns p", "none given; one of --mesh, --part, --sphere, --board is needed"),
        ("render r --patterns p --part 1 --sphere 2", "--part and --sphere given; one of --mesh"),
        ("dataset generate o --folder x --thingi10k", "--folder, --thingi10k"),
    ],
)
def test_wrong_usage_is_two(words, said, refused):
    assert said in refused(*words.split(), code=2)


@pytest.mark.parametrize(
    "options, said",
    [
        ("--models 0", "models 0 given"),
        ("--preset huge", "preset 'huge' given; the presets are tiny, small, paper, near"),
        ("--folder nowhere", "a folder of mesh files is needed"),
        ("--folder . --held-out 2", "only models from seeds have families"),
        ("--cache x", "--cache or --download given"),
        ("--models 3 --views 99", "99 views given"),
        ("--models 3 --held-out -1", "held_out -1 given"),
    ],
)
def test_datasets_that_cannot_be_made(options, said, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said in refused("dataset", "generate", "set", *options.split())
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize(
    "body, files, said",
    [
        ("--sphere 100 --size 50", "{step}.png", "--size given; it is for --mesh and --part"),
        ("--board 8x5 --turn 0 0", "{step}.png", "--turn given; it is for --mesh and --part"),
        ("--sphere 100 --supersample 9999", "{step}.png", "1599840 x 1199880 pixels, in all"),
        ("--sphere 100", "{step}.gif", "0.gif given; png, bmp, pgm, ppm, pnm, tif, tiff, npy"),
        ("--sphere 100", "{step}", "0 given; png, bmp, pgm, ppm, pnm, tif, tiff, npy"),
    ],
)
def test_renderings_that_cannot_be_leave_no_folder(body, files, said, refused, tmp_path):
    Patterns((912, 1140), (Fringe(24, 3),), files=files).save(tmp_path / "p.toml")
    words = ("render", tmp_path / "out", "--patterns", tmp_path / "p.toml", "--system", "tiny")
    assert said in refused(*words, *body.split())
    assert [path.name for path in tmp_path.iterdir()] == ["p.toml"]


def test_a_rendering_as_arrays(fpp, tmp_path):
    Patterns((912, 1140), (Fringe(24, 3),), files="{step}.npy").save(tmp_path / "p.toml")
    words = ("render", tmp_path / "out", "--patterns", tmp_path / "p.toml", "--system", "tiny")
    assert fpp(*words, "--sphere", 100)[0] == 0
    assert np.load(tmp_path / "out" / "2.npy").shape == (120, 160)


def test_download_without_the_package(refused, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "thingi10k", None)
    options = ["--thingi10k", "--cache", tmp_path / "cache", "--download"]
    assert "fpputil[thingi10k]" in refused("dataset", "generate", tmp_path / "set", *options)


def test_datasets_that_are_none(refused, tmp_path):
    assert "is not a dataset" in refused("dataset", "info", tmp_path)
    manifest = {"format": "SynthFringe", "version": 1, "complete": False}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    assert "not finished" in refused("dataset", "check", tmp_path)


@pytest.mark.parametrize(
    "options, said",
    [
        ("--preset small", "was made with the preset tiny, and small is given"),
        ("--preset huge", "preset 'huge' given; the presets are tiny, small, paper, near"),
        ("--epochs 0", "epochs 0 given"),
        ("--learning-rate nan", "learning_rate nan given"),
        ("--schedule cosine", "schedule 'cosine' given"),
        ("--mixing some", "mixing 'some' given"),
        ("--phase -1", "weight of the phase loss -1.0 given"),
        ("--noise 2 1", "noise from 2.0 to 1.0 given"),
        ("--no-plane", "plane given for sfnet; its settings are base, coordinates, dropout"),
        ("--workers -1", "workers -1 given"),
        ("--threads 0", "threads 0 given"),
        ("--device abacus", "abacus"),
        ("--start none.safetensors", "none.safetensors given; there is no such file"),
    ],
)
def test_trainings_that_cannot_begin_leave_no_folder(train, refused, tmp_path, options, said):
    assert said in train(tmp_path / "run", *options.split(), how=refused)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "method, options, said",
    [
        (
            "sido",
            "--mixing none",
            "mixing given for sido; its settings are base, coordinates, dropout",
        ),
        ("psnet", "--geometric 0.1", "weights of losses given for psnet"),
        ("sfnet", "--learning-rate 1e20 --epochs 2", "a lower learning rate may help"),
    ],
)
def test_trainings_of_some_methods(train, refused, tmp_path, method, options, said):
    assert said in train(tmp_path / "run", *options.split(), method=method, how=refused)


def test_datasets_that_cannot_train(train, refused, tmp_path):
    run = tmp_path / "run"
    assert "there is no such folder" in train(run, data=tmp_path / "none", how=refused)
    assert "it is not a dataset" in train(run, data=tmp_path, how=refused)
    generate(tmp_path / "one", "tiny", *seeded_models(1, 0), views=1)
    assert "holds no view of the split" in train(run, data=tmp_path / "one", how=refused)


@pytest.mark.parametrize(
    "options, said",
    [
        ("--views 0", "views 0 given"),
        ("--noise -1", "noise -1.0 given"),
        ("--seed -1", "seed -1 given"),
        ("--precision half", "precision 'half' given"),
        ("--split exam", "split 'exam' given; the splits are training"),
        ("--view 1 --save x.ply", "view 1 given; the split has views 0 to 0"),
        ("--save no/x.ply", "does not exist"),
        ("--json --noise 1", "--json with another camera given"),
    ],
)
def test_evaluations_that_cannot_be(data, weights, refused, options, said):
    words = ("evaluate", weights, "--data", data, "--workers", 0, *options.split())
    assert said in refused(*words)


def test_files_that_are_no_weights(data, weights, refused, tmp_path):
    (tmp_path / "cut.safetensors").write_bytes(weights.read_bytes()[:-1])
    for path, said in (
        (tmp_path / "none.safetensors", "no such file of weights"),
        (tmp_path / "net.pt", "ends in .safetensors"),
        (tmp_path / "cut.safetensors", "is cut"),
    ):
        assert said in refused("evaluate", path, "--data", data)


@pytest.mark.parametrize(
    "words, said",
    [
        ("show huge", "'huge' given"),
        ("show nowhere.json", "nowhere.json"),
        ("convert tiny there.json", "there.json is there already"),
        ("convert tiny new.txt", "new.txt given; a system file ends in"),
        ("convert tiny nowhere/a.json", "nowhere does not exist"),
    ],
)
def test_systems_that_cannot_be_read_or_written(words, said, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.json").write_text("mine")
    assert said in refused("system", *words.split())
    assert [p.name for p in tmp_path.iterdir()] == ["there.json"]
