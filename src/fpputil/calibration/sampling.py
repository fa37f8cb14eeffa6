"""A map of projector pixels, read between the camera's pixels (chapter 12)."""

from __future__ import annotations

import numpy as np

KNOWN, ASIDE = 0.3, 0.3  # least share of known pixels; most that their middle may be off, windows
ROUNDS = 10  # of reweighting, towards least absolute residuals
WRONG, EXACT = 4.0, 0.05  # times the median residual, and projector pixels, above which one goes


def light_at(image: np.ndarray, weight: np.ndarray, pixels: np.ndarray, reach: float) -> np.ndarray:
    """Values of a smooth map between its pixels, by a quadric through the known ones around.

    Least absolute residuals first, so that wrong fringe orders fall out; then least squares.

    Parameters
    ----------
    image : (H, W) array
        Projector columns or rows; NaN where unknown.
    weight : (H, W) array
        Inverse standard deviation of each pixel, up to a factor: the light there.
    pixels : (P, 2) array
        u, v.
    reach : float
        Half the window, pixels.

    Returns
    -------
    (P,) float64 array
        NaN where less than a third of the window is known or the known pixels lie to one side.
    """
    return np.array([_quadric(image, weight, u, v, max(3, round(reach))) for u, v in pixels])


def _quadric(image, weight, u, v, reach):
    left, top = (max(0, round(x) - reach) for x in (u, v))
    part = np.s_[top : max(0, round(v) + reach + 1), left : max(0, round(u) + reach + 1)]
    y, x = np.nonzero(np.isfinite(image[part]) & (weight[part] > 0))
    values, sure = (np.asarray(a[part][y, x], np.float64) for a in (image, weight))
    x, y = (x + left - u) / reach, (y + top - v) / reach
    if len(x) < KNOWN * (2 * reach + 1) ** 2 or np.hypot(x.mean(), y.mean()) > ASIDE:
        return np.nan
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1) * sure[:, None]
    values, each = values * sure, np.ones(len(x))
    for _ in range(ROUNDS):
        normal = terms.T * each
        off = np.abs(terms @ np.linalg.solve(normal @ terms, normal @ values) - values)
        each = 1 / np.maximum(off, EXACT * sure)
    keep = off <= np.maximum(EXACT * sure, WRONG * np.median(off))
    return np.linalg.lstsq(terms[keep], values[keep], rcond=None)[0][0]
