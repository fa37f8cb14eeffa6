"""Settings, the recipes of the presets, and where a network runs."""

import math

import pytest
import torch

from fpputil.experiments.registry import CAMERA, recipe
from fpputil.learning.config import TrainingConfig
from fpputil.learning.devices import device_of, precision_of, processes
from fpputil.networks.losses import Weights
from fpputil.networks.methods import SFNetMethod


@pytest.mark.parametrize(
    "options, said",
    [
        ({"epochs": 0}, "epochs 0 given"),
        ({"batch": 0}, "batch 0 given"),
        ({"batch": 2.5}, "batch 2.5 given"),
        ({"validation_views": 0}, "validation_views 0 given"),
        ({"early_stopping": -1}, "early_stopping -1 given"),
        ({"training_views": -1}, "training_views -1 given"),
        ({"plateau_patience": 0}, "plateau_patience 0 given"),
        ({"seed": -1}, "seed -1 given"),
        ({"learning_rate": 0}, "learning_rate 0 given"),
        ({"learning_rate": math.nan}, "learning_rate nan given"),
        ({"max_grad_norm": 0}, "max_grad_norm 0 given"),
        ({"weight_decay": -1}, "weight_decay -1 given"),
        ({"schedule": "cosine"}, "schedule 'cosine' given; plateau or one-cycle"),
        ({"precision": "half"}, "precision 'half' given; float32, bfloat16 or auto"),
    ],
)
def test_wrong_settings_are_named(options, said):
    with pytest.raises(ValueError, match=said):
        TrainingConfig(**options)


def test_recipes():
    for name in ("tiny", "small"):
        method, settings = recipe(name)
        assert isinstance(method, SFNetMethod) and settings.augmentation == CAMERA
        assert (settings.schedule, settings.early_stopping) == ("one-cycle", 0)
    method, settings = recipe("paper")
    assert (method.levels, method.frames, method.mixing) == (6, 1, "deepest")
    assert method.weights == Weights(1.0, 1e-2, 1e-6, order=True, mean=False)
    assert (settings.epochs, settings.schedule, settings.batch) == (250, "plateau", 8)
    with pytest.raises(ValueError, match="preset 'huge' given; the presets are tiny, small, paper"):
        recipe("huge")


def test_devices():
    with processes() as alone:
        assert (alone.rank, alone.size) == (0, 1)
        assert alone.total(1.5, 2) == [1.5, 2.0]
    cpu = torch.device("cpu")
    assert precision_of("float32", cpu) == "float32" and precision_of("bfloat16", cpu) == "bfloat16"
    assert precision_of("auto", cpu) in ("float32", "bfloat16")


@pytest.mark.parametrize("name", ["cpu", "cuda", "cuda:1", "cuda:0"])
def test_names_of_devices(monkeypatch, name):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    monkeypatch.setenv("LOCAL_RANK", "1")
    expected = {"cuda": "cuda:1"}.get(name, name)
    assert device_of(name) == torch.device(expected)


@pytest.mark.parametrize(
    "name, said",
    [
        ("cuda", "device 'cuda' given; torch can use 0 such devices here"),
        ("cuda:0", "torch can use 0 such"),
        ("meta", "device 'meta' given; cpu, cuda, cuda:0, cuda:1 ... are known"),
        ("cuda:x", "device 'cuda:x' given"),
        ("", "device '' given"),
    ],
)
def test_devices_that_are_not_there(monkeypatch, name, said):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    with pytest.raises(ValueError, match=said):
        device_of(name)
