"""Weights on disk: safetensors with the method, its data and its metrics inside (chapter 8)."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import safetensors
import torch
from safetensors.torch import load, save
from torch import nn

from fpputil.files import write_whole
from fpputil.networks.methods import Method, method_of, settings_of

FORMAT = "fpputil weights 1"


@dataclass(frozen=True, eq=False)
class Trained:
    """A network and what one needs to use it.

    Parameters
    ----------
    method : Method
    network : nn.Module
        In float32, in evaluation mode.
    about : dict
        pitches and camera (H, W) of the dataset, extremes of its grey levels, and whatever else
        was known when it was saved: data checksum, metrics.
    """

    method: Method
    network: nn.Module
    about: dict = field(default_factory=dict)


def save_weights(path: str | Path, trained: Trained, dtype=torch.float16) -> None:
    """Write a network whole or not at all; in 16 bit unless another dtype is given.

    Raises
    ------
    ValueError
        If the name does not end in .safetensors, or a weight does not fit the dtype.
    """
    path = _name(path)
    own = trained.network.state_dict()
    tensors = {k: v.detach().cpu().to(dtype).contiguous() for k, v in own.items()}
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise ValueError(f"{name} has weights that are not finite in {dtype}; nothing is saved")
    about = {"format": FORMAT, "method": settings_of(trained.method), **trained.about}
    write_whole(path, save(tensors, {"about": json.dumps(about)}))


def load_weights(path: str | Path) -> Trained:
    """The network written by `save_weights`.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is cut, is not ours, or does not fit the method it names.
    """
    path = _name(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} given; there is no such file of weights")
    try:
        with safetensors.safe_open(path, "pt") as file:
            about = json.loads((file.metadata() or {}).get("about", "null"))
        tensors = load(path.read_bytes())
    except (safetensors.SafetensorError, json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is cut or not a safetensors file ({error})") from error
    found = about.pop("format", None) if isinstance(about, dict) else None
    if found != FORMAT:
        kinds = {"fpputil run": "is the checkpoint of a run; weights.safetensors is beside it",
                 "fpputil weights": "was written by another version of fpputil"}  # fmt: skip
        said = [v for k, v in kinds.items() if str(found).startswith(k)]
        raise ValueError(f"{path} {(said or ['is not a file of weights of fpputil'])[0]}")
    method = _method(about.pop("method", None), path)
    with torch.random.fork_rng(devices=[]):
        network = method.network()
    _fill(network, tensors, path)
    return Trained(method, network.eval(), about)


def record(path: str | Path, trained: Trained, split: str, found: dict) -> None:
    """Write what was measured on a split into the file measured, and as JSON beside it.

    The weights stay as they are. NaN, for what could not be measured, becomes null.

    Parameters
    ----------
    path : path
        From which `trained` was loaded.
    """
    path = _name(path)
    if checksum(load_weights(path).network) != checksum(trained.network):
        raise ValueError(f"{path} is no longer the network that was measured; nothing is recorded")
    with safetensors.safe_open(path, "pt") as file:
        dtype = file.get_tensor(next(iter(file.keys()))).dtype
    metrics = {**trained.about.get("metrics", {}), split: short(found)}
    after = replace(trained, about={**trained.about, "metrics": metrics})
    save_weights(path, after, dtype)
    text = json.dumps({"method": settings_of(trained.method), **after.about}, indent=1)
    write_whole(path.with_suffix(".json"), f"{text}\n".encode())


def short(value):
    """The value with numbers of seven digits, and None for NaN, as JSON has it."""
    if isinstance(value, dict):
        return {k: short(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [short(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.7g}") if math.isfinite(value) else None
    return value


def checksum(network: nn.Module) -> str:
    """SHA-256 of all weights, in float32."""
    tensors = {k: v.cpu().float().contiguous() for k, v in network.state_dict().items()}
    return hashlib.sha256(save(tensors)).hexdigest()


def _method(settings, path) -> Method:
    """The method that `settings` describe; ValueError with the path if they describe none."""
    try:
        return method_of(settings)
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} describes no method of this version: {error}") from error


def _fill(network: nn.Module, tensors: dict, path) -> None:
    """Put tensors into a network; ValueError unless names and shapes are the same."""
    own = network.state_dict()
    wrong = [k for k in own if k not in tensors or tensors[k].shape != own[k].shape]
    wrong += [k for k in tensors if k not in own]
    if wrong:
        raise ValueError(
            f"{path} does not fit the network it describes: {wrong[0]} and "
            f"{len(wrong) - 1} more are missing, extra or of another shape"
        )
    if not all(torch.isfinite(t).all() for t in tensors.values()):
        raise ValueError(f"{path} holds weights that are not finite")
    network.load_state_dict({k: v.to(own[k].dtype) for k, v in tensors.items()})


def _name(path: str | Path) -> Path:
    path = Path(path)
    if path.suffix != ".safetensors":
        raise ValueError(f"{path.name} given; a file of weights ends in .safetensors")
    return path
