"""The curve through the photographs of a fringe: a sinusoid, or that of a response (chapter 12).

A response that is known is either taken back before a sinusoid is fitted; or, where black is known
beside it, its own curve is, which neither raises the noise of the dark nor minds blur.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from fpputil.capture.faults.gamma import (
    LEAST_STEPS,
    TURN,
    estimate_gamma,
    few_ratio,
    gamma_of_few,
    gamma_of_plain,
    harmonic_ratio,
    linearise,
    power_profile,
)
from fpputil.decoding import phase
from fpputil.decoding.unwrap import TWO_PI
from fpputil.optics.fringes import WHITE, Fringe

NEWTON = 4  # steps to a curve that is no sinusoid
GAMMAS = (-1.1, 1.25)  # logarithm, between which gamma is looked for
STARTS = (-0.8, -0.3, 0.1, 0.4, 0.7, 1.0)
BLURRED = 0.5  # most of the blur that is looked for
BLOCK = 2**18  # grey levels that are worked on at a time, so that they stay in the cache
MIDDLE = np.float32(WHITE / 2)  # squares are summed about it, so that they stay small
ENOUGH = 600  # pixels of the grid by which a response is told
LEAST_LIT = 100  # of them
SEEN = 0.015  # second harmonic over the fringe, from which on a response is looked for
LINEAR = 0.04  # a gamma as near to 1 leaves a second harmonic of one hundredth


class Fit(NamedTuple):
    """The curve through the photographs of a fringe, at each pixel; all (H, W) float32 arrays.

    `wrapped` phi, radians; `modulation` I'' and `average` I', grey levels (paper, Eq. 2, 3, 16)
    of 255; `residual`, the variance about the curve with its degrees of freedom, grey levels
    squared, 0 where there are none; `clipped`, the photographs in which the camera was saturated;
    `slope`, the modulation of the sinusoid that noise turns as much: the modulation itself, but
    for a response that is not linear.
    """

    wrapped: np.ndarray
    modulation: np.ndarray
    average: np.ndarray
    residual: np.ndarray
    clipped: np.ndarray
    slope: np.ndarray


def fit_response(
    frames,
    fringe: Fringe,
    shift: int = 1,
    gamma: float = 1.0,
    full: float = WHITE,
    black=None,
    blur: float = 0.0,
    gains=None,
    white=None,
) -> Fit:
    """Fit the curve of a fringe to all its photographs, (N, H, W). Chapter 12.

    The curve is a sinusoid, Eq. 2, for which `linearise` is done first; or, where black is known
    beside a gamma that is not 1, that of `power_profile`.

    Parameters
    ----------
    frames : (N, H, W) array
        Grey levels up to `full`.
    fringe : Fringe
    shift : {1, -1}
        Direction of the steps.
    gamma, full : float
        As of `linearise`.
    black : (H, W) array or float, optional
        The photograph without the projector's light, grey levels of 255.
    blur : float
        As of `power_profile`.
    gains : (N,) array, optional
        Brightness of each photograph, which is divided out.
    white : (H, W) array, optional
        The photograph in plain light, which tells the strength of the curve where it is not
        saturated; beside `black`.

    Examples
    --------
    >>> steps = 2 * np.pi * np.arange(4).reshape(4, 1, 1) / 4
    >>> result = fit_response(100 + 50 * np.cos(0.3 + steps), Fringe(24, 4))
    >>> [round(float(value[0, 0]), 3) for value in result]
    [0.3, 50.0, 100.0, 0.0, 0.0, 50.0]
    """
    steps, height, width = frames.shape
    delta = fringe.shifts[np.arange(steps) * shift % steps]
    weights = np.stack([np.sin(delta), np.cos(delta), np.ones(steps)]).astype(np.float32)
    result = Fit(*np.empty((6, height, width), np.float32))
    rows = max(1, BLOCK // (steps * width))
    for top in range(0, height, rows):
        here = slice(top, top + rows)
        block = frames[:, here]
        result.clipped[here] = np.add.reduce(block >= full, axis=0, dtype=np.uint16)
        scale = np.float32(WHITE / full)
        if gains is not None:
            block, scale = block * np.float32(WHITE / full / gains)[:, None, None], np.float32(1)
        if gamma != 1 and black is not None:
            grey = (block * scale).astype(np.float32, copy=False)
            dark = np.float32(black if np.ndim(black) == 0 else black[here])
            plain = None if white is None else white[here]
            curve = _fit_power(grey, delta, gamma, blur, dark, plain)
            for name, values in (curve | {"average": grey.mean(axis=0)}).items():
                getattr(result, name)[here] = values
            continue
        top_level = full if gains is None else WHITE
        grey = (block * scale if gamma == 1 else linearise(block, gamma, top_level)) - MIDDLE
        grey = grey.astype(np.float32, copy=False).reshape(steps, -1)
        M, D, total = (weights @ grey).reshape(3, -1, width)
        squares = np.einsum("np,np->p", grey, grey).reshape(M.shape)
        result.wrapped[here] = phase.wrapped_phase(M, D)
        result.modulation[here] = result.slope[here] = phase.modulation(M, D, steps)
        result.average[here] = MIDDLE + total / steps
        # The sum of squares less what average and modulation account for.
        left = squares - total * total / steps - (M * M + D * D) * (2 / steps)
        result.residual[here] = np.maximum(left, 0) / (steps - 3) if steps > 3 else 0
    return result


def _fit_power(grey, delta, gamma, blur, black, white) -> dict[str, np.ndarray]:
    """Least squares of the phase and strength of a `power_profile` (Gauss and Newton).

    It begins at the phase of the photographs made linear. That alone would raise the noise of the
    dark, and knows of no blur.
    """
    light, steps, counts = grey - black, len(grey), 0
    delta = np.float32(delta).reshape(-1, *(1,) * (light.ndim - 1))
    linear = linearise(light, gamma)
    phi = phase.wrapped_phase(*(np.sum(linear * of(delta), axis=0) for of in (np.sin, np.cos)))
    profile, rise = power_profile(gamma, blur)
    if white is not None:  # one more photograph, of all the light whatever the phase
        counts = np.float32(white < 0.98 * WHITE)
        light = np.concatenate([light, ((white - black) * counts)[None]])

    def dot(a, b):
        return np.einsum("n...,n...->...", a, b)

    for turn in range(NEWTON + 1):
        at = np.rint((phi + delta) * np.float32(TURN / TWO_PI)).astype(np.int32) & (TURN - 1)
        curve, slope = profile[at], rise[at]
        if white is not None:
            curve = np.concatenate([curve, counts[None]])
            slope = np.concatenate([slope, np.zeros_like(counts)[None]])
        size = np.maximum(dot(curve, curve), 1e-9)
        strength = dot(curve, light) / size
        slope = strength * (slope - curve * (dot(curve, slope) / size))
        left, steep = light - strength * curve, np.maximum(dot(slope, slope), 1e-9)
        if turn < NEWTON:
            phi = phi + np.clip(dot(slope, left) / steep, -0.3, 0.3)
    first = 2 / TURN * abs(np.fft.rfft(profile)[1])
    return {
        "wrapped": phi - TWO_PI * np.round(phi / TWO_PI),
        "modulation": np.maximum(strength, 0) * first,
        "residual": dot(left, left) / (steps + counts - 2),
        "slope": np.sqrt(2 / steps * steep),
    }


def left_by(
    samples, fringes: Sequence[Fringe], gamma: float, black=None, blur: float = 0.0, white=None
) -> float:
    """What a response leaves of photographs, over the modulation; the median over the pixels.

    Of each fringe (N, P) grey levels of 255; black and white, (P,), as of `fit`. Where three
    steps have no residual, it is how unlike the modulations of the pitches are.
    """
    dark, plain = (one if np.ndim(one) == 0 else one[None] for one in (black, white))
    fits = [
        fit_response(frames[:, None], fringe, 1, gamma, WHITE, dark, blur, None, plain)
        for frames, fringe in zip(samples, fringes, strict=True)
    ]
    left = [np.median(np.sqrt(one.residual) / np.maximum(one.modulation, 1)) for one in fits]
    if any(left) or len(fits) == 1:
        return float(np.mean(left))
    logs = np.log(np.maximum([one.modulation for one in fits], 1e-3))
    logs = logs - logs.mean(axis=0)
    return float(np.median(np.abs(logs - np.median(logs, axis=-1, keepdims=True))))


def blur_of(frames, fringe: Fringe, gamma: float, black, white=None) -> float:
    """Blur of `power_profile` that leaves least of photographs; arguments as of `left_by`."""

    def left(blur):
        return left_by([frames], [fringe], gamma, black, blur, white)

    return float(minimize_scalar(left, bounds=(0, BLURRED), options={"xatol": 1e-3}).x)


def response_by_curve(samples, fringes: Sequence[Fringe], black=None) -> tuple[float, object]:
    """The power whose curve leaves least of the photographs. Chapter 12.

    Parameters
    ----------
    samples : sequence of (N, P) arrays
        Of each fringe all steps at P pixels, well lit and not saturated, grey levels of 255.
    fringes : sequence of Fringe
    black : (P,) array, optional
        The same pixels without the projector's light; without it one level is found for all.

    Returns
    -------
    gamma : float
    black : (P,) array or float
        As given, or found.

    Examples
    --------
    >>> turns = np.linspace(0, 90, 999) + 2 * np.pi * np.arange(4)[:, None] / 4
    >>> light = 20 + np.linspace(50, 200, 999) * ((1 + np.cos(turns)) / 2) ** 2.2
    >>> gamma, black = response_by_curve([light], [Fringe(24, 4)])
    >>> round(gamma, 1), round(black)
    (2.2, 20)
    """
    pairs = sorted(zip(samples, fringes, strict=True), key=lambda pair: -pair[1].pitch)
    some = list(zip(*(pairs[:-1] or pairs), strict=True))  # the finest is blurred most

    def left(values):
        return left_by(*some, np.exp(values[0]), values[1] if black is None else black)

    darkest = float(np.median(np.min([frames.min(axis=0) for frames in samples], axis=0)))
    bounds = [GAMMAS, (0, darkest)][: 2 if black is None else 1]
    start = min(((log, 0.5 * darkest)[: len(bounds)] for log in STARTS), key=left)
    how = {"method": "Nelder-Mead", "options": {"xatol": 1e-3, "fatol": 1e-5}}
    values = minimize(left, start, bounds=bounds, **how).x
    return float(np.exp(values[0])), float(values[1]) if black is None else black


class Response(NamedTuple):
    """Through what the light went: `fit` takes the first three; `told` says what told them."""

    gamma: float = 1.0
    black: np.ndarray | float | None = None
    white: np.ndarray | None = None
    told: str = ""


def response_of(samples, fringes, white, black) -> Response:
    """Response of photographs (N, S); linear if it nearly is, or nothing tells.

    The light from elsewhere is added either to that of a power (by the projector), or before it is
    raised to one (by the camera): without a photograph of it, what fits better is taken.
    """
    use = lit_pixels(samples)
    if len(use) < LEAST_LIT:
        return Response()
    samples = [frames[:, use] for frames in samples]
    white, black = (None if one is None else one[use] for one in (white, black))
    few = fringes[0].steps < LEAST_STEPS
    if abs(few_ratio(samples) if few else harmonic_ratio(samples[-1], 2)) < SEEN:
        return Response()
    found = []
    if few and white is not None and black is not None:
        with suppress(ValueError):  # another light, or too bright
            gamma = gamma_of_plain(samples, white, black)
            if abs(np.log(gamma)) <= LINEAR:
                return Response()
            return Response(gamma, black, white, "photographs in plain light and none")
    with suppress(ValueError):  # no gamma does it
        gamma = gamma_of_few(samples) if few else estimate_gamma(samples[-1])
        found.append(Response(gamma, told=f"the second harmonic of {fringes[0].steps} steps"))
    gamma, dark = response_by_curve(samples, fringes, black)
    found.append(Response(gamma, dark, told=f"the curve of {fringes[0].steps} steps"))
    best = min(found, key=lambda one: left_by(samples, fringes, one.gamma, one.black))
    return Response() if abs(np.log(best.gamma)) < LINEAR else best


def lit_pixels(samples) -> np.ndarray:
    """Numbers of some hundred pixels that are well lit in all photographs, and not saturated."""
    use = np.ones(samples[0].shape[1], bool)
    for frames in samples:
        modulation = phase.modulation(*phase.numerator_denominator(frames), len(frames))
        use &= (modulation > 2 * phase.THRESHOLD) & (frames.max(axis=0) < 0.99 * WHITE)
    return np.flatnonzero(use)[:: max(1, use.sum() // ENOUGH)]
