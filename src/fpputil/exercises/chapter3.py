"""Checkers of chapter 3, phase shifting."""

from __future__ import annotations

import numpy as np

from fpputil.decoding.noise import phase_sigma
from fpputil.decoding.phase import THRESHOLD, numerator_denominator, wrapped_phase
from fpputil.decoding.unwrap import wrap
from fpputil.exercises import close, exercise
from fpputil.optics.fringes import Fringe


@exercise("3.1", "M = 60 - 140 and D = 120 - 80; mind the sign before atan2, and give radians.")
def four_frames(answer):
    M, D = numerator_denominator(np.array([120.0, 60.0, 80.0, 140.0]))
    return close(answer, wrapped_phase(M, D), rtol=5e-3)


@exercise("3.2", "N = 2 (sigma / B / sigma_phi)^2, rounded up to a whole number.")
def steps_for_noise(answer):
    return close(answer, _least(lambda N: phase_sigma(1.5, 60, N) <= 0.01), rtol=0)


@exercise("3.3", "N = 3 is disturbed by 2 and 4, N = 4 by 3 and 5; go on.")
def steps_for_harmonics(answer):
    return close(
        answer, _least(lambda N: all((k - 1) % N and (k + 1) % N for k in (2, 3, 4, 5))), rtol=0
    )


@exercise(
    "3.4", "P = exp(-N T^2 / (4 sigma^2)) with N = 5, T = 8, sigma = 6; a share, not per cent."
)
def dark_share(answer):
    scale = phase_sigma(6.0, 1.0, 5)  # of 2M/N and 2D/N in the dark
    return close(answer, np.exp(-(THRESHOLD**2) / (2 * scale**2)), rtol=5e-3)


@exercise("3.5", "Bring the frames into the order of the shifts before you decode them.")
def backwards(answer):
    phi = np.random.default_rng(35).uniform(-3, 3, (4, 6))
    for steps in (3, 4, 7):
        shifts = Fringe(15, steps).shifts[:, None, None]
        frames = 100 + 50 * np.cos(phi + shifts)
        if not close(wrap(np.asarray(answer(frames[::-1])) - phi), np.zeros_like(phi), atol=1e-6):
            return False
    return True


def _least(holds) -> int:
    return next(N for N in range(3, 1000) if holds(N))
