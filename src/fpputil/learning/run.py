"""A training run: what changes while it goes on, and what of it lies on disk (chapter 8)."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.optim.lr_scheduler import OneCycleLR, ReduceLROnPlateau

from fpputil.learning.checkpoint import read_about, restore, save_checkpoint
from fpputil.learning.config import TrainingConfig
from fpputil.learning.devices import Processes
from fpputil.learning.weights import Trained, checksum
from fpputil.networks.methods import settings_of

CHECKPOINT = "checkpoint.safetensors"
LEFT = ("weights.safetensors", "log.csv")


@dataclass(eq=False)
class Run:
    """What changes while a network trains."""

    network: nn.Module
    optimiser: torch.optim.Optimizer
    schedule: OneCycleLR | ReduceLROnPlateau
    history: list[dict]
    step: int = 0  # in the epoch that is under way
    sums: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def best(self) -> float:
        """Least validation MAE so far, radians."""
        return min((row["validation_mae"] for row in self.history), default=math.inf)

    @property
    def waited(self) -> int:
        """Epochs since the best one."""
        maes = [row["validation_mae"] for row in self.history]
        return len(maes) - 1 - int(np.argmin(maes)) if maes else 0

    def save(self, out: Path, about: dict) -> None:
        """Write the checkpoint of the run that `about` describes."""
        state = {
            **about,
            "schedule": plain(self.schedule.state_dict()),
            "history": self.history,
            "step": self.step,
            "sums": self.sums,
            "seconds": self.seconds,
        }
        save_checkpoint(out / CHECKPOINT, self.network, self.optimiser, state)

    def go_on(self, out: Path) -> None:
        """Become the run that was saved in `out`."""
        about = restore(out / CHECKPOINT, self.network, self.optimiser)
        self.schedule.load_state_dict(about["schedule"])
        self.history, self.step = about["history"], about["step"]
        self.sums, self.seconds = about["sums"], about["seconds"]


def begin(
    method, settings: TrainingConfig, steps: int, where: Processes, start: Trained | None
) -> Run:
    """First weights, optimiser and schedule."""
    torch.manual_seed(settings.seed)
    network = method.network()
    if start is not None:
        network.load_state_dict(start.network.state_dict())
    network.to(where.device, memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(
        network.parameters(), settings.learning_rate, weight_decay=settings.weight_decay
    )
    if settings.schedule == "one-cycle":
        schedule = OneCycleLR(
            optimiser,
            settings.learning_rate,
            settings.epochs * steps,
            pct_start=0.15,
            cycle_momentum=False,
        )
    else:
        # torch counts the epochs it lets pass, not the one after which it acts
        schedule = ReduceLROnPlateau(
            optimiser, factor=0.5, patience=settings.plateau_patience - 1, threshold=0.0
        )
    return Run(network, optimiser, schedule, [])


def describe(method, settings, data, precision: str, start: Trained | None, size: int) -> dict:
    """What a run is: two runs that agree in this, device and threads end in the same weights.

    Raises
    ------
    ValueError
        If the network to begin with is of another method.
    """
    if start is not None:
        kept = [settings_of(m) | {"weights": 0, "dropout": 0} for m in (start.method, method)]
        for name, before, now in _differences(*kept):
            raise ValueError(
                f"a network with {name} {before} to begin with given, and one with {now} is to "
                "be trained; only losses and dropout may differ"
            )
    return {
        "method": settings_of(method),
        "settings": {**asdict(settings), "augmentation": asdict(settings.augmentation)},
        "data": data.store.name,
        "precision": precision,
        "start": None if start is None else checksum(start.network),
        "processes": size,
    }


def claim(out: Path, about: dict, resume: bool) -> None:
    """Make the folder `out` that of the run `about` describes.

    Raises
    ------
    ValueError
        If it holds a run and `resume` is not given, or another run is to be resumed.
    """
    if out.exists() and not out.is_dir():
        raise ValueError(f"{out} is a file; a run needs a folder")
    out.mkdir(parents=True, exist_ok=True)
    if not resume:
        if (out / CHECKPOINT).is_file():
            raise ValueError(f"{out} holds a run already; resume it, or name another folder")
        if left := [name for name in LEFT if (out / name).exists()]:
            raise ValueError(
                f"{out} holds {left[0]} of a run without its checkpoint; name another folder"
            )
        return
    saved, wanted = read_about(out / CHECKPOINT), plain(about)
    other = list(_differences({k: saved.get(k) for k in wanted}, wanted))
    if other:
        name, before, now = other[0]
        raise ValueError(
            f"the run in {out} has {name} {before}, and {now} is asked for; a run is resumed with "
            "the settings and data it began with"
        )


def _differences(a, b, name: str = ""):
    """Names, joined by dots, and both values of what differs between two nested dicts."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in {**a, **b}:
            inner = f"{name}.{key}" if name else key
            yield from _differences(a.get(key), b.get(key), inner)
    elif a != b:
        yield name, a, b


def plain(value):
    """The value as JSON gives it back."""
    return json.loads(json.dumps(value))
