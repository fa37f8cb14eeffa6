"""What a camera and a surface may do to a photograph (chapter 7)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter

from fpputil.checks import not_negative, positive
from fpputil.optics.view import View

BLOTCHES = 40  # of a texture in a row of pixels, about


@dataclass(frozen=True)
class Augmentation:
    """What a camera may do to a photograph, each drawn anew for every view and epoch.

    Parameters
    ----------
    gain : (low, high)
        Exposure; it acts on the photographs and on the modulation behind the mask.
    noise : (low, high)
        Standard deviation of the read noise, grey levels.
    gamma : (low, high)
        Camera response.
    """

    gain: tuple[float, float] = (1.0, 1.0)
    noise: tuple[float, float] = (0.0, 0.0)
    gamma: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self):
        for name, check in (("gain", positive), ("noise", not_negative), ("gamma", positive)):
            low, high = getattr(self, name)
            if check(name, low) > check(name, high):
                raise ValueError(f"{name} from {low} to {high} given; the lower bound comes first")

    def draw(self, rng: np.random.Generator) -> dict[str, float]:
        """Options of one camera for `View.frames`."""
        camera = {k: float(rng.uniform(*getattr(self, k))) for k in ("gain", "noise", "gamma")}
        return {**camera, "seed": int(rng.integers(2**53))}


def textured(view: View, contrast: float, seed) -> View:
    """A view whose surface has blotches on it, by a share `contrast` darker than the rest."""
    noise = np.random.default_rng(seed).standard_normal(view.mask.shape)
    blotches = gaussian_filter(noise, view.mask.shape[1] / BLOTCHES) > 0
    return replace(view, shade=view.shade * (1 - contrast * blotches).astype(np.float32))


def rephotograph(frame: np.ndarray, gain, noise, gamma, seed) -> np.ndarray:
    """A stored photograph through another camera, uint8."""
    light = 255 * (np.minimum(gain * frame.astype(np.float32) / 255, 1)) ** np.float32(gamma)
    if noise:
        light += noise * np.random.default_rng(seed).standard_normal(light.shape, np.float32)
    return np.rint(np.clip(light, 0, 255)).astype(np.uint8)
