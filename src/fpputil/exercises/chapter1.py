"""Checkers of chapter 1: fringe synthesis."""

import numpy as np

from fpputil.exercises import close, exercise
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import preset


@exercise("1.1", "A larger shift reaches the same argument at a smaller column, pitch/N away.")
def step_in_columns(answer):
    phases = Fringe(24, steps=8)
    return close(answer, -phases.shifts[1] / phases.phase(1))


@exercise("1.2", "Frequency is the width of the projector over the pitch; it need not be whole.")
def pitch_of_64_periods(answer):
    return close(answer, preset("paper").system.projector.width / 64)


@exercise("1.3", "Radians; shifts 2 pi n / N with n from 0; columns from 0; shape (steps, width).")
def pattern(answer):
    cases = ((15, 15, 912), (114, 3, 200), (23.5, 4, 96))
    return all(close(answer(p, n, w), Fringe(p, n).images(w, 1)[:, 0], 1e-6) for p, n, w in cases)


@exercise("1.4", "exp(-2 pi^2 s^2 / pitch^2) = 1/2: take the logarithm, then the root.")
def blur_that_halves(answer):
    return close(answer, 15 * np.sqrt(np.log(2) / 2) / np.pi)


@exercise("1.5", "Transform a whole number of periods; divide amplitudes, not powers.")
def second_harmonic(answer):
    line = Fringe(114, gamma=1.8).intensity(np.arange(912), 0)
    amplitude = np.abs(np.fft.rfft(line))
    return close(answer, amplitude[16] / amplitude[8])
