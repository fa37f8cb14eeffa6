"""Where a network runs."""

import pytest
import torch

from fpputil.learning.devices import device_of, precision_of, processes


def test_devices():
    with processes() as alone:
        assert (alone.rank, alone.size) == (0, 1)
        assert alone.total(1.5, 2) == [1.5, 2.0]
    cpu = torch.device("cpu")
    assert precision_of("float32", cpu) == "float32" and precision_of("bfloat16", cpu) == "bfloat16"
    assert precision_of("auto", cpu) in ("float32", "bfloat16")


@pytest.mark.parametrize("name", ["cpu", "cuda", "cuda:1", "cuda:0", None])
def test_names_of_devices(monkeypatch, name):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setenv("LOCAL_RANK", "1")
    expected = {"cuda": "cuda:1", None: "cuda:1"}.get(name, name)
    assert device_of(name) == torch.device(expected)
