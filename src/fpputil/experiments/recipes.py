"""How the networks of the book are trained: what the paper leaves out, by preset (chapter 8)."""

from __future__ import annotations

from dataclasses import replace

from fpputil.dataset.augmentation import Augmentation
from fpputil.learning.config import TrainingConfig
from fpputil.networks.losses import Weights
from fpputil.networks.methods import METHODS, Method

CAMERA = Augmentation(gain=(0.8, 1.2), noise=(0.0, 1.0))
WIDTHS = {"sfnet": 2, "sido": 2.5, "psnet": 2, "dlalnet": 3}
"""Channels of the finest level, in parts, that give all methods about as many parameters."""


def recipe(preset: str, name: str = "sfnet") -> tuple[Method, TrainingConfig]:
    """Method and settings of a preset.

    "paper" has the losses, levels, batch, epochs, optimiser and schedule of the paper; width,
    rate, dropout, patience and augmentation it does not give, they are ours. It needs a GPU.
    "tiny" and "small" are for two cores: a short one-cycle schedule, five levels, as pictures are
    smaller, and for SFNet features mixed at every level and a loss that compares absolute phases
    modulo 2 pi and averages Eq. 14. `choices` has the runs that tell what these are worth.

    Parameters
    ----------
    preset : str
        "tiny", "small" or "paper".
    name : str
        One of `METHODS`.
    """
    short = TrainingConfig(
        epochs=3, learning_rate=2e-3, schedule="one-cycle", early_stopping=0, augmentation=CAMERA
    )
    recipes = {
        "tiny": (5, short),
        "small": (5, replace(short, epochs=4)),
        "paper": (6, TrainingConfig(augmentation=CAMERA)),
    }
    if preset not in recipes:
        raise ValueError(f"preset {preset!r} given; the presets are {', '.join(recipes)}")
    if name not in METHODS:
        raise ValueError(f"method {name!r} given; the methods are {', '.join(METHODS)}")
    levels, settings = recipes[preset]
    method = METHODS[name](base=sized(name, 8), levels=levels)
    if name == "sfnet" and preset != "paper":
        ours = {"mixing": "every level", "weights": Weights(order=False, mean=True)}
        method = replace(method, **ours)
    return method, settings


def sized(name: str, unit: int) -> int:
    """Channels of the finest level of a method; with the same `unit` all cost about the same."""
    return int(WIDTHS[name] * unit)
