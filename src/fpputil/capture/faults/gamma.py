"""A response that is not linear: how it shows in a phase, and how to take it back (chapter 12).

Projector and camera together raise the light to an exponent, gamma. That adds harmonics, which few
steps take for the fringe itself. Gamma is found where the photographs, raised to 1 / gamma, lose
their second harmonic (five steps or more); from the mean light between black and white; or where
the curve of a power leaves least of the photographs (`fpputil.capture.faults.curve.fit_response`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaln

from fpputil.checks import positive
from fpputil.decoding import phase
from fpputil.optics.fringes import WHITE

INVERSES = (0.15, 3.0)  # between which 1 / gamma is looked for
LEAST_STEPS = 5  # with four, the second harmonic of a pixel cannot be told from its noise
PLAIN = 40.0  # grey levels from black to white, from which on a pixel tells the mean light
BEYOND = (0.85, 1.08)  # of white, the brightest light of the fringes if both were lit alike
HARMONICS = 32  # of the profile of a power
TURN = 2**13  # entries of a profile, over a period


def linearise(frames, gamma: float, full: float = WHITE):
    """Photographs through a response, made linear: ``255 (I / full) ** (1 / gamma)``.

    Parameters
    ----------
    frames : (...) array
        uint8, uint16 or float, 0 to `full`.
    gamma : float
        Exponent of the response; 1 leaves all but the scale.
    full : float
        Grey level of saturation.

    Returns
    -------
    (...) float32 array
        0 to 255.

    Examples
    --------
    >>> light = np.array([0.0, 0.25, 1.0])
    >>> photograph = 255 * light**0.5  # of a camera with gamma 0.5
    >>> linearise(photograph, 0.5).tolist()
    [0.0, 63.75, 255.0]
    """
    inverse = 1 / positive("gamma", gamma)
    if frames.dtype in (np.uint8, np.uint16):  # each grey level once
        return linearise(np.arange(np.iinfo(frames.dtype).max + 1.0), gamma, full)[frames]
    return (WHITE * (np.maximum(frames, 0) / full) ** inverse).astype(np.float32)


def harmonic_ratio(frames: np.ndarray, order: int) -> float:
    """Strength of a harmonic in photographs of a fringe, over that of the fringe. Chapter 12.

    Positive where the bright half of the fringe is the narrower one; 0 for a linear response.

    Parameters
    ----------
    frames : (N, P) array
        All steps, equally shifted, at P pixels.
    order : int
        2 for the second harmonic; below N / 2.

    Examples
    --------
    >>> turn = 2 * np.pi * np.arange(8) / 8
    >>> frames = (100 + 50 * np.cos(turn) + 5 * np.cos(2 * turn))[:, None]
    >>> round(harmonic_ratio(frames, 2), 6)
    0.1
    """
    steps = len(frames)
    if not 2 <= order < steps / 2:
        raise ValueError(f"harmonic {order} of {steps} steps given; it lies from 2 to below N / 2")
    turns = np.exp(-2j * np.pi * np.outer((1, order), np.arange(steps)) / steps)
    first, other = turns @ frames
    size = np.maximum(np.abs(first), 1e-12)
    along = (other * np.conj(first / size) ** order).real
    return float((along * size).sum() / (size**2).sum())


def estimate_gamma(frames: np.ndarray) -> float:
    """Exponent of the response through which a fringe was photographed. Chapter 12.

    Between 1/3 and 6.7. Of light from elsewhere it knows nothing: black should be 0.

    Parameters
    ----------
    frames : (N, P) array
        All N >= 5 steps at P pixels that are well lit and not saturated, grey levels of 255.

    Raises
    ------
    ValueError
        If there are too few steps, or no gamma in this range takes the harmonic away.

    Examples
    --------
    >>> turn = 2 * np.pi * np.arange(12) / 12
    >>> light = (1 + np.cos(turn))[:, None] / 2
    >>> round(estimate_gamma(255 * light**2.2), 2)
    2.2
    """
    if frames.ndim != 2 or len(frames) < LEAST_STEPS or frames.shape[1] == 0:
        raise ValueError(
            f"frames of shape {frames.shape} given; (steps, pixels) are needed, {LEAST_STEPS} "
            "steps or more of at least one pixel"
        )

    return _without(lambda gamma: harmonic_ratio(linearise(frames, gamma), 2))


def gamma_of_plain(samples: Sequence[np.ndarray], white: np.ndarray, black: np.ndarray) -> float:
    """Exponent of the response, by photographs in plain light and in none. Chapter 12.

    Between black and white a fringe has the mean ``Gamma(2 g + 1) / (4**g Gamma(g + 1)**2)``, 1/2
    if the response is linear. Blur does not change it, nor does light that white has, too.

    Parameters
    ----------
    samples : sequence of (N, P) arrays
        All steps of each fringe at P pixels, grey levels of 255.
    white, black : (P,) arrays
        The same pixels in plain light, and without the projector's.

    Raises
    ------
    ValueError
        If too few pixels are lit and not saturated, or white is not the light of the fringes.

    Examples
    --------
    >>> turn = np.linspace(0, 20, 999) + 2 * np.pi * np.arange(3)[:, None] / 3
    >>> light = 20 + 200 * ((1 + np.cos(turn)) / 2) ** 2.2
    >>> round(gamma_of_plain([light], np.full(999, 220), np.full(999, 20)), 2)
    2.2
    """
    span = np.asarray(white, float) - black
    use = (span > PLAIN) & (white < 0.99 * WHITE)
    for frames in samples:
        use &= frames.max(axis=0) < 0.99 * WHITE
    if use.sum() < 20:
        raise ValueError("white and black tell nothing: too few pixels are lit and not saturated")
    share = [(frames[:, use] - black[use]) / span[use] for frames in samples]
    top = float(np.quantile(np.max([one.max(axis=0) for one in share], axis=0), 0.9))
    if not BEYOND[0] < top < BEYOND[1]:
        raise ValueError(f"the fringes reach {top:.0%} of white, which is another light")
    mean = float(np.median([one.mean() for one in share]))
    low, high = (1 / inverse for inverse in INVERSES[::-1])
    if not _mean_of_power(high) < mean < _mean_of_power(low):
        raise ValueError(f"the mean of the fringes is {mean:.0%} of white: no power does that")
    return float(brentq(lambda gamma: _mean_of_power(gamma) - mean, low, high))


def _mean_of_power(gamma: float) -> float:
    """Mean of ``((1 + cos) / 2) ** gamma`` over a period."""
    return float(np.exp(gammaln(2 * gamma + 1) - 2 * gammaln(gamma + 1) - gamma * np.log(4)))


def gamma_of_few(samples: Sequence[np.ndarray]) -> float:
    """Exponent of the response where all pitches have three or four steps. Chapter 12.

    As `estimate_gamma`, but by `few_ratio`, whose samples it takes.

    Examples
    --------
    >>> x = np.linspace(0, 90, 999)
    >>> turns = [x / p + 2 * np.pi * np.arange(3)[:, None] / 3 for p in (1, 7)]
    >>> round(gamma_of_few([200 * ((1 + np.cos(turn)) / 2) ** 2.2 for turn in turns]), 1)
    2.2
    """
    return _without(lambda gamma: few_ratio([linearise(frames, gamma) for frames in samples]))


def _without(second) -> float:
    """The gamma at which a function of it, the second harmonic, is 0; ValueError if none is."""
    ends = [second(1 / inverse) for inverse in INVERSES]
    if not ends[0] < 0 < ends[1]:
        raise ValueError(
            f"the second harmonic is {ends[0]:.3f} to {ends[1]:.3f} of the fringe for gammas "
            f"{1 / INVERSES[0]:.1f} to {1 / INVERSES[1]:.2f}: none takes it away; give one, or 1"
        )
    return 1 / float(brentq(lambda inverse: second(1 / inverse), *INVERSES, xtol=1e-4))


def few_ratio(samples: Sequence[np.ndarray]) -> float:
    """Second harmonic over the fringe, as it shows in pitches of three or four steps.

    A second harmonic makes the modulation of three steps change with three times the phase, against
    that of the other pitches, or, of one pitch alone, against the average; with four it is the
    difference of even and odd steps, in step with twice the phase.

    Parameters
    ----------
    samples : sequence of (3, P) or (4, P) arrays
        All steps of each fringe at the same P pixels, well lit and not saturated, grey levels.
        The phases must be of all sizes, as they are where a pitch has several periods.

    >>> turn = np.linspace(0, 90, 999) + 2 * np.pi * np.arange(4)[:, None] / 4
    >>> round(few_ratio([100 + 50 * np.cos(turn) + 5 * np.cos(2 * turn)]), 2)
    0.1
    """
    product, square, phis, logs = 0.0, 0.0, [], []
    for frames in samples:
        M, D = phase.numerator_denominator(frames)
        phi, B = phase.wrapped_phase(M, D), phase.modulation(M, D, len(frames))
        if len(frames) == 4:
            both, cosine = (frames[0] - frames[1] + frames[2] - frames[3]) / 4, np.cos(2 * phi)
            product, square = product + both @ (cosine * B), square + (B * cosine) @ (B * cosine)
        phis.append(phi)
        logs.append(np.log(np.maximum(B, 1e-6)))
    if square:
        return float(product / square)
    if len(samples) == 1:
        phis, logs = phis * 2, [*logs, np.log(np.maximum(samples[0].mean(axis=0), 1e-6))]
        return ripple(phis, logs, (3, 0))
    return ripple(phis, logs, [3] * len(samples))


def ripple(phis, logs, steps) -> float:
    """How the logarithm of a modulation changes with the cosine of three times the phase.

    Of P pitches the phases, logarithms, (P, S), and steps; those of other than three steps only
    serve to compare.
    """
    waves = [np.cos(3 * phi) * (number == 3) for phi, number in zip(phis, steps, strict=True)]
    waves, logs = (np.array(a) - np.mean(a, axis=0) for a in (waves, logs))
    waves, logs = (a - a.mean(axis=1, keepdims=True) for a in (waves, logs))
    return float((waves * logs).sum() / max((waves**2).sum(), 1e-9))


def power_profile(gamma: float, blur: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A fringe through a response, ``((1 + cos x) / 2) ** gamma``, and its slope over x.

    Two arrays of `TURN` entries, from x = 0 on. Blur takes ``exp(-blur k**2)`` of harmonic k.

    >>> light, slope = power_profile(2.0)
    >>> light[[0, TURN // 4, TURN // 2]].round(2).tolist()
    [1.0, 0.25, 0.0]
    """
    cosine = np.cos(2 * np.pi * np.arange(TURN) / TURN)
    strength, orders = np.fft.rfft(((1 + cosine) / 2) ** gamma), np.arange(TURN // 2 + 1)
    strength = np.where(orders <= HARMONICS, strength * np.exp(-blur * orders**2), 0)
    light, slope = np.fft.irfft(strength), np.fft.irfft(1j * orders * strength)
    return light.astype(np.float32), slope.astype(np.float32)
