"""Exercises of chapter 1: fringe synthesis."""

import numpy as np

from fpputil.exercises import exercise
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import preset


@exercise(
    "1.1",
    "follow one crest: where must the column be for the argument of the cosine to stay the same?",
    "a larger shift reaches the same argument at a smaller column: minus pitch / N.",
    unit="columns",
)
def step_in_columns():
    fringe = Fringe(24, steps=8)
    return -fringe.shifts[1] / fringe.phase(1)


@exercise(
    "1.2",
    "frequency is width over pitch: count the periods first.",
    "the pitch is 1140 rows over 912 / 15 periods; it need not be whole.",
    unit="pixels",
)
def pitch_along_the_rows():
    projector = preset("paper").system.projector
    return projector.height / (projector.width / 15)


@exercise(
    "1.3",
    "shifts and columns both count from 0; [:, None] turns the shifts into a column.",
    "255 / 2 * (1 + cos(2 pi i / pitch + 2 pi n / N)), in radians, not rounded.",
    unit="grey levels",
)
def pattern(answer):
    """pattern(pitch, steps, width)"""
    for p, n, w in ((15, 15, 912), (114, 3, 200), (23.5, 4, 96)):
        yield answer(p, n, w), Fringe(p, n).images(w, 1)[:, 0]


@exercise(
    "1.4",
    "by which factor does a Gaussian blur damp a fringe? Set it equal to 1/2.",
    "exp(-2 pi^2 s^2 / pitch^2) = 1/2: take the logarithm, then the root.",
    unit="pixels",
)
def blur_that_halves():
    return 15 * np.sqrt(np.log(2) / 2) / np.pi


@exercise(
    "1.5",
    "transform a whole number of periods; divide amplitudes, not powers.",
    "the ratio is (gamma - 1) / (gamma + 2).",
)
def second_harmonic():
    line = Fringe(114, gamma=1.8).intensity(np.arange(912), 0)
    amplitude = np.abs(np.fft.rfft(line))
    return amplitude[16] / amplitude[8]
