"""A capture to absolute phases, with what each pixel is worth: mask, reason, uncertainty (ch. 12).

The photographs are read once, some at a time, and go into sums; a few thousand pixels are kept
whole, for what can only be seen in the photographs themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fpputil.capture.gamma import LEAST_STEPS, estimate_gamma, linearise
from fpputil.capture.marking import Reason
from fpputil.capture.photographs import Capture
from fpputil.capture.quality import Noise, judge, noise_of
from fpputil.capture.stream import Sums
from fpputil.capture.unwrapper import unwrapper
from fpputil.decoding import unwrap
from fpputil.decoding.phase import THRESHOLD
from fpputil.optics.fringes import WHITE, Fringe
from fpputil.optics.system import System

SAMPLE = 64
"""Rows and columns of the grid of pixels that are kept whole."""

LINEAR = 0.04
"""A power as near to 1 as this leaves a second harmonic of one hundredth: not worth a change."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """What the fringes along one axis tell.

    Parameters
    ----------
    axis : {"column", "row"}
    fringes : tuple of P Fringe
        In the order of the patterns.
    finest : int
        Which has the shortest pitch.
    wrapped, modulation : (P, H, W) float32 arrays
        Radians, and grey levels of 255, at every pixel.
    average : (H, W) float32 array
        Mean of all photographs of the finest pitch, grey levels of 255.
    Phi : (H, W) float32 array
        Absolute phase of the finest pitch, radians; NaN outside the mask.
    sigma : (H, W) float32 array
        Its standard deviation by noise and modulation, radians; NaN outside the mask.
    reason : (H, W) uint8 array
        `Reason` of each pixel.
    offsets, sharpness : (P - 1,) arrays
        Of each two neighbouring pitches the circular mean of how far their columns part, as a
        share of `fpputil.capture.quality.order_step`, 0 where they agree; and its length, 1 if
        all pixels tell the same, near 0 if they tell nothing.
    noise : Noise
    power : float
        To which the grey levels were raised.
    sample : list of (steps, S) arrays
        Of each fringe the grey levels of a grid of pixels, of 255, as photographed.
    """

    axis: str
    fringes: tuple[Fringe, ...]
    finest: int
    wrapped: np.ndarray
    modulation: np.ndarray
    average: np.ndarray
    Phi: np.ndarray
    sigma: np.ndarray
    reason: np.ndarray
    offsets: np.ndarray
    sharpness: np.ndarray
    noise: Noise
    power: float
    sample: list[np.ndarray]

    @property
    def mask(self) -> np.ndarray:
        """(H, W) bool array: True where there is nothing against a pixel."""
        return self.reason == Reason.GOOD

    @property
    def coordinate(self) -> np.ndarray:
        """Projector column (or row), (H, W), pixels; NaN outside the mask."""
        return self.Phi * np.float32(self.fringes[self.finest].pitch / unwrap.TWO_PI)


def measure(
    capture: Capture,
    axis: str = "column",
    *,
    threshold: float = THRESHOLD,
    power: float | None = None,
    noise: float | None = None,
    system: System | None = None,
    each: Callable[[int], None] | None = None,
) -> Measurement:
    """Decode the fringes along an axis. Chapter 12.

    Parameters
    ----------
    capture : Capture
    axis : {"column", "row"}
    threshold : float
        Least modulation of every pitch, grey levels of 255.
    power : float or None
        The grey levels are raised to it (`fpputil.capture.gamma`). None estimates it from the
        fringe of most steps, if that has five or more and another one fewer: from five steps on
        the harmonics of a response fall out, and the power would only raise the noise of the dark.
    noise : float, optional
        Standard deviation of the camera's noise, grey levels of 255; by default estimated.
    system : System, optional
        Needed by patterns that are unwrapped by the minimum phase.
    each : callable, optional
        Called with the number of photographs after each batch that was read.

    Returns
    -------
    Scan

    Raises
    ------
    ValueError
        If there is no fringe along the axis, a photograph cannot be read or differs in size,
        or the pitches do not suit the unwrapping.
    """
    patterns = capture.patterns
    numbers = [k for k, f in enumerate(patterns.fringes) if f.axis == axis]
    if not numbers:
        raise ValueError(f"axis {axis!r} given; the patterns have {', '.join(patterns.axes)}")
    fringes = tuple(patterns.fringes[k] for k in numbers)
    unwrapped = unwrapper(patterns, axis, fringes, system, capture.size)
    sums, sample, power = _read(capture, numbers, power, each)
    return _judged(sums, sample, unwrapped, patterns, axis, threshold, power, noise)


def _grid(size) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the pixels that are kept whole."""
    v, u = (np.unique(np.linspace(0, n - 1, min(n, SAMPLE)).astype(int)) for n in size)
    return tuple(a.ravel() for a in np.meshgrid(v, u, indexing="ij"))


