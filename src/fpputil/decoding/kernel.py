"""The decoder's compiled kernel (chapter 4).

Import it where it is first used: numba takes a third of a second. A compiled function is kept on
disk for the next process only if it stands at the top of its module and refers to nothing but
globals: numba names what it keeps by the values that a function closes over.
"""

from __future__ import annotations

from functools import partial

import numba
import numpy as np
from numba import float32 as f32

BLOCK = 2048  # pixels whose sums stay in the first-level cache
PI, HALF_PI, TWO_PI = np.float32(np.pi), np.float32(np.pi / 2), np.float32(2 * np.pi)
INVERSE = np.float32(1 / (2 * np.pi))
TINY, NAN, HALF = np.float32(1e-30), np.float32(np.nan), np.float32(0.5)


def _arctan():
    """Coefficients q of atan(x) = x q(x^2) on [0, 1], a Chebyshev interpolant good to 1e-8."""
    nodes = (1 + np.cos(np.pi * (np.arange(9) + 0.5) / 9)) / 2
    values = np.arctan(np.sqrt(nodes)) / np.sqrt(nodes)
    q = np.polynomial.Polynomial.fit(nodes, values, 8, domain=[0, 1], window=[0, 1]).coef
    return tuple(np.float32(c) for c in q[::-1])


Q = _arctan()  # the highest power first


def compiled(function, **options):
    """`numba.njit` of a module's function, kept on disk where a folder for that can be written."""
    try:
        return numba.njit(function, cache=True, **options)
    except RuntimeError:  # neither the package's folder nor the user's
        return numba.njit(function, **options)


@numba.njit(inline="always", error_model="numpy")
def minus_atan2(M, D):
    """-atan2(M, D), radians, float32."""
    a, b = abs(M), abs(D)
    x = min(a, b) / (max(a, b) + TINY)
    s = x * x
    r = Q[0]
    for q in Q[1:]:
        r = r * s + q
    r *= x
    r = HALF_PI - r if a > b else r
    r = PI - r if D < 0 else r
    return -r if M > 0 else r


@partial(compiled, parallel=True, error_model="numpy", fastmath={"contract"})
def sweep(frames, steps, weights, ratios, start, threshold, wrapped, modulation, Phi, mask):
    """Fill the last four arrays, of S pixels in a row, from frames (N, S): as `decode` says.

    Parameters
    ----------
    frames : (N, S) uint8, uint16 or float32 array
    steps : (P,) int array
        Frames of each pitch.
    weights : (2, N) float32 array
        What each frame counts in M and in D, so that their length is the modulation.
    ratios : (P,) float32 array
        Each pitch's predecessor over itself; the first does not count.
    start : float32
        Phase at which the period of the first pitch begins, radians.
    threshold : float32
        Least modulation, grey levels, of the last pitch.
    """
    pixels = frames.shape[1]
    last = len(steps) - 1
    for block in numba.prange((pixels + BLOCK - 1) // BLOCK):
        low = block * BLOCK
        size = min(BLOCK, pixels - low)
        M, D, ref = np.empty(size, f32), np.empty(size, f32), np.empty(size, f32)
        first = 0
        for p in range(len(steps)):  # sums, wrapped phase, absolute phase of each pitch
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
                    ref[i] = phi[i] - TWO_PI * np.floor((phi[i] - start) * INVERSE)
            else:
                ratio = ratios[p]
                for i in range(size):
                    K = np.floor((ratio * ref[i] - phi[i]) * INVERSE + HALF)
                    ref[i] = phi[i] + TWO_PI * K
        amplitude = modulation[last, low : low + size]
        for i in range(size):
            bright = amplitude[i] > threshold
            mask[low + i] = bright
            Phi[low + i] = ref[i] if bright else NAN
        for p in range(len(steps)):
            phi = wrapped[p, low : low + size]
            for i in range(size):
                phi[i] = phi[i] if mask[low + i] else NAN
