"""The state of a training run on disk: enough to go on to the same weights (chapter 8).

One safetensors file: tensors of network and optimiser, and everything else as JSON. No random
state is in it: `fit` draws from seed, epoch and batch alone.
"""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn
from torch.optim import Optimizer

from fpputil.learning.weights import check_fit, read_tensors, write_tensors

FORMAT = "fpputil run 4"
MOMENTS = ("step", "exp_avg", "exp_avg_sq")


def save_checkpoint(path: Path, network: nn.Module, optimiser: Optimizer, state: dict) -> None:
    """Write weights, moments, and whatever else a run has to remember, whole or not at all."""
    tensors = {f"network.{k}": v for k, v in network.state_dict().items()}
    for k, moments in optimiser.state_dict()["state"].items():
        tensors |= {f"optimiser.{k}.{name}": moments[name] for name in MOMENTS}
    tensors = {k: v.detach().cpu().contiguous() for k, v in tensors.items()}
    groups = optimiser.state_dict()["param_groups"]
    write_tensors(path, tensors, {"format": FORMAT, "groups": groups, **state})


def read_state(path: Path) -> dict:
    """What a checkpoint remembers besides tensors; ValueError if the file is cut or foreign."""
    return _read(path)[1]


def _read(path: Path) -> tuple[dict, dict]:
    tensors, state = read_tensors(path, "a checkpoint", sealed=True)
    if state.get("format") != FORMAT:
        raise ValueError(f"{path} is not a checkpoint of this version of fpputil")
    return tensors, state


def restore(path: Path, network: nn.Module, optimiser: Optimizer) -> dict:
    """Put a saved state back into network and optimiser, if they fit; returns the rest of it."""
    tensors, state = _read(path)
    weights = [p for group in optimiser.param_groups for p in group["params"]]
    shapes = {f"network.{k}": v.shape for k, v in network.state_dict().items()}
    for k, weight in enumerate(weights):
        of_moments = ((), weight.shape, weight.shape)
        shapes |= {f"optimiser.{k}.{m}": s for m, s in zip(MOMENTS, of_moments, strict=True)}
    check_fit(path, tensors, shapes)
    network.load_state_dict({k: tensors[f"network.{k}"] for k in network.state_dict()})
    moments = {k: {m: tensors[f"optimiser.{k}.{m}"] for m in MOMENTS} for k in range(len(weights))}
    for k, weight in enumerate(weights):  # in its memory layout, channels last or not
        for name in MOMENTS[1:]:
            moments[k][name] = torch.empty_like(weight).copy_(moments[k][name])
    optimiser.load_state_dict({"state": moments, "param_groups": state["groups"]})
    return state
