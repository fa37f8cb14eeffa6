"""Weights on disk: safetensors with the method and its data inside (chapter 8)."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field
from pathlib import Path

import safetensors
import torch
from safetensors.torch import load, save
from torch import nn

from fpputil.files import write_whole
from fpputil.networks.methods import Method, method_of, settings_of

FORMAT = "fpputil weights 2"


@dataclass(frozen=True, eq=False)
class Trained:
    """A network, in float32 and evaluation mode, and what one needs to use it.

    The metadata hold pitches and camera (H, W) of the dataset, extremes of its grey levels, and
    whatever else was known when it was saved: name of the dataset, course of the training.
    """

    method: Method
    network: nn.Module
    metadata: dict = field(default_factory=dict)


def check_rig(trained: Trained) -> None:
    """ValueError unless weights say for which pitches, camera and grey levels they are."""
    if lacking := {"pitches", "camera", "extremes"} - set(trained.metadata):
        raise ValueError(f"these weights do not say for which {min(lacking)} they are")


def save_weights(path: str | Path, trained: Trained, dtype=torch.float16) -> None:
    """Write a network whole or not at all; in 16 bit unless another dtype is given."""
    path = _name(path)
    weights = trained.network.state_dict()
    tensors = {k: v.detach().cpu().to(dtype).contiguous() for k, v in weights.items()}
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise ValueError(f"{name} has weights that are not finite in {dtype}; nothing is saved")
    metadata = {"format": FORMAT, "method": settings_of(trained.method), **trained.metadata}
    write_whole(path, save(tensors, {"metadata": json.dumps(metadata)}))


def load_weights(path: str | Path) -> Trained:
    """The network of `save_weights`; an error if the file is cut, not ours, or does not fit."""
    path = _name(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} given; there is no such file of weights")
    metadata, tensors = read_metadata(path, "a safetensors file"), load(path.read_bytes())
    kind = metadata.pop("format", None) if isinstance(metadata, dict) else None
    if str(kind).startswith("fpputil run"):
        raise ValueError(f"{path} is the checkpoint of a run; weights.safetensors is beside it")
    if kind != FORMAT:
        raise ValueError(f"{path} is not a file of weights of this version of fpputil")
    try:
        method = method_of(metadata.pop("method", None))
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} describes no method of this version: {error}") from error
    with torch.random.fork_rng(devices=[]):
        network = method.network()
    check_fit(path, tensors, {k: v.shape for k, v in network.state_dict().items()})
    if not all(torch.isfinite(tensor).all() for tensor in tensors.values()):
        raise ValueError(f"{path} holds weights that are not finite")
    network.load_state_dict(tensors)
    return Trained(method, network.eval(), metadata)


def read_metadata(path: Path, kind: str):
    """JSON inside a safetensors file; ValueError if the file is cut or foreign."""
    try:
        with safetensors.safe_open(path, "pt") as file:
            return json.loads((file.metadata() or {}).get("metadata", "null"))
    except (safetensors.SafetensorError, ValueError) as error:
        raise ValueError(f"{path} is cut or not {kind} ({error})") from error


def write_metrics(path: str | Path, trained: Trained, split: str, measures: dict) -> Path:
    """Write what was measured on a split as JSON beside the weights, other splits kept.

    NaN, for what could not be measured, becomes null. Returns the JSON file; ValueError if `path`
    is no longer the file of these weights.
    """
    beside = _name(path).with_suffix(".json")
    if checksum(load_weights(path).network) != checksum(trained.network):
        raise ValueError(f"{path} is no longer the network that was measured; nothing is recorded")
    metrics = (read_metrics(path) if beside.exists() else {}) | {split: short(measures)}
    metadata = {"method": settings_of(trained.method), **trained.metadata, "metrics": metrics}
    write_whole(beside, f"{json.dumps(metadata, indent=1)}\n".encode())
    return beside


def read_metrics(path: str | Path) -> dict[str, dict]:
    """What `write_metrics` wrote beside weights, by split."""
    beside = _name(path).with_suffix(".json")
    if not beside.is_file():
        raise FileNotFoundError(f"{beside} is not there; measure first: fpp evaluate {path} --json")
    try:
        return dict(json.loads(beside.read_text(encoding="utf-8"))["metrics"])
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{beside} holds no metrics of weights ({error}); remove it") from error


def short(value):
    """The value with numbers of seven digits, and None for NaN, as JSON has it.

    >>> short({"mae": (1 / 3, math.nan)})
    {'mae': [0.3333333, None]}
    """
    if isinstance(value, dict):
        return {k: short(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [short(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.7g}") if math.isfinite(value) else None
    return value


def plain(value):
    """The value as JSON gives it back.

    >>> plain({"extremes": (0.0, 251.0)})
    {'extremes': [0.0, 251.0]}
    """
    return json.loads(json.dumps(value))


def checksum(network: nn.Module) -> str:
    """SHA-256 of all weights, in float32."""
    tensors = {k: v.cpu().float().contiguous() for k, v in network.state_dict().items()}
    return hashlib.sha256(save(tensors)).hexdigest()


def check_fit(path: Path, tensors: dict, shapes: dict) -> None:
    """ValueError unless tensors of a file have the names and shapes that its network needs."""
    saved = {name: tensor.shape for name, tensor in tensors.items()}
    if wrong := sorted(k for k in shapes | saved if shapes.get(k) != saved.get(k)):
        raise ValueError(
            f"{path} does not fit this network: {wrong[0]} and {len(wrong) - 1} more tensors are "
            "missing, extra or of another shape"
        )


def _name(path: str | Path) -> Path:
    path = Path(path)
    if path.suffix != ".safetensors":
        raise ValueError(f"{path.name} given; a file of weights ends in .safetensors")
    return path
