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

from fpputil.checks import write_whole

FORMAT = "fpputil run 1"
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
    write_whole(path, save(tensors, {"about": text}))


def read_about(path: Path) -> dict:
    """What a checkpoint remembers besides tensors; ValueError if the file is cut or foreign."""
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not there; no run to resume")
    try:
        with safetensors.safe_open(path, "pt") as file:
            about = json.loads((file.metadata() or {}).get("about", "null"))
    except (safetensors.SafetensorError, ValueError) as error:
        raise ValueError(f"{path} is cut or not a checkpoint ({error})") from error
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise ValueError(f"{path} is not a checkpoint of this version of fpputil")
    return about


def restore(path: Path, network: nn.Module, optimiser: Optimizer) -> dict:
    """Put a saved state back into network and optimiser; returns `about`."""
    about, tensors = read_about(path), load(path.read_bytes())
    inside = {k.removeprefix("network."): v for k, v in tensors.items() if k.startswith("network.")}
    network.load_state_dict(inside)
    weights = [p for group in optimiser.param_groups for p in group["params"]]
    state = {}
    for k, weight in enumerate(weights):
        if f"optimiser.{k}.step" in tensors:
            moments = {name: tensors[f"optimiser.{k}.{name}"] for name in MOMENTS}
            # in the memory layout of the weights, channels last or not
            for name in MOMENTS[1:]:
                moments[name] = torch.empty_like(weight).copy_(moments[name])
            state[k] = moments
    optimiser.load_state_dict({"state": state, "param_groups": about["groups"]})
    return about
