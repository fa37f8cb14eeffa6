"""What a pixel of a scan is worth: noise, and reasons not to trust a pixel (chapter 12)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import chdtr, chdtri

from fpputil.capture.marking import Reason, compared, look, mark_unsteady
from fpputil.capture.stream import Sums
from fpputil.decoding.unwrap import TWO_PI, Level, guard_columns
from fpputil.optics.fringes import WHITE

QUANTISATION = 1 / 12
"""Variance of rounding, grey levels squared: the least noise a scan is credited with."""

AROUND = 31  # pixels, of the square over which modulations are compared
UNSURE = 0.4  # of `order_step` between the columns of two pitches; at a half the order is a guess
CERTAIN = 2.5  # standard deviations of the noise that must lie within half an order step
LEAST_PIXELS = 100  # for an estimate of the noise
CLASSES, EACH = 8, 60  # of grey levels at most, and about how many pixels in one at least
FEW = 4  # rows and columns, of which one is counted where a mean is enough
OUTLIERS = 0.2  # share of pixels that are left out, those that scatter most
LEFT = chdtr(3, chdtri(1, OUTLIERS)) / (1 - OUTLIERS)  # of the variance, by those that are kept
IN_STEP = 0.25  # most of the second harmonic of a response that a pixel may see


@dataclass(frozen=True)
class Noise:
    """Variance of a photograph's grey level: ``constant + slope * level``.

    Parameters
    ----------
    constant : float
        Grey levels of 255, squared.
    slope : float
        Grey levels of 255.
    known : bool
        False if it could not be estimated, and the rounding of grey levels stands in for it.
    """

    constant: float
    slope: float
    known: bool

    def variance(self, level):
        """At a grey level, (...), never below that of rounding."""
        return np.maximum(self.constant + self.slope * level, QUANTISATION)


def noise_of(sample: Sequence[np.ndarray], threshold: float) -> Noise:
    """Noise of photographs of phase-shifted fringes. Chapter 12.

    In each class of grey level the pixels that scatter most, at edges or by motion, do not count.

    Parameters
    ----------
    sample : sequence of (N, S) arrays
        All steps of each fringe at S pixels, grey levels of 255.
    threshold : float
        Least modulation of pixels that count, grey levels.
    """
    levels, variances = [], []
    for frames in sample:
        scatter, use = _scatter(frames, threshold)
        if use.sum() < LEAST_PIXELS:
            continue
        level, scatter = frames[:, use].mean(axis=0), scatter[use]
        for some in np.array_split(np.argsort(level), min(CLASSES, 1 + len(level) // EACH)):
            kept = np.sort(scatter[some])[: round((1 - OUTLIERS) * len(some))]
            levels.append(np.mean(level[some]))
            variances.append(kept.mean() / LEFT)
    return _line(levels, variances)


def _scatter(frames, threshold) -> tuple[np.ndarray, np.ndarray]:
    """Squared noise of photographs (N, S) at each pixel, of one degree of freedom, and its use.

    Over the steps the fringe is the first harmonic. A response that is not linear adds others, in
    step with it; what is out of step in the highest of them is noise. Four steps have a second
    harmonic alone, without its sine: there the pixels count where a response could not add to it.
    """
    steps = len(frames)
    spectrum = np.fft.rfft(frames, axis=0)
    turn = spectrum[1] / np.maximum(np.abs(spectrum[1]), 1e-9)
    use = (2 / steps * np.abs(spectrum[1]) > threshold) & (frames.max(axis=0) < 0.99 * WHITE)
    highest = (steps - 1) // 2
    if highest > 1:
        return 2 / steps * (spectrum[highest] * turn.conj() ** highest).imag ** 2, use
    if steps == 4:
        return spectrum[2].real ** 2 / 4, use & (np.abs((turn**2).real) < IN_STEP)
    return np.zeros(frames.shape[1]), np.zeros(frames.shape[1], bool)


def _line(levels, variances) -> Noise:
    """Variance as a line over the level, or a constant where it cannot be told or falls."""
    if not levels:
        return Noise(QUANTISATION, 0.0, False)
    levels, variances = np.array(levels), np.array(variances)
    slope, constant = np.polyfit(levels, variances, 1) if np.ptp(levels) > 20 else (-1, 0)
    if slope < 0:
        slope, constant = 0.0, np.mean(variances)
    elif constant < 0:
        slope, constant = (levels @ variances) / (levels @ levels), 0.0
    return Noise(float(constant), float(slope), True)


@dataclass(frozen=True, eq=False)
class Judged:
    """What speaks for and against the pixels of a scan.

    Parameters
    ----------
    reason : (H, W) uint8 array
        `Reason` of each pixel.
    sigmas : list of P (H, W) arrays
        Standard deviation of each wrapped phase by noise and modulation, radians.
    offsets, sharpness : (P - 1,) arrays
        Circular mean of how far the columns of neighbouring pitches part, as a share of
        `order_step`, and its length, 0 to 1.
    """

    reason: np.ndarray
    sigmas: list[np.ndarray]
    offsets: np.ndarray
    sharpness: np.ndarray


def judge(
    sums: Sequence[Sums],
    modulation: np.ndarray,
    levels: Sequence[Level],
    noise: Noise,
    threshold: float,
    method: str,
    width: int,
) -> Judged:
    """Find a reason not to trust a pixel. Chapter 12.

    Parameters
    ----------
    sums : sequence of P Sums
    modulation : (P, H, W) array
        Grey levels.
    levels : sequence of Level
        Absolute phases, and those of their beats, radians.
    noise : Noise
    threshold : float
        Least modulation of each pitch, grey levels.
    method : str
        Of unwrapping, as in `Patterns`.
    width : int
        Projector pixels along the axis.
    """
    reason, sigmas = np.zeros(modulation.shape[1:], np.uint8), np.empty_like(modulation)
    line = np.array([noise.constant, noise.slope, QUANTISATION], np.float32)
    for k, one in enumerate(sums):
        look(one.values, one.clipped, one.fringe.steps, line, threshold, reason, sigmas[k])
    for k in range(len(sums) - 1):
        _mark_unsteady(modulation[k : k + 2], sigmas[k : k + 2], reason)
    means = []
    for apart, sigma in _apart(levels, sigmas, method):
        good = reason[::FEW, ::FEW] == 0
        some = np.exp(2j * np.pi * apart[::FEW, ::FEW][good])
        means.append(some.mean() if some.size else 0)
        unsure = ~((np.abs(apart) < UNSURE) & (np.float32(CERTAIN) * sigma < 0.5))
        reason[unsure & (reason == 0)] = Reason.UNSURE
    means = np.array(means[: len(sums) - 1], complex)
    finest = int(np.argmin(levels[0].pitches))
    column = levels[0].Phis[finest] * np.float32(levels[0].pitches[finest] / TWO_PI)
    some = sigmas[0, ::FEW, ::FEW][reason[::FEW, ::FEW] == 0]
    guard = _guard(levels[0].pitches[0], some, method, width)
    inside = np.abs(column - np.float32((width - 1) / 2)) <= np.float32(width / 2 - guard)
    reason[~inside & (reason == 0)] = Reason.OUTSIDE
    return Judged(reason, sigmas, np.angle(means) / TWO_PI, np.abs(means))


def _apart(levels, sigmas, method) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """How far the columns of each two neighbours part, and its noise, in `order_step`s."""
    for level in levels:
        if level.parents:  # the difference of two phases has the noise of both
            sigmas = [np.hypot(sigmas[j], sigmas[j + 1]) for j in level.parents]
        for k, (p, q) in enumerate(zip(level.pitches, level.pitches[1:], strict=False)):
            step = TWO_PI * order_step(method, p, q)
            one, other = np.float32(p / step), np.float32(q / step)
            apart = level.Phis[k] * one - level.Phis[k + 1] * other
            yield apart, np.sqrt((sigmas[k] * one) ** 2 + (sigmas[k + 1] * other) ** 2)


def order_step(method: str, p: float, q: float) -> float:
    """How far the columns of two pitches part, projector pixels, if an order is wrong by one.

    Between neighbours of a hierarchy that is the shorter pitch. By beats both orders are wrong
    together, so the columns part by the difference of the pitches; in the number-theoretical
    method by their greatest common divisor.
    """
    if method == "nt":
        return math.gcd(int(p), int(q))
    return abs(p - q) if method == "mw" else min(p, q)


def _mark_unsteady(B, sigmas, reason) -> None:
    """Mark where the modulation changes between two pitches otherwise than round about."""
    box = (AROUND, AROUND)
    change, good = compared(B[0], B[1], reason)
    change_near, good_near = cv2.boxFilter(change, -1, box), cv2.boxFilter(good, -1, box)
    mark_unsteady(change, change_near, good_near, sigmas[0], sigmas[1], reason)


def _guard(pitch: float, sigma, method: str, width: int) -> float:
    """Columns at either border that noise may throw to the other (chapter 4)."""
    if method != "mf" or pitch > 1.05 * width or not sigma.size:
        return 0.0
    return min(guard_columns(float(np.median(sigma)), width), width / 4)
