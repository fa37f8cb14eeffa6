"""All frames of a measurement to its absolute phase, in one pass over memory (chapter 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from array_api_compat import is_numpy_array

from fpputil.decoding import phase, unwrap
from fpputil.optics.fringes import Fringe

BLOCK = 2048  # pixels whose sums stay in the first-level cache


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
    """Decode a set of fringes by multi-frequency temporal unwrapping (Eq. 3, 7, 16). Chapter 4.

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
    wrapped = np.stack([phase.wrapped_phase(M, D) for M, D in sums])
    modulation = np.stack(
        [phase.modulation(M, D, f.steps) for (M, D), f in zip(sums, fringes, strict=True)]
    )
    mask = phase.mask(modulation[-1], threshold)
    Phi = np.where(mask, unwrap.mf_tpu(wrapped, pitches, width)[-1], np.nan)
    return Decoded(np.where(mask, wrapped, np.nan), modulation, Phi, mask)


def _by_kernel(frames, fringes, pitches, start, threshold, out) -> Decoded:
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
    _kernel()(flat, steps, weights, ratios, np.float32(start), np.float32(threshold), *outputs)
    return result


def _empty(pitches: int, shape) -> Decoded:
    maps = (np.empty((pitches, *shape), np.float32) for _ in range(2))
    return Decoded(*maps, np.empty(shape, np.float32), np.empty(shape, np.bool_))


def _arrays(result: Decoded) -> tuple[np.ndarray, ...]:
    return result.wrapped, result.modulation, result.Phi, result.mask


@lru_cache(maxsize=1)
def _kernel():
    """Compile the kernel at its first use: importing numba costs a third of a second."""
    import numba
    from numba import float32 as f32

    # atan(x) = x q(x^2) on [0, 1], a Chebyshev interpolant good to 1e-8.
    nodes = (1 + np.cos(np.pi * (np.arange(9) + 0.5) / 9)) / 2
    fit = np.polynomial.Polynomial.fit(
        nodes, np.arctan(np.sqrt(nodes)) / np.sqrt(nodes), 8, domain=[0, 1], window=[0, 1]
    )
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = (np.float32(c) for c in fit.coef)
    pi, half_pi, two_pi = np.float32(np.pi), np.float32(np.pi / 2), np.float32(2 * np.pi)
    tiny, nan, half = np.float32(1e-30), np.float32(np.nan), np.float32(0.5)
    inverse = np.float32(1 / (2 * np.pi))

    @numba.njit(inline="always", error_model="numpy")
    def minus_atan2(M, D):
        a, b = abs(M), abs(D)
        x = min(a, b) / (max(a, b) + tiny)
        s = x * x
        r = c8
        for c in (c7, c6, c5, c4, c3, c2, c1, c0):
            r = r * s + c
        r *= x
        r = half_pi - r if a > b else r
        r = pi - r if D < 0 else r
        return -r if M > 0 else r

    @numba.njit(parallel=True, error_model="numpy", cache=True, fastmath={"contract"})
    def kernel(frames, steps, weights, ratios, start, threshold, wrapped, modulation, Phi, mask):
        pixels = frames.shape[1]
        last = len(steps) - 1
        for block in numba.prange((pixels + BLOCK - 1) // BLOCK):
            low = block * BLOCK
            size = min(BLOCK, pixels - low)
            M, D, ref = np.empty(size, f32), np.empty(size, f32), np.empty(size, f32)
            first = 0
            for p in range(len(steps)):
                M[:] = 0
                D[:] = 0
                end = first + steps[p]
                thirds = first + steps[p] // 3 * 3
                for n in range(first, thirds, 3):  # three frames a sweep: fewer trips to M and D
                    s0, s1, s2 = weights[0, n], weights[0, n + 1], weights[0, n + 2]
                    c0, c1, c2 = weights[1, n], weights[1, n + 1], weights[1, n + 2]
                    f0 = frames[n, low : low + size]
                    f1 = frames[n + 1, low : low + size]
                    f2 = frames[n + 2, low : low + size]
                    for i in range(size):
                        a, b, c = f32(f0[i]), f32(f1[i]), f32(f2[i])
                        M[i] += s0 * a + s1 * b + s2 * c
                        D[i] += c0 * a + c1 * b + c2 * c
                for n in range(thirds, end):
                    s0, c0 = weights[0, n], weights[1, n]
                    f0 = frames[n, low : low + size]
                    for i in range(size):
                        a = f32(f0[i])
                        M[i] += s0 * a
                        D[i] += c0 * a
                first = end
                phi, amplitude = wrapped[p, low : low + size], modulation[p, low : low + size]
                for i in range(size):
                    phi[i] = minus_atan2(M[i], D[i])
                    amplitude[i] = np.sqrt(M[i] * M[i] + D[i] * D[i])
                if p == 0:
                    for i in range(size):
                        ref[i] = phi[i] - two_pi * np.floor((phi[i] - start) * inverse)
                else:
                    ratio = ratios[p]
                    for i in range(size):
                        K = np.floor((ratio * ref[i] - phi[i]) * inverse + half)
                        ref[i] = phi[i] + two_pi * K
            amplitude = modulation[last, low : low + size]
            for i in range(size):
                seen = amplitude[i] > threshold
                mask[low + i] = seen
                Phi[low + i] = ref[i] if seen else nan
            for p in range(len(steps)):
                phi = wrapped[p, low : low + size]
                for i in range(size):
                    phi[i] = phi[i] if mask[low + i] else nan

    return kernel
