"""All frames of a measurement to its absolute phase, in one pass over memory (chapter 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from array_api_compat import is_numpy_array

from fpputil.decoding import phase, unwrap
from fpputil.optics.fringes import Fringe


@dataclass(frozen=True, eq=False)
class Decoded:
    """Phases of a measurement. Chapter 4.

    Parameters
    ----------
    wrapped : (P, H, W) float array
        Wrapped phase of each pitch, radians; NaN outside the mask.
    modulation : (P, H, W) float array
        Grey levels, everywhere.
    Phi : (H, W) float array
        Absolute phase of the last pitch, radians; NaN outside the mask.
    mask : (H, W) bool array
        Modulation of the last pitch above the threshold.
    """

    wrapped: np.ndarray
    modulation: np.ndarray
    Phi: np.ndarray
    mask: np.ndarray


def decode(
    frames: np.ndarray,
    fringes: Sequence[Fringe],
    width: float,
    threshold: float = phase.THRESHOLD,
    sigma_phi: float = 0.0,
    out: Decoded | None = None,
) -> Decoded:
    """Decode fringes by multi-frequency temporal unwrapping (paper, Eq. 3, 7, 16). Chapter 4.

    float64 frames are decoded in float64 by the equations themselves; all others in float32
    by a compiled kernel that reads each frame once.

    Parameters
    ----------
    frames : (N, H, W) array or sequence of N (H, W) arrays
        The frames of the fringes, one after the other; integers or floats. A sequence is
        copied into one array first.
    fringes : Fringe or sequence of P Fringe
        Pitches descending, the first covering the projector; all along one axis.
    width : float
        Projector columns (rows for horizontal fringes).
    threshold : float
        Least modulation, grey levels, of the last pitch.
    sigma_phi : float
        Phase noise of the first pitch, radians. Columns that it may throw across the border
        of the projector (`guard_columns`) leave the mask; 0 keeps all.
    out : Decoded, optional
        An earlier float32 result of the same shape, whose arrays are filled anew and returned:
        in a stream of measurements this spares their allocation.

    Returns
    -------
    Decoded

    Examples
    --------
    >>> from fpputil.optics.fringes import fringe_set
    >>> fringes = fringe_set((912, 114, 15), 4)
    >>> column = np.array([[10.0, 400.0, 900.0]])
    >>> frames = np.stack([f.intensity(column, n) for f in fringes for n in range(4)])
    >>> decoded = decode(frames, fringes, 912)
    >>> (decoded.Phi * 15 / (2 * np.pi)).round(6), decoded.wrapped.shape
    (array([[ 10., 400., 900.]]), (3, 1, 3))

    Raises
    ------
    ValueError
        On a wrong number of frames, mixed sizes or dtypes, NaN, pitches that do not descend or
        do not cover the projector, if no pixel is left in the mask, or if `out` has another
        shape or dtype.
    """
    fringes = (fringes,) if isinstance(fringes, Fringe) else tuple(fringes)
    pitches = [f.pitch for f in fringes]
    unwrap.check_pitches(fringes, pitches)
    start = unwrap.unit_start(pitches[0], width)
    frames = phase.check_frames(frames, sum(f.steps for f in fringes))
    if len({f.axis for f in fringes}) > 1:
        raise ValueError(
            f"fringes along {[f.axis for f in fringes]} given; one decoding takes one axis"
        )
    if not is_numpy_array(frames):
        raise ValueError("torch tensors given; decode takes NumPy, the equations take either")
    if frames.ndim != 3:
        raise ValueError(f"frames of shape {frames.shape} given; a decoder takes (N, H, W)")
    if frames.dtype.kind == "f" and frames.dtype.itemsize >= 8:
        frames = frames.astype(np.float64, copy=False)
        if out is not None:
            raise ValueError("out with float64 frames given; the float32 kernel alone refills")
        result = _by_equations(frames, fringes, pitches, width, threshold)
    else:
        result = _by_kernel(frames, fringes, pitches, start, threshold, out)
    if sigma_phi:
        _guard(result, pitches[-1], width, unwrap.guard_columns(sigma_phi, width))
    if not result.mask.any():
        raise ValueError(
            f"no pixel with modulation above {threshold} grey levels (largest "
            f"{result.modulation[-1].max():.3g}) away from the projector's borders; "
            "check exposure, focus and the threshold"
        )
    return result


def _guard(result: Decoded, pitch, width, guard) -> None:
    """Take the columns within `guard` of either border out of the result."""
    with np.errstate(invalid="ignore"):
        near = np.abs(result.Phi * (pitch / (2 * np.pi)) - (width - 1) / 2) > width / 2 - guard
    result.mask[near] = False
    result.Phi[near] = np.nan
    result.wrapped[:, near] = np.nan


def _by_equations(frames, fringes, pitches, width, threshold) -> Decoded:
    ends = np.cumsum([f.steps for f in fringes])[:-1]
    sums = [phase.numerator_denominator(f) for f in np.split(frames, ends)]
    wrapped = np.stack(
        [
            unwrap.wrap(phase.wrapped_phase(M, D) - f.start)
            for (M, D), f in zip(sums, fringes, strict=True)
        ]
    )
    modulation = np.stack(
        [phase.modulation(M, D, f.steps) for (M, D), f in zip(sums, fringes, strict=True)]
    )
    mask = phase.mask(modulation[-1], threshold)
    Phi = np.where(mask, unwrap.mf_tpu(wrapped, pitches, width)[-1], np.nan)
    return Decoded(np.where(mask, wrapped, np.nan), modulation, Phi, mask)


def _by_kernel(frames, fringes, pitches, start, threshold, out) -> Decoded:
    from fpputil.decoding.kernel import sweep  # numba takes a third of a second

    shape = frames.shape[1:]
    if frames.dtype not in (np.uint8, np.uint16, np.float32):
        frames = frames.astype(np.float32)
    flat = np.ascontiguousarray(frames).reshape(len(frames), -1)
    steps = np.array([f.steps for f in fringes])
    weights = np.concatenate(
        [np.stack([np.sin(f.shifts), np.cos(f.shifts)]) * 2 / f.steps for f in fringes], axis=1
    ).astype(np.float32)
    ratios = np.array([0, *np.divide(pitches[:-1], pitches[1:])], np.float32)
    kinds = [(a.shape, a.dtype) for a in _arrays(_empty(len(steps), shape))]
    result = _empty(len(steps), shape) if out is None else out
    if [(a.shape, a.dtype) for a in _arrays(result)] != kinds:
        raise ValueError(
            f"out of shape {result.wrapped.shape} and dtype {result.wrapped.dtype} given; "
            f"{kinds[0][0]} and float32 are needed"
        )
    outputs = [a.reshape(*a.shape[:-2], -1) for a in _arrays(result)]
    sweep(flat, steps, weights, ratios, np.float32(start), np.float32(threshold), *outputs)
    return result


def _empty(pitches: int, shape) -> Decoded:
    maps = (np.empty((pitches, *shape), np.float32) for _ in range(2))
    return Decoded(*maps, np.empty(shape, np.float32), np.empty(shape, np.bool_))


def _arrays(result: Decoded) -> tuple[np.ndarray, ...]:
    return result.wrapped, result.modulation, result.Phi, result.mask
