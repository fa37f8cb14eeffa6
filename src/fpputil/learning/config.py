"""How long and how to train: what a run is told before it begins (chapter 8)."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch

from fpputil.checks import not_negative, positive, whole
from fpputil.dataset.augmentation import Augmentation
from fpputil.learning.devices import precision_of

SCHEDULES = ("plateau", "one-cycle")


@dataclass(frozen=True)
class Settings:
    """How long and how to train.

    Parameters
    ----------
    epochs : int
        At most; the paper's are 250.
    batch : int
        Images a step, over all devices; the paper's are 8.
    rate : float
        Learning rate of AdamW, the highest of a one-cycle schedule. Not in the paper.
    schedule : str
        "plateau", `ReduceLROnPlateau` as in the paper, or "one-cycle", ours for short runs.
    wait : int
        Epochs without a better validation MAE after which "plateau" halves the rate.
    decay : float
        Weight decay of AdamW.
    clip : float
        Greatest norm of the gradient.
    patience : int
        Epochs without a better validation MAE after which to stop; 0 for never.
    views : int
        Views of the training split, evenly spread, to train on; 0 for all.
    validate : int
        Views of the validation split, evenly spread, on which to measure after each epoch.
    seed : int
        Of first weights, order, augmentation and dropout.
    augmentation : Augmentation
        Of the training photographs.
    precision : str
        "float32", "bfloat16", or "auto": the latter where the device has a unit for it.
    """

    epochs: int = 250
    batch: int = 8
    rate: float = 1e-3
    schedule: str = "plateau"
    wait: int = 10
    decay: float = 1e-2
    clip: float = 1.0
    patience: int = 20
    views: int = 0
    validate: int = 400
    seed: int = 0
    augmentation: Augmentation = field(default_factory=Augmentation)
    precision: str = "auto"

    def __post_init__(self):
        for name in ("epochs", "batch", "validate", "wait"):
            whole(name, getattr(self, name), 1)
        for name in ("views", "patience", "seed"):
            whole(name, getattr(self, name), 0)
        positive("rate", self.rate)
        positive("clip", self.clip)
        not_negative("decay", self.decay)
        if self.schedule not in SCHEDULES:
            raise ValueError(f"schedule {self.schedule!r} given; plateau or one-cycle is needed")
        precision_of(self.precision, torch.device("cpu"))
