"""What training, weights and devices refuse, and in which words."""

import math
import shutil
from dataclasses import replace

import pytest
import torch

from fpputil.dataset.generation import generate
from fpputil.dataset.models import seeded_models
from fpputil.learning import TrainingConfig, fit
from fpputil.learning.devices import device_of
from fpputil.learning.training import CHECKPOINT, CONFIG
from fpputil.networks import SFNetMethod, Weights

METHOD = SFNetMethod(base=2, levels=2)
SHORT = TrainingConfig(epochs=1, batch=3, training_views=3, validation_views=1, precision="float32")


@pytest.mark.parametrize(
    "options, words",
    [
        ({"epochs": 0}, "epochs 0 given"),
        ({"batch": 2.5}, "batch 2.5 given"),
        ({"early_stopping": -1}, "early_stopping -1 given"),
        ({"learning_rate": math.nan}, "learning_rate nan given"),
        ({"weight_decay": -1}, "weight_decay -1 given"),
        ({"schedule": "cosine"}, "schedule 'cosine' given; plateau or one-cycle"),
        ({"precision": "half"}, "precision 'half' given; float32, bfloat16 or auto"),
    ],
)
def test_wrong_settings(options, words):
    with pytest.raises(ValueError, match=words):
        TrainingConfig(**options)


@pytest.mark.parametrize(
    "name, words",
    [
        ("cuda", "device 'cuda' given; torch can use 0 such devices here"),
        ("meta", "device 'meta' given; cpu, cuda, cuda:0, cuda:1 ... are known"),
        ("cuda:x", "device 'cuda:x' given"),
    ],
)
def test_devices_that_are_not_there(monkeypatch, name, words):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    with pytest.raises(ValueError, match=words):
        device_of(name)


@pytest.fixture(scope="module")
def run(small_set, tmp_path_factory):
    out = tmp_path_factory.mktemp("refused") / "run"
    fit(METHOD, small_set, SHORT, out)
    return out


@pytest.mark.parametrize(
    "method, settings, words",
    [
        ({}, {"learning_rate": 0.007}, r"config.learning_rate 0.001, and 0.007 is asked for"),
        ({}, {"epochs": 77}, "config.epochs 1, and 77"),
        ({}, {"precision": "bfloat16"}, "config.precision float32, and bfloat16"),
        ({"base": 3}, {}, "method.base 2, and 3"),
        ({"weights": Weights(order=False)}, {}, "method.weights.order True, and False"),
    ],
)
def test_a_run_is_resumed_with_its_own_settings_alone(run, small_set, method, settings, words):
    method, settings = replace(METHOD, **method), replace(SHORT, **settings)
    with pytest.raises(ValueError, match=f"the run in {run} has {words}.*a run is resumed with"):
        fit(method, small_set, settings, run, resume=True)


def test_a_run_is_resumed_with_its_own_data_alone(run, tmp_path):
    generate(tmp_path / "other", "tiny", *seeded_models(3, 0), views=2)
    with pytest.raises(ValueError, match=r"the run in .* has data .*, and .* is asked for"):
        fit(METHOD, tmp_path / "other", SHORT, run, resume=True)


def missing(out):
    shutil.rmtree(out)


def file(out):
    shutil.rmtree(out)
    out.write_text("")


def cut_checkpoint(out):
    (out / CHECKPOINT).write_bytes((out / CHECKPOINT).read_bytes()[:-7])


def cut_config(out):
    (out / CONFIG).write_bytes((out / CONFIG).read_bytes()[:-7])


def foreign_config(out):
    (out / CONFIG).write_text("[]")


def no_config(out):
    (out / CONFIG).unlink()


@pytest.mark.parametrize(
    "change, resume, words",
    [
        (None, False, "holds a run already; resume it, or name another folder"),
        (no_config, False, "holds checkpoint.safetensors of a run without its config.json; name"),
        (no_config, True, "holds checkpoint.safetensors of a run without its config.json; name"),
        (file, False, "is a file; a run needs a folder"),
        (missing, True, "run is not there; no run to resume"),
        (cut_checkpoint, True, f"{CHECKPOINT} is cut"),
        (cut_config, True, f"{CONFIG} is cut"),
        (foreign_config, True, f"{CONFIG} is cut or no config of a run"),
    ],
)
def test_folders_that_are_no_place_for_a_run(run, small_set, tmp_path, change, resume, words):
    out = tmp_path / "run"
    shutil.copytree(run, out)
    if change is not None:
        change(out)
    before = {p.name: p.read_bytes() for p in out.iterdir()} if out.is_dir() else None
    with pytest.raises((ValueError, FileNotFoundError), match=words):
        fit(METHOD, small_set, SHORT, out, resume=resume)
    assert before is None or {p.name: p.read_bytes() for p in out.iterdir()} == before


def test_resume_needs_a_folder(small_set):
    with pytest.raises(ValueError, match="resume without a folder"):
        fit(METHOD, small_set, SHORT, resume=True)
