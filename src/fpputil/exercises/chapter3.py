"""Exercises of chapter 3, phase shifting."""

from __future__ import annotations

import numpy as np

from fpputil.decoding.noise import phase_sigma
from fpputil.decoding.phase import THRESHOLD, numerator_denominator, wrapped_phase
from fpputil.exercises import exercise
from fpputil.optics.fringes import Fringe


@exercise(
    "3.1",
    "with four steps the sines and cosines are 0, 1 and -1.",
    "M = 60 - 140, D = 120 - 80, and phi = -atan2(M, D).",
    unit="rad",
)
def four_frames():
    M, D = numerator_denominator(np.array([120.0, 60.0, 80.0, 140.0]))
    return wrapped_phase(M, D)


@exercise(
    "3.2",
    "solve sigma_phi = sqrt(2 / N) sigma / B for N; steps come whole.",
    "N = 2 (sigma / B / sigma_phi)^2, rounded up.",
    unit="steps",
)
def steps_for_noise():
    return _least(lambda N: phase_sigma(1.5, 60, N) <= 0.01)


@exercise(
    "3.3",
    "for which N is none of the four equal to m N + 1 or m N - 1?",
    "N = 3 is disturbed by 2 and 4, N = 4 by 3 and 5; go on.",
    unit="steps",
)
def steps_for_harmonics():
    return _least(lambda N: all((k - 1) % N and (k + 1) % N for k in (2, 3, 4, 5)))


@exercise(
    "3.4",
    "in the dark the modulation follows Rayleigh's law; a share is wanted, not per cent.",
    "exp(-N T^2 / (4 sigma^2)) with N = 5, T = 8, sigma = 6.",
)
def dark_share():
    scale = phase_sigma(6.0, 1.0, 5)  # of 2M/N and 2D/N in the dark
    return np.exp(-(THRESHOLD**2) / (2 * scale**2))


@exercise(
    "3.5",
    "turning the sign of the phase is not enough: which shift does the first frame have?",
    "bring the frames into the order of the shifts, frames[::-1], before you decode them.",
    unit="rad",
    period=2 * np.pi,
)
def backwards(answer):
    """answer(frames)"""
    phi = np.random.default_rng(35).uniform(-3, 3, (4, 6))
    for steps in (3, 4, 7):
        frames = 100 + 50 * np.cos(phi + Fringe(15, steps).shifts[:, None, None])
        yield answer(frames[::-1]), phi


def _least(holds) -> int:
    return next(N for N in range(3, 1000) if holds(N))
