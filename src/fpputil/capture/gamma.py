"""A response that is not linear: how it shows in a phase, and how to take it back (chapter 12).

Projector and camera together raise the light to an exponent, gamma. That adds harmonics, which few
steps take for the fringe itself. Gamma is found where the photographs, raised to 1 / gamma, lose
their second harmonic; that needs no target, only five steps or more.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from fpputil.checks import positive
from fpputil.optics.fringes import WHITE

INVERSES = (0.15, 3.0)  # between which 1 / gamma is looked for
LEAST_STEPS = 5  # with four the second harmonic cannot be told from the fringe or from itself


def linearise(frames, gamma: float, full: float = WHITE):
    """Photographs through a response, made linear: ``255 (I / full) ** (1 / gamma)``.

    Parameters
    ----------
    frames : (...) array
        uint8, uint16 or float, 0 to `full`.
    gamma : float
        Exponent of the response; 1 leaves all but the scale.
    full : float
        Grey level of saturation.

    Returns
    -------
    (...) float32 array
        0 to 255.

    Examples
    --------
    >>> light = np.array([0.0, 0.25, 1.0])
    >>> photograph = 255 * light**0.5  # of a camera with gamma 0.5
    >>> linearise(photograph, 0.5).tolist()
    [0.0, 63.75, 255.0]
    """
    inverse = 1 / positive("gamma", gamma)
    if frames.dtype in (np.uint8, np.uint16):  # each grey level once
        return linearise(np.arange(np.iinfo(frames.dtype).max + 1.0), gamma, full)[frames]
    return (WHITE * (np.maximum(frames, 0) / full) ** inverse).astype(np.float32)


def harmonic_ratio(frames: np.ndarray, order: int) -> float:
    """Strength of a harmonic in photographs of a fringe, over that of the fringe. Chapter 12.

    Positive where the bright half of the fringe is the narrower one; 0 for a linear response.

    Parameters
    ----------
    frames : (N, P) array
        All steps, equally shifted, at P pixels.
    order : int
        2 for the second harmonic; below N / 2.

    Examples
    --------
    >>> turn = 2 * np.pi * np.arange(8) / 8
    >>> frames = (100 + 50 * np.cos(turn) + 5 * np.cos(2 * turn))[:, None]
    >>> round(harmonic_ratio(frames, 2), 6)
    0.1
    """
    steps = len(frames)
    if not 2 <= order < steps / 2:
        raise ValueError(f"harmonic {order} of {steps} steps given; it lies from 2 to below N / 2")
    turns = np.exp(-2j * np.pi * np.outer((1, order), np.arange(steps)) / steps)
    first, other = turns @ frames
    size = np.maximum(np.abs(first), 1e-12)
    along = (other * np.conj(first / size) ** order).real
    return float((along * size).sum() / (size**2).sum())


def estimate_gamma(frames: np.ndarray) -> float:
    """Exponent of the response through which a fringe was photographed. Chapter 12.

    Between 1/3 and 6.7. Of light from elsewhere it knows nothing: black should be 0.

    Parameters
    ----------
    frames : (N, P) array
        All N >= 5 steps at P pixels that are well lit and not saturated, grey levels of 255.

    Raises
    ------
    ValueError
        If there are too few steps, or no gamma in this range takes the harmonic away.

    Examples
    --------
    >>> turn = 2 * np.pi * np.arange(12) / 12
    >>> light = (1 + np.cos(turn))[:, None] / 2
    >>> round(estimate_gamma(255 * light**2.2), 2)
    2.2
    """
    if frames.ndim != 2 or len(frames) < LEAST_STEPS or frames.shape[1] == 0:
        raise ValueError(
            f"frames of shape {frames.shape} given; (steps, pixels) are needed, {LEAST_STEPS} "
            "steps or more of at least one pixel"
        )

    def second(inverse):
        return harmonic_ratio(linearise(frames, 1 / inverse), 2)

    ends = [second(inverse) for inverse in INVERSES]
    if not ends[0] < 0 < ends[1]:
        raise ValueError(
            f"the second harmonic is {ends[0]:.3f} to {ends[1]:.3f} of the fringe for gammas "
            f"{1 / INVERSES[0]:.1f} to {1 / INVERSES[1]:.2f}: none takes it away; give one, or 1"
        )
    return 1 / float(brentq(second, *INVERSES, xtol=1e-4))
