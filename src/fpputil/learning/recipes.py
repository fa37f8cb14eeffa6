"""How the networks of the book are trained: what the paper leaves out, by preset (chapter 8)."""

from __future__ import annotations

from dataclasses import replace

from fpputil.learning.losses import Weights
from fpputil.learning.methods import SFNetMethod
from fpputil.learning.settings import Settings
from fpputil.learning.synthfringe import Augmentation

CAMERA = Augmentation(gain=(0.8, 1.2), noise=(0.0, 2.0))


def recipe(preset: str) -> tuple[SFNetMethod, Settings]:
    """Method and settings of a preset.

    "paper" is as the paper has it, and needs a GPU. "tiny" and "small" are for two cores: a short
    one-cycle schedule, features mixed at every level, and a loss that compares absolute phases
    modulo 2 pi and averages Eq. 14. `experiments` has the runs that tell what each is worth.
    """
    method = SFNetMethod(mixing="every level", weights=Weights(order=False, mean=True))
    short = Settings(epochs=7, schedule="one-cycle", patience=0, augmentation=CAMERA)
    recipes = {
        "tiny": (method, short),
        "small": (method, replace(short, epochs=4)),
        "paper": (SFNetMethod(base=16), Settings(augmentation=CAMERA)),
    }
    if preset not in recipes:
        raise ValueError(f"preset {preset!r} given; the presets are {', '.join(recipes)}")
    return recipes[preset]
