"""Settings, the recipes of the presets, and where a network runs."""

import pytest
import torch

from fpputil.experiments.recipes import CAMERA, recipe
from fpputil.learning.devices import device_of, precision_of, processes
from fpputil.networks.losses import Weights
from fpputil.networks.methods import SFNetMethod


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
