"""A response that is not linear: how it shows in a phase, and how to take it back (chapter 12).

Projector and camera together raise the light to some power. That adds harmonics to the fringe, and
few steps take a harmonic for the fringe itself. The inverse power is found where the photographs
lose their second harmonic; that needs no target, only a fringe of five steps or more.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from fpputil.checks import positive
from fpputil.optics.fringes import WHITE

POWERS = (0.15, 3.0)
LEAST_STEPS = 5
"""With four steps or fewer the second harmonic cannot be told from the fringe or from itself."""


def linearise(frames, power: float, full: float = WHITE):
    """Photographs whose light was raised to a power, made linear: ``255 (I / full) ** power``.

    Parameters
    ----------
    frames : (...) array
        uint8, uint16 or float, 0 to `full`.
    power : float
        1 leaves all but the scale.

    Returns
    -------
    (...) float32 array
        0 to 255.
    """
    positive("power", power)
    if np.issubdtype(frames.dtype, np.integer):
        table = np.arange(np.iinfo(frames.dtype).max + 1, dtype=np.float64) / full
        return (WHITE * table**power).astype(np.float32)[frames]
    return (WHITE * (np.maximum(frames, 0) / full) ** power).astype(np.float32)


def harmonic_ratio(frames: np.ndarray, order: int) -> float:
    """Strength of a harmonic in photographs of a fringe, over that of the fringe. Chapter 12.

    Parameters
    ----------
    frames : (N, P) array
        All steps, equally shifted, at P pixels.
    order : int
        2 for the second harmonic; below N / 2.

    Returns
    -------
    float
        Signed: positive where it is in step with the fringe, so that its bright half is the
        narrower one. 0 for a linear response.
    """
    steps = len(frames)
    if not 2 <= order < steps / 2:
        raise ValueError(f"harmonic {order} of {steps} steps given; it lies from 2 to below N / 2")
    turns = np.exp(-2j * np.pi * np.outer((1, order), np.arange(steps)) / steps)
    first, other = turns @ frames
    size = np.maximum(np.abs(first), 1e-12)
    along = (other * np.conj(first / size) ** order).real
    return float((along * size).sum() / (size**2).sum())


def estimate_gamma(frames: np.ndarray, full: float = WHITE) -> float:
    """The power that makes photographs of a fringe linear. Chapter 12.

    Parameters
    ----------
    frames : (N, P) array
        All N >= 5 steps at P pixels that are well lit and not saturated.
    full : float
        Grey level of saturation.

    Returns
    -------
    float
        Between 0.15 and 3. Of light from elsewhere it knows nothing: black should be 0.

    Raises
    ------
    ValueError
        If there are too few steps, or no power in this range takes the harmonic away.
    """
    if frames.ndim != 2 or len(frames) < LEAST_STEPS or frames.shape[1] == 0:
        raise ValueError(
            f"frames of shape {frames.shape} given; (steps, pixels) are needed, {LEAST_STEPS} "
            "steps or more of at least one pixel"
        )
    ends = [harmonic_ratio(linearise(frames, p, full), 2) for p in POWERS]
    if not ends[0] < 0 < ends[1]:
        raise ValueError(
            f"the second harmonic is {ends[0]:.3f} to {ends[1]:.3f} of the fringe for powers "
            f"{POWERS[0]} to {POWERS[1]}: no power takes it away; give one, or 1"
        )
    return float(
        brentq(lambda p: harmonic_ratio(linearise(frames, p, full), 2), *POWERS, xtol=1e-4)
    )
