"""How long and how to train: what a run is told before it begins (chapter 8)."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch

from fpputil.checks import not_negative, positive, whole
from fpputil.dataset.augmentation import Augmentation
from fpputil.learning.devices import precision_of


@dataclass(frozen=True)
class TrainingConfig:
    """How long and how to train.

    Parameters
    ----------
    epochs : int
        At most; the paper's are 250.
    batch : int
        Images a step, over all devices; the paper's are 8.
    learning_rate : float
        Learning rate of AdamW, the highest of a one-cycle schedule. Not in the paper.
    schedule : str
        "plateau", `ReduceLROnPlateau` as in the paper, or "one-cycle", ours for short runs.
    plateau_patience : int
        Epochs without a better validation MAE after which "plateau" halves the rate.
    weight_decay : float
        Weight decay of AdamW.
    max_grad_norm : float
        Greatest norm of the gradient.
    early_stopping : int
        Epochs without a better validation MAE after which to stop; 0 for never.
    training_views : int
        Views of the training split, evenly spread, to train on; 0 for all.
    validation_views : int
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
    learning_rate: float = 1e-3
    schedule: str = "plateau"
    plateau_patience: int = 10
    weight_decay: float = 1e-2
    max_grad_norm: float = 1.0
    early_stopping: int = 20
    training_views: int = 0
    validation_views: int = 400
    seed: int = 0
    augmentation: Augmentation = field(default_factory=Augmentation)
    precision: str = "auto"

    def __post_init__(self):
        for name in ("epochs", "batch", "validation_views", "plateau_patience"):
            whole(name, getattr(self, name), 1)
        for name in ("training_views", "early_stopping", "seed"):
            whole(name, getattr(self, name), 0)
        positive("learning_rate", self.learning_rate)
        positive("max_grad_norm", self.max_grad_norm)
        not_negative("weight_decay", self.weight_decay)
        if self.schedule not in ("plateau", "one-cycle"):
            raise ValueError(f"schedule {self.schedule!r} given; plateau or one-cycle is needed")
        precision_of(self.precision, torch.device("cpu"))
