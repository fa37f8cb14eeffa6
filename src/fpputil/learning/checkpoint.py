"""The state of a training run on disk: enough to go on to the same weights (chapter 8).

One safetensors file: tensors of network and optimiser, and everything else as JSON. No random
state is in it: `training` draws from seed, epoch and batch alone.
"""

from __future__ import annotations

import json
from pathlib import Path

import safetensors
import torch
from safetensors.torch import load, save
from torch import nn
from torch.optim import Optimizer

from fpputil.files import write_whole

FORMAT = "fpputil run 2"
MOMENTS = ("step", "exp_avg", "exp_avg_sq")


def save_checkpoint(path: Path, network: nn.Module, optimiser: Optimizer, about: dict) -> None:
    """Write the state whole or not at all.

    Parameters
    ----------
    about : dict
        Whatever else the run has to remember, as JSON can hold it.
    """
    tensors = {f"network.{k}": v for k, v in network.state_dict().items()}
    for k, moments in optimiser.state_dict()["state"].items():
        tensors |= {f"optimiser.{k}.{name}": moments[name] for name in MOMENTS}
    tensors = {k: v.detach().cpu().contiguous() for k, v in tensors.items()}
    groups = optimiser.state_dict()["param_groups"]
    text = json.dumps({"format": FORMAT, "groups": groups, **about})
    write_whole(path, save(tensors, {"metadata": text}))


def read_about(path: Path) -> dict:
    """What a checkpoint remembers besides tensors; ValueError if the file is cut or foreign."""
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not there; no run to resume")
    try:
        with safetensors.safe_open(path, "pt") as file:
            about = json.loads((file.metadata() or {}).get("metadata", "null"))
    except (safetensors.SafetensorError, ValueError) as error:
        raise ValueError(f"{path} is cut or not a checkpoint ({error})") from error
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise ValueError(f"{path} is not a checkpoint of this version of fpputil")
    return about


def restore(path: Path, network: nn.Module, optimiser: Optimizer) -> dict:
    """Put a saved state back into network and optimiser; returns `about`.

    Raises
    ------
    ValueError
        If the file is cut or foreign, or its tensors are not those of this network.
    """
    about, tensors = read_about(path), load(path.read_bytes())
    weights = [p for group in optimiser.param_groups for p in group["params"]]
    trained = any(name.startswith("optimiser.") for name in tensors)
    needed = {f"network.{k}": v.shape for k, v in network.state_dict().items()}
    for k, weight in enumerate(weights if trained else ()):
        shapes = ((), weight.shape, weight.shape)
        needed |= {f"optimiser.{k}.{m}": s for m, s in zip(MOMENTS, shapes, strict=True)}
    found = {name: tensor.shape for name, tensor in tensors.items()}
    wrong = sorted(k for k in needed | found if needed.get(k) != found.get(k))
    if wrong:
        raise ValueError(
            f"{path} does not fit this network: {wrong[0]} and {len(wrong) - 1} more tensors "
            "are missing, extra or of another shape"
        )
    network.load_state_dict({k: tensors[f"network.{k}"] for k in network.state_dict()})
    state = {}
    for k, weight in enumerate(weights if trained else ()):
        state[k] = {name: tensors[f"optimiser.{k}.{name}"] for name in MOMENTS}
        for name in MOMENTS[1:]:  # in the memory layout of the weights, channels last or not
            state[k][name] = torch.empty_like(weight).copy_(state[k][name])
    optimiser.load_state_dict({"state": state, "param_groups": about["groups"]})
    return about
