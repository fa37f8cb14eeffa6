"""How the networks of the book are trained: what the paper leaves out, by preset (chapter 8)."""

from __future__ import annotations

from dataclasses import replace

from fpputil.learning.losses import Weights
from fpputil.learning.methods import SFNetMethod
from fpputil.learning.settings import Settings
from fpputil.learning.synthfringe import Augmentation

CAMERA = Augmentation(gain=(0.8, 1.2), noise=(0.0, 1.0))


def recipe(preset: str) -> tuple[SFNetMethod, Settings]:
    """Method and settings of a preset.

    "paper" has the losses, levels, batch, epochs, optimiser and schedule of the paper; width,
    rate, dropout, patience and augmentation it does not give, they are ours. It needs a GPU.
    "tiny" and "small" are for two cores: a short one-cycle schedule, five levels, as pictures are
    smaller, features mixed at every level, and a loss that compares absolute phases modulo 2 pi
    and averages Eq. 14.
    `experiments` has the runs that tell what these choices are worth.
    """
    method = SFNetMethod(
        base=16, levels=5, mixing="every level", weights=Weights(order=False, mean=True)
    )
    short = Settings(epochs=3, rate=2e-3, schedule="one-cycle", patience=0, augmentation=CAMERA)
    recipes = {
        "tiny": (method, short),
        "small": (method, replace(short, epochs=4)),
        "paper": (SFNetMethod(base=16), Settings(augmentation=CAMERA)),
    }
    if preset not in recipes:
        raise ValueError(f"preset {preset!r} given; the presets are {', '.join(recipes)}")
    return recipes[preset]
