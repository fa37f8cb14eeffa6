"""What a pixel of a capture is worth: its fit, its noise, reasons not to trust it (chapter 12)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

import cv2
import numpy as np
from scipy.special import chdtr, chdtri

from fpputil.capture.faults.consistency import without
from fpputil.capture.faults.curve import Fit
from fpputil.decoding.unwrap import TWO_PI, beats_of, covers, guard_columns
from fpputil.optics.fringes import WHITE, Fringe

QUANTISATION = 1 / 12  # variance of rounding, grey levels squared: the least noise there is
CLIPPED = 0.1  # of the photographs of a fringe; one clipped of twelve hardly turns the phase
SCATTER = 0.25  # of the modulation, beyond three times the noise
UNSTEADY = 0.2  # relative change of the modulation between pitches, beyond four times its noise
RIPPLED = 0.02  # of the pixels unsteady, from which on a response is looked for in it
AROUND = 31  # pixels, of the square over which modulations are compared
UNSURE = 0.4  # of an order, by which two pitches may part; at a half the order is a guess
CERTAIN = 2.5  # standard deviations of the noise that must lie within half an order
LEAST_PIXELS = 100  # for an estimate of the noise
CLASSES, EACH = 8, 60  # of grey levels at most, and about how many pixels in one at least
FEW = 4  # rows and columns, of which one is counted where a mean is enough
OUTLIERS = 0.2  # share of pixels that are left out, those that scatter most
LEFT = chdtr(3, chdtri(1, OUTLIERS)) / (1 - OUTLIERS)  # of the variance, by those that are kept
IN_STEP = 0.25  # most of the second harmonic of a response that a pixel may see


class Reason(IntEnum):
    """Why a pixel is not in the mask; the first that holds."""

    GOOD = 0
    DARK = 1
    SATURATED = 2
    SCATTERED = 3
    UNSTEADY = 4
    UNSURE = 5
    OUTSIDE = 6

    @property
    def said(self) -> str:
        """In a report."""
        return {3: "no sinusoid", 5: "order unsure"}.get(self, self.name.lower())


@dataclass(frozen=True)
class Noise:
    """Variance of a photograph's grey level of 255: ``constant + slope * level``.

    It is not `known` if it could not be estimated; the rounding of grey levels then stands in.
    """

    constant: float
    slope: float
    known: bool

    def variance(self, level):
        """At a grey level, (...), never below that of rounding."""
        return np.maximum(self.constant + self.slope * level, QUANTISATION)


def noise_of(sample: Sequence[np.ndarray], threshold: float) -> Noise:
    """Noise of photographs of phase-shifted fringes. Chapter 12.

    Of each fringe the sample has all steps at S pixels, (N, S), grey levels of 255. Pixels of less
    modulation than `threshold` do not count, nor in each class of grey level those that scatter
    most, at edges or by motion.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> steps = 2 * np.pi * np.arange(8)[:, None] / 8
    >>> frames = 120 + 60 * np.cos(rng.uniform(-3, 3, 5000) + steps)
    >>> noise = noise_of([frames + 2 * rng.standard_normal(frames.shape)], 8)
    >>> noise.known, round(float(noise.variance(120)))  # of a scatter of 2
    (True, 4)
    """
    points = []
    for frames in sample:
        scatter, use = _scatter(frames, threshold)
        points += _classes(frames[:, use].mean(axis=0), scatter[use])
    return _line(points)


def noise_of_curves(fits: Sequence[Fit], threshold: float) -> Noise:
    """Noise by what the curves of a response leave of three steps: one degree of freedom each."""
    points = []
    for one in fits:
        use = ((one.modulation > threshold) & (one.clipped == 0))[::FEW, ::FEW]
        points += _classes(one.average[::FEW, ::FEW][use], one.residual[::FEW, ::FEW][use])
    return _line(points)


def _classes(level, scatter) -> list[tuple[float, float]]:
    """Mean grey level and variance of classes of pixels, less those that scatter most."""
    if len(level) < LEAST_PIXELS:
        return []
    members = np.array_split(np.argsort(level), min(CLASSES, 1 + len(level) // EACH))
    kept = [np.sort(scatter[each])[: round((1 - OUTLIERS) * len(each))] for each in members]
    return [(level[m].mean(), k.mean() / LEFT) for m, k in zip(members, kept, strict=True)]


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
        out = (spectrum[highest] * turn.conj() ** highest).imag
        for times in (steps, 2 * steps):  # harmonics N - k, N + k ... of a response look like k
            out = without(out, np.abs(spectrum[1]) * (turn**times).imag)
        return 2 / steps * out**2, use
    if steps == 4:
        cosine, second = (turn**2).real, spectrum[2].real
        second = without(second, np.abs(spectrum[1]) * cosine)
        return second**2 / 4, use & (np.abs(cosine) < IN_STEP)
    return np.zeros(frames.shape[1]), np.zeros(frames.shape[1], bool)


def _line(points) -> Noise:
    """Variance as a line over the level, or a constant where it cannot be told or falls."""
    if not points:
        return Noise(QUANTISATION, 0.0, False)
    levels, variances = map(np.array, zip(*points, strict=True))
    slope, constant = np.polyfit(levels, variances, 1) if np.ptp(levels) > 20 else (-1, 0)
    if slope < 0:
        slope, constant = 0.0, np.mean(variances)
    elif constant < 0:
        slope, constant = (levels @ variances) / (levels @ levels), 0.0
    return Noise(float(constant), float(slope), True)


def judge(
    fits: Sequence[Fit],
    fringes: Sequence[Fringe],
    Phis: Sequence[np.ndarray],
    noise: Noise,
    threshold: float,
    method: str,
    width: int,
    responses: Sequence[float] = (),
) -> tuple[np.ndarray, list[np.ndarray], np.ndarray, np.ndarray]:
    """Find a reason not to trust a pixel. Chapter 12.

    It takes of each of P pitches the fit, the fringe and the absolute phase, (H, W), radians; the
    noise, the least modulation, grey levels, and `unwrap` and `width(axis)` of the `Patterns`; and
    of each pitch the `response_share`, 0 by default.

    Returns
    -------
    reason : (H, W) uint8 array
        `Reason` of each pixel.
    sigmas : list of P (H, W) arrays
        Standard deviation of each wrapped phase by noise and modulation, radians.
    offsets, sharpness : (P - 1,) arrays
        Of each two neighbouring pitches the circular mean of how far their columns part, as a
        share of `order_step` (by beats: of each pitch but one how far the shortest beat is off),
        0 where they agree; and its length, 1 if all pixels tell the same, near 0 if they tell
        nothing.
    """
    reason, pitches = np.zeros(fits[0].wrapped.shape, np.uint8), [f.pitch for f in fringes]
    sigmas = [
        _look(one, fringe.steps, noise, threshold, reason, share)
        for one, fringe, share in zip(fits, fringes, responses or [0.0] * len(fits), strict=True)
    ]
    waves = [f.steps * one.wrapped for one, f in zip(fits, fringes, strict=True)]
    pairs = zip(pairwise(fits), pairwise(sigmas), pairwise(waves), strict=True)
    for (one, other), noises, turns in pairs:
        _mark_unsteady(one.modulation, other.modulation, np.hypot(*noises), turns, reason)
    few = (slice(None, None, FEW), slice(None, None, FEW))
    means, tell = [], reason[few] == Reason.GOOD  # of which an offset may leave none
    tell = tell if tell.any() else reason[few] != Reason.DARK
    for apart, sigma in parted(Phis, pitches, sigmas, method, width):
        turns = np.exp(1j * TWO_PI * apart[few][tell])
        means.append(turns.mean() if turns.size else 0)
        mark(reason, ~((np.abs(apart) < UNSURE) & (CERTAIN * sigma < 0.5)), Reason.UNSURE)
    means = np.array(means[: len(fits) - 1], complex)
    finest = int(np.argmin(pitches))
    column = Phis[finest] * np.float32(pitches[finest] / TWO_PI)
    good, guard = reason[few] == Reason.GOOD, 0.0
    if good.any():  # columns at either border that noise may throw to the other (chapter 4)
        typical = [float(np.median(sigma[few][good])) for sigma in sigmas]
        guard = _guard(pitches, typical, method, width)
    inside = np.abs(column - np.float32((width - 1) / 2)) <= np.float32(width / 2 - guard)
    mark(reason, ~inside, Reason.OUTSIDE)
    return reason, sigmas, np.angle(means) / TWO_PI, np.abs(means)


def order_step(method: str, p: float, q: float) -> float:
    """How far the columns of two pitches part, projector pixels, if an order is wrong by one.

    >>> [order_step(method, 30, 24) for method in ("mf", "nt")]
    [24, 6]
    """
    return math.gcd(int(p), int(q)) if method == "nt" else min(p, q)


def start_offsets(pitches: Sequence[float], method: str, width: float, start: float) -> np.ndarray:
    """The `offsets` of `judge` if all fringes begin at a phase, `start` in periods, and not at 0.

    >>> start_offsets([912, 114, 19], "mf", 912, -0.25), start_offsets([14, 15], "mw", 912, -0.25)
    (array([ 0.25, -0.25]), array([0.25]))
    """
    if method == "mw" and not covers(pitches[-1], width):
        return np.full(len(pitches) - 1, -start)  # a beat has no part in it
    if method == "nt":
        p, q = pitches
        return _fraction(np.array([(p - q) / order_step(method, p, q) * start]))
    offsets, off, pitches = [], start, pitches[::-1] if method == "mw" else pitches
    if method == "gray":  # the code tells how far the first phase is off
        off = _fraction(start)
        offsets = [off]
    for p, q in pairwise(pitches):  # the order of a pitch takes up what is whole
        apart = off * p / q - start
        offsets.append(_fraction(apart))
        off = start + np.round(apart)
    return np.array(offsets[::-1] if method == "mw" else offsets)


def _fraction(turns):
    return turns - np.round(turns)


def _guard(pitches, sigmas, method: str, width: float) -> float:
    """Columns at either border that noise, or a beat that is too short, may throw to the other."""
    if method not in ("mf", "mw"):
        return 0.0
    pitches, sigmas, weights = list(pitches), np.array(sigmas), np.eye(len(pitches))
    while method == "mw" and len(pitches) > 1 and not covers(pitches[-1], width):
        pitches, pairs = beats_of(pitches)
        weights = np.stack([weights[j] - weights[j + 1] for j in pairs])
    longest, noise = max(pitches), float(np.hypot.reduce(weights[np.argmax(pitches)] * sigmas))
    if longest > 1.05 * width:
        return 0.0
    return min(guard_columns(noise, longest) + max(width - longest, 0), width / 4)


def mark(reason, fault, why: Reason) -> None:
    """Give a reason to the pixels that have none yet."""
    reason[fault & (reason == Reason.GOOD)] = why


def _look(one: Fit, steps: int, noise: Noise, threshold, reason, share) -> np.ndarray:
    """Mark dark, saturated and scattered pixels of a fringe; returns the noise of its phase.

    ``sigma_phi = sqrt(2/N) sigma / B`` with the noise at the average grey level (chapter 3).
    """
    B, variance = one.modulation, noise.variance(one.average)
    left = np.sqrt(np.maximum(one.residual - share * B**2, 0))
    scattered = left > SCATTER * B + 3 * np.sqrt(variance)
    mark(reason, ~(B > threshold), Reason.DARK)
    mark(reason, one.clipped > CLIPPED * steps, Reason.SATURATED)
    mark(reason, scattered, Reason.SCATTERED)
    return phase_noise(one, steps, noise)


def phase_noise(one: Fit, steps: int, noise: Noise) -> np.ndarray:
    """Standard deviation of a wrapped phase, (H, W), radians, by noise and modulation (ch. 3)."""
    with np.errstate(divide="ignore"):  # a pixel of one grey level in all photographs
        return np.sqrt(2 / steps * noise.variance(one.average)) / one.slope


def _mark_unsteady(B, other, sigma, turns, reason) -> None:
    """Mark where the modulation changes between two pitches otherwise than round about.

    The relative noise of a modulation is the noise of its phase. What goes with `turns`, the steps
    times the phase of each, is of a response and no reason.
    """
    good = reason == Reason.GOOD
    change = np.zeros_like(B)
    np.log(np.divide(B, other, out=change, where=good), out=change, where=good)
    box = (AROUND, AROUND)
    near = cv2.boxFilter(change, -1, box)
    share = cv2.boxFilter(good.astype(np.float32), -1, box)
    limit = UNSTEADY + 4 * sigma
    with np.errstate(divide="ignore", invalid="ignore"):
        change -= near / share
        if (np.abs(change[good]) > limit[good]).mean() > RIPPLED if good.any() else False:
            change -= _ripple(change, turns, good)
        mark(reason, np.abs(change) > limit, Reason.UNSTEADY)


def _ripple(change, turns, good) -> np.ndarray:
    """What of a change, (H, W), goes with the turns of two pitches: waves, by least squares."""
    few = (slice(None, None, FEW), slice(None, None, FEW))
    waves = [of(k * turn) for turn in turns for k in (1, 2) for of in (np.cos, np.sin)]
    used = good[few]
    terms, values = np.stack([wave[few][used] for wave in waves], axis=1), change[few][used]
    for _ in range(3):  # without those that do not fit
        factors = np.linalg.lstsq(terms, values, rcond=None)[0]
        off = np.abs(values - terms @ factors)
        near = off <= 3 * np.median(off)
        terms, values = terms[near], values[near]
    return sum(factor * wave for factor, wave in zip(factors, waves, strict=True))


def response_share(frames) -> float:
    """Variance that a response adds to the residual of a sinusoid, over the squared modulation.

    By harmonics in step with the fringe, in photographs (N, P), at most at a pixel.

    >>> turn = np.linspace(0, 50, 999) + 2 * np.pi * np.arange(8)[:, None] / 8
    >>> share = response_share(100 + 50 * np.cos(turn) + 10 * np.cos(2 * turn))
    >>> round(share, 3)  # 0.2**2 / 2, of 8 - 3 degrees of freedom of 8
    0.032
    """
    steps = len(frames)
    if steps < 4 or not frames.size:
        return 0.0
    ratios = harmonics_of(frames)[2:]
    energy = ratios**2 / 2
    if steps % 2 == 0:  # the highest harmonic of an even number is a cosine alone
        energy[-1] *= 2
    return float(energy.sum() * steps / (steps - 3))


def harmonics_of(frames) -> np.ndarray:
    """Strength of the harmonics 0 to N / 2 of photographs (N, P) in step with the fringe.

    Over that of the fringe, which is 1; harmonic 0 is the average.
    """
    steps = len(frames)
    spectrum = np.fft.rfft(frames, axis=0)
    size = np.abs(spectrum[1])
    turn = spectrum[1] / np.maximum(size, 1e-9)
    along = (spectrum * turn.conj() ** np.arange(len(spectrum))[:, None]).real
    ratios = along @ size / max(size @ size, 1e-9)
    ratios[0] /= 2
    if steps % 2 == 0:
        wave = (turn ** (steps // 2)).real * size
        ratios[-1] = (spectrum[-1].real @ wave) / (2 * max(wave @ wave, 1e-9))
    return ratios


def parted(Phis, pitches, sigmas, method, width) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """How far what unwraps a pitch lies off its phase, and the noise of that, in orders.

    Of each two neighbours how far their columns part; by beats, of each pitch but one of those
    whose beat is the shortest, how far that beat is off, and of the beats likewise.
    """
    if method == "mw" and not covers(pitches[-1], width):
        beats, pairs = beats_of(pitches)
        j = pairs[0]
        for k, pitch in enumerate(pitches):
            if k == j + 1:
                continue  # that of its neighbour
            ratio, minus = np.float32(beats[0] / pitch), float(k == j)
            apart = ratio * (Phis[j] - Phis[j + 1]) - Phis[k]
            noise = np.hypot((ratio - minus) * sigmas[j], ratio * sigmas[j + 1])
            noise = noise if minus else np.hypot(noise, sigmas[k])
            yield apart / np.float32(TWO_PI), noise / np.float32(TWO_PI)
        both = [np.hypot(sigmas[j], sigmas[j + 1]) for j in pairs]  # a difference has both's noise
        Phis = [Phis[j] - Phis[j + 1] for j in pairs]
        yield from parted(Phis, beats, both, method, width)
        return
    for k, (p, q) in enumerate(pairwise(pitches)):
        step = TWO_PI * order_step(method, p, q)
        one, other = np.float32(p / step), np.float32(q / step)
        apart = Phis[k] * one - Phis[k + 1] * other
        yield apart, np.hypot(sigmas[k] * one, sigmas[k + 1] * other)
