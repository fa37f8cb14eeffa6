"""Reasons not to trust a pixel that its own sums give: compiled, one pass a fringe (chapter 12)."""

from __future__ import annotations

from enum import IntEnum
from functools import lru_cache

import numpy as np

from fpputil.capture.stream import MIDDLE

CLIPPED = 0.1  # of the photographs of a fringe; one clipped of twelve hardly turns the phase
SCATTER = 0.25  # of the modulation, beyond three times the noise
UNSTEADY = 0.2  # relative change of the modulation between pitches, beyond four times its noise


class Reason(IntEnum):
    """Why a pixel is not in the mask; the first that holds."""

    GOOD = 0
    DARK = 1
    SATURATED = 2
    SCATTERED = 3
    UNSTEADY = 4
    UNSURE = 5
    OUTSIDE = 6


def look(values, clipped, steps: int, noise, threshold: float, reason, sigma) -> None:
    """Mark dark, saturated and scattered pixels of a fringe, and tell the noise of its phase.

    ``sigma_phi = sqrt(2/N) sigma / B`` with the noise at the average grey level (chapter 3).

    Parameters
    ----------
    values : (4, H, W) float32 array
    clipped : (H, W) float32 array
        As of `fpputil.capture.stream.Sums`.
    steps : int
    noise : (3,) float32 array
        Constant and slope of its variance, and the least variance.
    threshold : float
        Least modulation, grey levels.
    reason : (H, W) uint8 array
        Where 0, changed.
    sigma : (H, W) float32 array
        Filled, radians.
    """
    _kernels()[0](
        values.reshape(4, -1), clipped.reshape(-1), np.float32(steps), noise,
        np.float32(threshold), np.float32(CLIPPED * steps), reason.reshape(-1), sigma.reshape(-1),
    )  # fmt: skip


def compared(B, other, reason) -> tuple[np.ndarray, np.ndarray]:
    """log(B / other) and 1 where a pixel is good so far, both (H, W) float32, else 0."""
    change, good = np.empty_like(B), np.empty_like(B)
    _kernels()[1](*(a.reshape(-1) for a in (B, other, reason, change, good)))
    return change, good


def mark_unsteady(change, change_near, good_near, sigma, other, reason) -> None:
    """Mark where a change of the modulation differs from the mean of the good pixels around it.

    The relative noise of a modulation is the noise of its phase.
    """
    arrays = (change, change_near, good_near, sigma, other, reason)
    _kernels()[2](*(a.reshape(-1) for a in arrays))


@lru_cache(maxsize=1)
def _kernels():
    """Compile the kernels at their first use: importing numba costs a third of a second."""
    import numba
    from numba import float32 as f32

    scatter, unsteady, two, three, four = (np.float32(x) for x in (SCATTER, UNSTEADY, 2, 3, 4))
    middle = MIDDLE
    dark, saturated, scattered = (int(Reason[n]) for n in ("DARK", "SATURATED", "SCATTERED"))
    shaky = int(Reason.UNSTEADY)
    how = {"parallel": True, "error_model": "numpy", "cache": True}

    @numba.njit(**how)
    def look(values, clipped, steps, noise, threshold, most, reason, sigma):
        for i in numba.prange(len(reason)):
            M, D, S, Q = values[0, i], values[1, i], values[2, i], values[3, i]
            power = M * M + D * D
            B = two / steps * np.sqrt(power)
            variance = max(noise[0] + noise[1] * (middle + S / steps), noise[2])
            sigma[i] = np.sqrt(two / steps * variance) / B
            if reason[i] != 0:
                continue
            rest = f32(0)
            if steps > three:
                rest = max(Q - S * S / steps - power * two / steps, f32(0)) / (steps - three)
            if not threshold < B:
                reason[i] = dark
            elif clipped[i] > most:
                reason[i] = saturated
            elif np.sqrt(rest) > scatter * B + three * np.sqrt(variance):
                reason[i] = scattered

    @numba.njit(**how)
    def compare(B, other, reason, change, good):
        for i in numba.prange(len(B)):
            fine = reason[i] == 0
            good[i] = f32(fine)
            change[i] = np.log(B[i] / other[i]) if fine else f32(0)

    @numba.njit(**how)
    def unsteady_from(change, change_near, good_near, sigma, other, reason):
        for i in numba.prange(len(change)):
            if reason[i] == 0:
                off = abs(change[i] - change_near[i] / good_near[i])
                if off > unsteady + four * np.sqrt(sigma[i] ** 2 + other[i] ** 2):
                    reason[i] = shaky

    return look, compare, unsteady_from
