"""Checkers of chapter 12: your own light."""

from __future__ import annotations

import math

import numpy as np

from fpputil.exercises import close, exercise


@exercise("12.1", "A column is Phi pitch / 2 pi; a millimetre moves it by so many columns.")
def depth_uncertainty(answer) -> bool:
    sigma, rate = np.random.default_rng(0).uniform(0.01, 0.4, (2, 20))
    return close(answer(sigma, 24.0, rate), sigma * 24 / (2 * math.pi) / rate)


@exercise("12.2", "sqrt(2 / N) noise / B must not exceed 0.01; N is whole.")
def steps_needed(answer) -> bool:
    return close(answer, math.ceil(2 * (2 / 50 / 0.01) ** 2))


@exercise("12.3", "np.fft.fft over the steps; numbers 1 and 2 of it are fringe and harmonic.")
def second_harmonic(answer) -> bool:
    phi = np.linspace(0, 6, 40)
    delta = 2 * np.pi * np.arange(9)[:, None] / 9
    frames = 100 + 50 * np.cos(phi + delta) + 5 * np.cos(2 * (phi + delta) + 1)
    return close(answer(frames), np.full(40, 0.1), atol=1e-6)


@exercise("12.4", "The median of the differences from left to right, where both pixels count.")
def direction(answer) -> bool:
    rng = np.random.default_rng(0)
    Phi = np.cumsum(rng.uniform(0.1, 0.5, (20, 30)), axis=1)
    Phi[rng.random(Phi.shape) < 0.02] += 40  # wrong orders
    holes = np.where(rng.random(Phi.shape) < 0.3, np.nan, Phi)
    return close(answer(holes), 1) and close(answer(-holes), -1)
