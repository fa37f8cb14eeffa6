"""Photographs one by one into the sums of a fringe: memory does not grow with their number.

Of each fringe four sums and a count are kept a pixel, and from them follow phase, modulation,
average, the scatter about the sinusoid, and whether the camera was saturated (chapter 12).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fpputil.decoding import phase
from fpputil.optics.fringes import WHITE, Fringe

BLOCK = 2048  # pixels whose sums stay in the first-level cache
MIDDLE = np.float32(WHITE / 2)  # sums of squares are taken about it, so that they stay small


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over the steps of a fringe.

    Parameters
    ----------
    fringe : Fringe
    values : (4, H, W) float32 array
        M, D (Eq. 3), and the sums of grey levels and of their squares, both about 127.5.
    clipped : (H, W) float32 array
        Photographs in which the camera was saturated.
    """

    fringe: Fringe
    values: np.ndarray
    clipped: np.ndarray

    @classmethod
    def empty(cls, fringe: Fringe, size: tuple[int, int]) -> Sums:
        """Of no photograph yet."""
        return cls(fringe, np.zeros((4, *size), np.float32), np.zeros(size, np.float32))

    def add(self, frames: np.ndarray, steps, scale: float = 1.0, top: float = WHITE) -> None:
        """Add photographs.

        Parameters
        ----------
        frames : (n, H, W) array
            uint8, uint16 or float32.
        steps : sequence of n int
            Which steps they are.
        scale : float
            Factor that makes grey levels of 0 to 255.
        top : float
            Value of `frames` from which on the camera is saturated.
        """
        delta = self.fringe.shifts[list(steps)]
        weights = (np.stack([np.sin(delta), np.cos(delta)])).astype(np.float32)
        _kernel()(
            frames.reshape(len(frames), -1), weights, np.float32(scale), np.float32(top),
            self.values.reshape(4, -1), self.clipped.reshape(-1),
        )  # fmt: skip

    @property
    def wrapped(self) -> np.ndarray:
        """phi, (H, W), radians (Eq. 3)."""
        return phase.wrapped_phase(*self.values[:2])

    @property
    def modulation(self) -> np.ndarray:
        """I'', (H, W), grey levels (Eq. 16)."""
        return phase.modulation(*self.values[:2], self.fringe.steps)

    @property
    def average(self) -> np.ndarray:
        """I', (H, W), grey levels (Eq. 2)."""
        return MIDDLE + self.values[2] / np.float32(self.fringe.steps)

    @property
    def scatter(self) -> np.ndarray:
        """Variance about the fitted sinusoid, (H, W), grey levels squared; NaN for three steps.

        The sum of squares less what average and modulation account for, over N - 3.
        """
        steps = self.fringe.steps
        if steps == 3:
            return np.full(self.clipped.shape, np.nan, np.float32)
        M, D, S, Q = self.values
        rest = Q - S * S / np.float32(steps) - (M * M + D * D) * np.float32(2 / steps)
        return np.maximum(rest, 0) / np.float32(steps - 3)


@lru_cache(maxsize=1)
def _kernel():
    """Compile the kernel at its first use: importing numba costs a third of a second."""
    import numba
    from numba import float32 as f32

    @numba.njit(parallel=True, error_model="numpy", cache=True, fastmath={"contract"})
    def kernel(frames, weights, scale, top, values, clipped):
        pixels = frames.shape[1]
        for block in numba.prange((pixels + BLOCK - 1) // BLOCK):
            low = block * BLOCK
            high = min(low + BLOCK, pixels)
            M, D = values[0, low:high], values[1, low:high]
            S, Q = values[2, low:high], values[3, low:high]
            over = clipped[low:high]
            fours = len(frames) // 4 * 4
            for n in range(0, fours, 4):  # four frames a sweep: fewer trips to the sums
                s0, s1, s2, s3 = (
                    weights[0, n],
                    weights[0, n + 1],
                    weights[0, n + 2],
                    weights[0, n + 3],
                )
                c0, c1, c2, c3 = (
                    weights[1, n],
                    weights[1, n + 1],
                    weights[1, n + 2],
                    weights[1, n + 3],
                )
                f0, f1 = frames[n, low:high], frames[n + 1, low:high]
                f2, f3 = frames[n + 2, low:high], frames[n + 3, low:high]
                for i in range(high - low):
                    a, b, c, d = f32(f0[i]), f32(f1[i]), f32(f2[i]), f32(f3[i])
                    over[i] += f32(a >= top) + f32(b >= top) + f32(c >= top) + f32(d >= top)
                    a, b = a * scale - MIDDLE, b * scale - MIDDLE
                    c, d = c * scale - MIDDLE, d * scale - MIDDLE
                    M[i] += s0 * a + s1 * b + s2 * c + s3 * d
                    D[i] += c0 * a + c1 * b + c2 * c + c3 * d
                    S[i] += (a + b) + (c + d)
                    Q[i] += (a * a + b * b) + (c * c + d * d)
            for n in range(fours, len(frames)):
                frame = frames[n, low:high]
                s, t = weights[0, n], weights[1, n]
                for i in range(high - low):
                    a = f32(frame[i])
                    over[i] += f32(a >= top)
                    a = a * scale - MIDDLE
                    M[i] += s * a
                    D[i] += t * a
                    S[i] += a
                    Q[i] += a * a

    return kernel