def _read(capture: Capture, numbers, power, each):
    """Sums of each fringe, its photographs at the pixels of the grid, and the power.

    The fringe that tells the power is read first, and again only if the power is not 1.
    """
    fringes = capture.patterns.fringes
    best = max(numbers, key=lambda k: (fringes[k].steps, -fringes[k].pitch))
    read = {best: _fringe(capture, best, 1.0 if power is None else power, each)}
    few = min(fringes[k].steps for k in numbers) < LEAST_STEPS
    if power is None:
        power = _power(read[best][1]) if few else 1.0
        if power != 1:
            read[best] = _fringe(capture, best, power)
    for k in numbers:
        if k != best:
            read[k] = _fringe(capture, k, power, each)
    sums, sample = zip(*(read[k] for k in numbers), strict=True)
    return list(sums), list(sample), power


def _fringe(capture: Capture, k: int, power: float, each=None) -> tuple[Sums, np.ndarray]:
    fringe, v_u = capture.patterns.fringes[k], _grid(capture.size)
    total, kept = Sums.empty(fringe, capture.size), []
    for shots, frames in capture.batches(capture.of(k)):
        kept.append(frames[:, *v_u] * np.float32(capture.scale))
        steps = [s.step * capture.patterns.shift % fringe.steps for s in shots]
        if power == 1:
            total.add(frames, steps, capture.scale, capture.full)
        else:
            total.add(linearise(frames, power, capture.full), steps)
        if each is not None:
            each(len(shots))
    return total, np.concatenate(kept)


def _power(frames: np.ndarray) -> float:
    """The power that makes photographs linear; 1 if they nearly are, or do not tell."""
    if len(frames) < LEAST_STEPS:
        return 1.0
    try:
        power = estimate_gamma(frames[:, _lit(frames)])
    except ValueError:  # which a doubt about the response then tells
        return 1.0
    return 1.0 if abs(np.log(power)) < LINEAR else power


def _lit(frames) -> np.ndarray:
    """Which pixels (N, S) -> (S,) see fringes well and are not saturated."""
    turn = np.exp(-2j * np.pi * np.arange(len(frames)) / len(frames))
    modulation = 2 / len(frames) * np.abs(turn @ frames)
    return (modulation > 2 * THRESHOLD) & (frames.max(axis=0) < 0.99 * WHITE)


def _judged(sums, sample, unwrapped, patterns, axis, threshold, power, noise) -> Measurement:
    fringes = tuple(s.fringe for s in sums)
    finest = int(np.argmin([f.pitch for f in fringes]))
    wrapped = np.stack([s.wrapped for s in sums])
    modulation = np.stack([s.modulation for s in sums])
    straight = [linearise(f, power) for f in sample]
    found = noise_of(straight, threshold) if noise is None else Noise(noise**2, 0.0, True)
    levels = unwrapped(wrapped)
    judged = judge(
        sums, modulation, levels, found, threshold, patterns.unwrap, patterns.width(axis)
    )
    good = judged.reason == Reason.GOOD
    Phi, sigma = (
        np.where(good, a[finest], np.nan).astype(np.float32)
        for a in (levels[0].Phis, judged.sigmas)
    )
    return Measurement(
        axis, fringes, finest, wrapped, modulation, sums[finest].average, Phi, sigma,
        judged.reason, judged.offsets, judged.sharpness, found, power, sample,
    )  # fmt: skip
