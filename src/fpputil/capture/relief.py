"""A shape without a calibration: a phase from which a smooth ground is taken away (chapter 12).

Its heights are radians, not millimetres, and which way is up depends on where the projector stands.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import ndimage

from fpputil.capture.measurement import Measurement
from fpputil.decoding import unwrap

DEGREES = {"plane": 1, "cubic": 3}
LEAST = 100  # pixels of a phase, of which a ground is told
SAMPLE = 20_000  # pixels that tell the ground
TRIALS = 300  # planes through three pixels, of which the best begins
ROUNDS = 10  # of the fit, each without the pixels that lie off it
OFF = 2.5  # times the spread, from which on a pixel is no ground
MOST = 400_000  # vertices of a mesh
TALL = 0.15  # of the picture's longer side, of the relief's height in a mesh
STEEP = 4  # pixels of a mesh, times their distance, that an edge may be long


def remove_ground(values: np.ndarray, degree: int) -> np.ndarray:
    """Less the polynomial over rows and columns that most pixels lie on. Chapter 12.

    Parameters
    ----------
    values : (H, W) array
        Radians; NaN where there is no phase.
    degree : int
        1 for a plane; 3 for what perspective and lens make of one.

    Raises
    ------
    ValueError
        If fewer than 100 values are known.

    Examples
    --------
    >>> row, column = np.mgrid[:40, :50]
    >>> ground = 0.3 * column - 0.1 * row
    >>> shape = np.where((row > 10) & (row < 20) & (column < 20), 5.0, 0.0)
    >>> bool(np.abs(remove_ground(ground + shape, 1) - shape).max() < 1e-6)
    True
    """
    known = np.isfinite(values)
    if known.sum() < LEAST:
        raise ValueError(f"{known.sum()} pixels with a phase given; a relief needs {LEAST}")
    row, column = (2 * i / max(n - 1, 1) - 1 for i, n in zip(np.indices(values.shape), values.shape,
                                                            strict=True))  # fmt: skip
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    every = max(1, known.sum() // SAMPLE)
    r, c, value = (a[known][::every] for a in (row, column, values))
    terms = np.stack([r**i * c**j for i, j in powers], axis=1)
    off = _off_a_plane(np.stack([np.ones_like(r), r, c], axis=1), value)
    for _ in range(ROUNDS):  # without the pixels that lie off the ground
        use = off <= max(OFF * 1.4826 * np.median(off), 1e-6)
        factors = np.linalg.lstsq(terms[use], value[use], rcond=None)[0]
        off = np.abs(value - terms @ factors)
    ground = sum(f * row**i * column**j for f, (i, j) in zip(factors, powers, strict=True))
    return values - ground


def _off_a_plane(terms, value) -> np.ndarray:
    """How far values lie off the plane, of many through three, with the least median of that."""
    rng = np.random.default_rng(0)
    threes = rng.integers(len(value), size=(TRIALS, 3))
    solvable = np.abs(np.linalg.det(terms[threes])) > 1e-2
    threes = threes[solvable] if solvable.any() else threes
    factors = [np.linalg.lstsq(terms[t], value[t], rcond=None)[0] for t in threes]
    few = slice(None, None, max(1, len(value) // 2000))
    medians = [np.median(np.abs(value[few] - terms[few] @ f)) for f in factors]
    return np.abs(value - terms @ factors[int(np.argmin(medians))])


def phase_difference(measurement: Measurement, reference: Measurement) -> np.ndarray:
    """Phase less that of a reference plane, (H, W) float32, radians; NaN outside either mask.

    Of fringes that were unwrapped in space the difference is, too: from pixel to pixel, from the
    wrapped phases, so it needs no more than a plane that is smooth.
    """
    m, both = measurement, measurement.mask & reference.mask
    if not both.any():
        raise ValueError("the masks of object and reference plane have no pixel in common")
    if not m.unwrapped_in_space:
        return np.where(both, m.Phi - reference.Phi, np.nan).astype(np.float32)
    off = unwrap.wrap(m.wrapped[m.finest] - reference.wrapped[reference.finest])
    return unwrap.spatial(off, both).astype(np.float32)


def largest_part(values: np.ndarray) -> np.ndarray:
    """The largest connected part of a map, (H, W); NaN elsewhere."""
    parts, number = ndimage.label(np.isfinite(values))
    if number < 2:
        return values
    sizes = np.bincount(parts.ravel())
    return np.where(parts == 1 + sizes[1:].argmax(), values, np.nan)


def save_relief(folder: Path, name: str, relief: np.ndarray) -> None:
    """Write a relief, radians, as ``NAME.png`` in colours and as a mesh ``NAME.ply``.

    Columns and rows of the mesh are pixels; its heights are scaled so that it looks like a relief.
    """
    from matplotlib import image

    from fpputil.decoding.pointcloud import save_ply, surface

    low, high = np.nanpercentile(relief, (1, 99))
    shown = np.ma.masked_invalid(relief)
    image.imsave(folder / f"{name}.png", shown, cmap="viridis", vmin=low, vmax=high)
    every = int(np.ceil(np.sqrt(relief.size / MOST)))
    v, u = np.indices(relief.shape)
    height = relief * (TALL * max(relief.shape) / max(high - low, 1e-9))
    points = np.stack([u, -v, height], axis=-1)[::every, ::every]
    save_ply(folder / f"{name}.ply", surface(points, STEEP * every))
