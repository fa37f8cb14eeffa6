"""Weights on disk: safetensors with the method and its data inside (chapter 8)."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field
from pathlib import Path

import torch
from safetensors.torch import load, save
from torch import nn

from fpputil.checks import (
    anything,
    conform,
    finite,
    one_line,
    one_or_more,
    parse_json,
    read_json,
)
from fpputil.files import write_whole
from fpputil.networks.methods import Method, method_of, settings_of
from fpputil.optics.system import PITCHES

FORMAT = "fpputil weights 2"
RIG = {"pitches": PITCHES, "camera": (one_or_more, one_or_more), "extremes": (finite, finite)}
"""Form of what weights know of the system they are for, if they do."""


METRICS = {"metrics": {...: {...: anything}}, ...: anything}
"""Form of the file beside weights."""

FOUND = ("uncertainty", "metrics")
"""What is measured later than the weights."""


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
    if lacking := RIG.keys() - trained.metadata.keys():
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
    write_tensors(path, tensors, metadata)


def load_weights(path: str | Path) -> Trained:
    """The network of `save_weights`; an error if the file is cut, not ours, or does not fit."""
    path = _name(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} given; there is no such file of weights")
    tensors, metadata = read_tensors(path, "a safetensors file", sealed=False)
    kind = metadata.pop("format", None)
    if str(kind).startswith("fpputil run"):
        raise ValueError(f"{path} is the checkpoint of a run; weights.safetensors is beside it")
    if kind != FORMAT:
        raise ValueError(f"{path} is not a file of weights of this version of fpputil")
    try:
        method = method_of(metadata.pop("method", None))
        with torch.device("meta"):  # before any memory is taken for it
            shapes = {k: v.shape for k, v in method.network().state_dict().items()}
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        reason = one_line(error)
        raise ValueError(f"{path} describes no method of this version: {reason}") from error
    check_fit(path, tensors, shapes)
    if not all(torch.isfinite(tensor).all() for tensor in tensors.values()):
        raise ValueError(f"{path} holds weights that are not finite")
    try:
        for name in RIG.keys() & metadata.keys():
            conform(name, metadata[name], RIG[name])
    except ValueError as error:
        raise ValueError(f"{path} is for no system that there is: {error}") from error
    with torch.random.fork_rng(devices=[]):
        network = method.network()
    network.load_state_dict(tensors)
    return Trained(method, network.eval(), metadata)


def write_tensors(path: Path, tensors: dict, metadata: dict) -> None:
    """Write tensors, JSON and the SHA-256 of both as safetensors, whole or not at all."""
    sealed = {**metadata, "sha256": _digest(tensors, metadata)}
    write_whole(path, save(tensors, {"metadata": json.dumps(sealed)}))


def read_tensors(path: Path, kind: str, sealed: bool) -> tuple[dict, dict]:
    """Tensors and JSON of a safetensors file; ValueError if it is cut, foreign or changed.

    One that is not `sealed` may lack the SHA-256.
    """
    data = path.read_bytes()  # for the library opens no name that is not UTF-8
    try:
        tensors = load(data)
        header = parse_json(data[8 : 8 + int.from_bytes(data[:8], "little")], {...: anything})
        inside = header.get("__metadata__", {}).get("metadata", "{}")
        metadata = parse_json(inside, {...: anything})
    except Exception as error:  # its own, and those of torch and of names of types
        raise ValueError(f"{path} is cut or not {kind} ({one_line(error)})") from error
    seal = metadata.pop("sha256", None)
    if sealed and seal is None:
        raise ValueError(f"{path} is not {kind} of this version of fpputil")
    if seal is not None and seal != _digest(tensors, metadata):
        raise ValueError(f"{path} is not as it was written: its SHA-256 is another")
    return tensors, metadata


def _digest(tensors: dict, metadata: dict) -> str:
    return hashlib.sha256(save(tensors, {"metadata": json.dumps(metadata)})).hexdigest()


def write_metrics(path: str | Path, trained: Trained, split: str, measures: dict) -> Path:
    """Write what was measured on a split as JSON beside the weights, other splits kept.

    NaN, for what could not be measured, becomes null. Returns the JSON file; ValueError if `path`
    is no longer the file of these weights.
    """
    metrics = read_beside(path).get("metrics", {}) | {split: short(measures)}
    return write_beside(path, trained, metrics=metrics)


def read_metrics(path: str | Path) -> dict[str, dict]:
    """What `write_metrics` wrote beside weights, by split."""
    if not (stored := read_beside(path)).get("metrics"):
        beside = _name(path).with_suffix(".json")
        raise FileNotFoundError(f"{beside} is not there; measure first: fpp evaluate {path} --json")
    return stored["metrics"]


def read_beside(path: str | Path) -> dict:
    """The JSON beside weights: metrics, uncertainty, what is known of them; {} if there is none."""
    beside = _name(path).with_suffix(".json")
    if not beside.is_file():
        return {}
    try:
        return read_json(beside, METRICS, "metrics of weights")
    except ValueError as error:
        raise ValueError(f"{error}; remove it") from error


def write_beside(path: str | Path, trained: Trained, **found) -> Path:
    """Write values by name into the JSON beside weights, others that were found there kept."""
    if checksum(load_weights(path).network) != checksum(trained.network):
        raise ValueError(f"{path} is no longer the network that was measured; nothing is recorded")
    kept = {"metrics": {}} | {k: v for k, v in read_beside(path).items() if k in FOUND}
    metadata = {"method": settings_of(trained.method), **trained.metadata, **kept, **found}
    beside = _name(path).with_suffix(".json")
    write_whole(beside, f"{json.dumps(metadata, indent=1)}\n".encode())
    return beside


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
