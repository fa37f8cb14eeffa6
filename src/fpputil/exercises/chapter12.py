"""Exercises of chapter 12: your own light."""

from __future__ import annotations

import math

import numpy as np

from fpputil.exercises import exercise


@exercise(
    "12.1",
    "a column is Phi pitch / 2 pi.",
    "sigma pitch / (2 pi rate): a millimetre moves the column by rate.",
    unit="mm",
)
def depth_uncertainty(answer):
    """depth_sigma(sigma, pitch, rate)"""
    sigma, rate = np.random.default_rng(0).uniform(0.01, 0.4, (2, 20))
    yield answer(sigma, 24.0, rate), sigma * 24 / (2 * math.pi) / rate


@exercise(
    "12.2",
    "sigma_phi = sqrt(2 / N) sigma / B, and N is whole.",
    "2 (2 / 50 / 0.01)^2, rounded up.",
    unit="steps",
)
def steps_needed():
    return math.ceil(2 * (2 / 50 / 0.01) ** 2)


@exercise(
    "12.3",
    "np.fft.fft along the steps.",
    "numbers 1 and 2 of the transform are fringe and harmonic; divide their absolute values.",
)
def second_harmonic(answer):
    """second(frames)"""
    phi = np.linspace(0, 6, 40)
    delta = 2 * np.pi * np.arange(9)[:, None] / 9
    frames = 100 + 50 * np.cos(phi + delta) + 5 * np.cos(2 * (phi + delta) + 1)
    yield answer(frames), np.full(40, 0.1)


@exercise(
    "12.4",
    "the median does not mind a few wrong orders.",
    "the sign of the median of the differences from left to right, where both pixels count.",
)
def direction(answer):
    """grows(Phi)"""
    rng = np.random.default_rng(0)
    Phi = np.cumsum(rng.uniform(0.1, 0.5, (20, 30)), axis=1)
    Phi[rng.random(Phi.shape) < 0.02] += 40  # wrong orders
    holes = np.where(rng.random(Phi.shape) < 0.3, np.nan, Phi)
    yield answer(holes), 1
    yield answer(-holes), -1
