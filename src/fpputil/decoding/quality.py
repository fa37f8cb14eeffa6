"""What a pixel of a scan is worth: noise, and reasons not to trust a pixel (chapter 12)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
from scipy.special import chdtr, chdtri

from fpputil.decoding.noise import phase_sigma
from fpputil.decoding.stream import Sums
from fpputil.decoding.unwrap import TWO_PI, Level, guard_columns
from fpputil.optics.fringes import WHITE

QUANTISATION = 1 / 12
"""Variance of rounding, grey levels squared: the least noise a scan is credited with."""

CLIPPED = 0.1  # of the photographs of a fringe; one clipped of twelve hardly turns the phase
SCATTER = 0.25  # of the modulation, beyond three times the noise
UNSTEADY = 0.2  # relative change of the modulation between pitches, beyond four times its noise
AROUND = 31  # pixels, of the square over which modulations are compared
UNSURE = 0.4  # of `order_step` between the columns of two pitches; at a half the order is a guess
CERTAIN = 2.5  # standard deviations of the noise that must lie within half an order step
LEAST_PIXELS = 100  # for an estimate of the noise
CLASSES = 8  # of grey levels
OUTLIERS = 0.2  # share of pixels that are left out, those that scatter most


class Reason(IntEnum):
    """Why a pixel is not in the mask; the first that holds."""

    GOOD = 0
    DARK = 1
    SATURATED = 2
    SCATTERED = 3
    UNSTEADY = 4
    UNSURE = 5
    OUTSIDE = 6


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

    Over the steps the fringe is the first harmonic, and a response that is not linear adds the
    next ones, ever less; what is in the highest is noise. In each class of grey level the pixels
    that scatter most, at edges or by motion, do not count.

    Parameters
    ----------
    sample : sequence of (N, S) arrays
        All steps of each fringe at S pixels, grey levels of 255.
    threshold : float
        Least modulation of pixels that count, grey levels.
    """
    levels, variances = [], []
    for frames in sample:
        steps = len(frames)
        power = np.abs(np.fft.rfft(frames, axis=0)) ** 2 / steps
        use = (2 * np.sqrt(power[1] / steps) > threshold) & (frames.max(axis=0) < 0.99 * WHITE)
        if steps < 4 or use.sum() < LEAST_PIXELS:
            continue
        scatter = power[-1, use]
        free = 2 - (steps % 2 == 0)  # the last of an even number of steps has no sine
        share = chdtr(free + 2, chdtri(free, OUTLIERS)) / (1 - OUTLIERS)  # what they leave of it
        level = frames[:, use].mean(axis=0)
        for some in np.array_split(np.argsort(level), CLASSES):
            levels.append(np.mean(level[some]))
            kept = np.sort(scatter[some])[: round((1 - OUTLIERS) * len(some))]
            variances.append(kept.mean() / share)
    return _line(levels, variances)


def _line(levels, variances) -> Noise:
    """Variance as a line over the level; a constant where a line cannot be told or falls."""
    if not levels:
        return Noise(QUANTISATION, 0.0, False)
    slope, constant = np.polyfit(levels, variances, 1) if np.ptp(levels) > 20 else (-1, -1)
    if slope < 0 or constant < 0:
        return Noise(float(np.mean(variances)), 0.0, True)
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
    reason = np.zeros(modulation.shape[1:], np.uint8)

    def mark(where, why):
        reason[where & (reason == 0)] = why

    sigmas = [_sigma(s, B, noise) for s, B in zip(sums, modulation, strict=True)]
    mark(~(modulation.min(axis=0) > threshold), Reason.DARK)
    for one, B in zip(sums, modulation, strict=True):
        mark(one.clipped > CLIPPED * one.fringe.steps, Reason.SATURATED)
        limit = SCATTER * B + 3 * np.sqrt(noise.variance(one.average))
        mark(np.sqrt(one.scatter) > limit, Reason.SCATTERED)
    for k in range(len(sums) - 1):
        mark(_unsteady(modulation[k : k + 2], sigmas[k : k + 2], reason == 0), Reason.UNSTEADY)
    means = []
    for apart, sigma in _apart(levels, sigmas, method):
        good = reason == 0
        means.append(np.exp(2j * np.pi * apart[good]).mean() if good.any() else 0)
        mark(~((np.abs(apart) < UNSURE) & (CERTAIN * sigma < 0.5)), Reason.UNSURE)
    means = np.array(means[: len(sums) - 1], complex)
    finest = int(np.argmin(levels[0].pitches))
    column = levels[0].Phis[finest] * np.float32(levels[0].pitches[finest] / TWO_PI)
    guard = _guard(levels[0].pitches[0], sigmas[0][reason == 0], method, width)
    mark(~(np.abs(column - (width - 1) / 2) <= width / 2 - guard), Reason.OUTSIDE)
    return Judged(reason, sigmas, np.angle(means) / TWO_PI, np.abs(means))


def _sigma(one: Sums, B, noise: Noise) -> np.ndarray:
    with np.errstate(divide="ignore"):
        return phase_sigma(np.sqrt(noise.variance(one.average)), B, one.fringe.steps)


def _apart(levels, sigmas, method) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """How far the columns of each two neighbours part, and its noise, in `order_step`s."""
    for level in levels:
        if level.parents:  # the difference of two phases has the noise of both
            sigmas = [np.hypot(sigmas[j], sigmas[j + 1]) for j in level.parents]
        scale = [np.float32(p / TWO_PI) for p in level.pitches]
        for k, (p, q) in enumerate(zip(level.pitches, level.pitches[1:], strict=False)):
            step = np.float32(order_step(method, p, q))
            a, b = (level.Phis[n] * scale[n] for n in (k, k + 1))
            yield (
                (a - b) / step,
                np.hypot(sigmas[k] * scale[k], sigmas[k + 1] * scale[k + 1]) / step,
            )


def order_step(method: str, p: float, q: float) -> float:
    """How far the columns of two pitches part, projector pixels, if an order is wrong by one.

    Between neighbours of a hierarchy that is the shorter pitch. By beats both orders are wrong
    together, so the columns part by the difference of the pitches; in the number-theoretical
    method by their greatest common divisor.
    """
    if method == "nt":
        return math.gcd(int(p), int(q))
    return abs(p - q) if method == "mw" else min(p, q)


def _unsteady(B, sigmas, good) -> np.ndarray:
    """Where the modulation changes from one pitch to the next otherwise than round about."""
    box = (AROUND, AROUND)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.where(good, np.log(B[0] / B[1]), 0).astype(np.float32)
        share = cv2.boxFilter(good.astype(np.float32), -1, box)
        off = np.abs(change - cv2.boxFilter(change, -1, box) / share)
    # The relative noise of a modulation is the noise of its phase.
    return good & (off > UNSTEADY + 4 * np.hypot(*sigmas))


def _guard(pitch: float, sigma, method: str, width: int) -> float:
    """Columns at either border that noise may throw to the other (chapter 4)."""
    if method != "mf" or pitch > 1.05 * width or not sigma.size:
        return 0.0
    return min(guard_columns(float(np.median(sigma)), width), width / 4)
