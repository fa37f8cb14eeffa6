"""What is said of a wrong value: of a number, of several, and of what a function returns."""

import numpy as np
import pytest

from fpputil.exercises.diagnosis import (
    CLOSE,
    CONSTANT,
    NEARLY,
    NOT_WHOLE,
    ROUNDED,
    SIGN,
    TO_WHOLE,
    TOO_LARGE,
    TOO_SMALL,
    of_function,
    of_number,
)

PAIR = (351.823, 223.338)
AXIS = (-0.996195, -0.0871557, 6e-17)
ORDER = "The values are right, their order is not."
NUMBERS = [
    (1.1071, 1.107, ""),
    (1.1071, 1.108, CLOSE),
    (2.8109, 2.81, NEARLY),
    (1.1071, 1.11, NEARLY),
    (1.1071, 1.1, NEARLY),
    (0.21053, 0.211, NEARLY),
    (0.21053, 0.210, NEARLY),
    (97.919, 98, NEARLY),
    (12.527, 12.5, NEARLY),
    (12.527, 12.52, NEARLY),
    (12.527, 12.566, CLOSE),
    (1.1071, -1.11, "The size is right, the sign is wrong."),
    (0.1084, 10.84, "It is 100 times too large: per cent in place of a share?"),
    (405.2, 0.4052, "It is 1000 times too small: look at the units."),
    (1.753, 11.01, "It is 2 pi times too large."),
    (1.1071, 63.4, "It is 180 / pi times too large: degrees in place of radians?"),
    (63.43, -1.107, "It is 180 / pi times too small: radians in place of degrees?"
     " The sign is wrong too."),
    (15.85, 9.567, None),  # in radians it would be a turn less
    (0.2105, 4.75, "It is upside down: that is the reciprocal."),
    (0.2105, 0.0443, "It is the square of the right one."),
    (0.2105, 0.4588, "It is the root of the right one."),
    (13, 13.0, ""),
    (24.649, 25, NEARLY),
    (24.649, 24, None),
    (24.649, 24.6, NEARLY),
    (105, 104, "It is one too few."),
    (105, 106, "It is one too many."),
    (105, 1050, "It is 10 times too large."),
    (105, 10500, "It is 100 times too large."),
    (-3.0, -6, None),  # not twice: of so small a number it would be given away
    (-3.5, -7, "It is twice the right one."),
    (13, 12, TOO_SMALL),
    (13, 26, TOO_LARGE),
    (13, -13, SIGN),
    (13, 0, TOO_SMALL),
    (13, 12.5, NOT_WHOLE),
    (9972, 9970, "It is close, but a whole number must be exact."),
    (2.811, 40.0, "It is far too large."),
    (2.811, 0.2, "It is far too small."),
    (2.811, 3.3, None),
    (2.811, "2.811", "The text '2.811' given; a number wanted."),
    (2.811, None, "None given; a number wanted."),
    (2.811, len, "A function given; a number wanted."),
    (2.811, {}, "An object of type dict given; a number wanted."),
    (2.811, float("nan"), "NaN or infinity given; numbers wanted."),
    (2.811, [2.811], "An array of one number given; a number wanted."),
    (PAIR, (351.8, 223.3), ""),
    (PAIR, PAIR[::-1], "The values are right, their order is not."),
    (PAIR, (352.323, 223.838), CLOSE),
    (PAIR, (351.8, -223.3), "Only the second is wrong. The size is right, the sign is wrong."),
    (PAIR, (1.0, 223.3), "Only the first is wrong. It is far too small."),
    (PAIR, 351.8, "A number given; 2 numbers wanted."),
    (PAIR, (352, 223), NEARLY),
    (PAIR, (352, -223.3), f"Only the second is wrong. {SIGN}"),
    (PAIR, (-351.8, 200), "The first and the second are wrong."),
    (PAIR, (400, 200), "The first and the second are wrong."),
    (PAIR, (9999, 99), "The first and the second are wrong. It is far too large."),
    (AXIS, (-0.9962, -0.0872, 0), ""),
    (AXIS, (-1, -0.087, 0), NEARLY),
    (AXIS, (-0.0872, -0.9962, 0), ORDER),
    (AXIS, (0.9962, 0.0872, 0), SIGN),
    (AXIS, (0.9962, 0.05, 0), "The first and the second are wrong."),
    (AXIS, (-0.9962, -0.0872, 0.02), "Only the third is wrong. It is far too large."),
    ([1, 0, 2, 2], [2, 2, 0, 1], ORDER),
    ([1, 0, 2, 2], [1, 0, 1, 2], f"Only the third is wrong. {TOO_SMALL}"),
    ([1, 0, 2, 2], [1, 0, 70, 7], f"The third and the fourth are wrong. {TOO_LARGE}"),
    ([1, 0, 2, 2], [0, -1, 1, 1], "The first, the second, the third and the fourth are wrong."
     f" {TOO_SMALL}"),
    ([1, 0, 2, 2], [1, 0, 2, 2.5], f"Only the fourth is wrong. {NOT_WHOLE}"),
    (True, False, "It is False where True is right."),
    (True, 1.0, "An object of type float given; True or False wanted."),
]  # fmt: skip


@pytest.mark.parametrize(("expected", "answer", "says"), NUMBERS)
def test_numbers(expected, answer, says):
    assert of_number(answer, expected) == says


def test_units_have_faults_of_their_own():
    assert of_number(9.567, 15.85, "rad") == "It is off by a multiple of 2 pi."
    assert of_number(1083, 10.83) == "It is 100 times too large: per cent in place of a share?"
    assert of_number(1083, 10.83, "mm") == "It is 100 times too large."
    assert of_number(0.1083, 10.83) == "It is 100 times too small."
    share = "It is 100 times too small: a share in place of per cent?"
    assert of_number(0.1083, 10.83, "%") == share
    half = "It is half a pixel off: pixel centres are whole numbers."
    assert of_number((352.323, 223.838), PAIR, "px") == half


MAP = np.random.default_rng(0).uniform(1, 9, (5, 7))
LARGEST = tuple(map(int, np.unravel_index(MAP.argmax(), MAP.shape)))


def cases(give):
    yield give(MAP, 2.0), 2 * MAP


def cut(x, factor):
    y = factor * x
    return y[:, 7]


FUNCTIONS = [
    (lambda x, k: k * x, ""),
    (lambda x, k: -k * x, "Your function returns something else. The size is right, the sign is"
     " wrong."),
    (lambda x, k: (k * x).T, "Your function returns something else. The shape (7, 5) given; the"
     " shape (5, 7) wanted: the axes are swapped."),
    (lambda x, k: np.rint(k * x), f"Your function returns something else. {TO_WHOLE}"),
    (lambda x, k: (k * x).astype(np.uint8), f"Your function returns something else. {TO_WHOLE}"),
    (lambda x, k: np.round(k * x, 1), f"Your function returns something else. {ROUNDED}"),
    (lambda x, k: np.where(x < x.max(), k * x, 0), "Your function returns something else. It is"
     f" wrong at 1 of 35 places, first at index {LARGEST}."),
    (lambda x, k: None, "Your function returns nothing: where is its return?"),
    (lambda x, k: "x", "Your function returns something else. The text 'x' given; the shape (5, 7)"
     " wanted."),
    (lambda x: x, "Your function is called as give(x, k); it takes (x)."),
    (cut, "Your function raises IndexError in its line 3: index 7 is out of bounds for axis 1 with"
     " size 7."),
    (2 * MAP, "An object of type ndarray given; a function give(x, k) wanted: its name, without a"
     " call."),
]  # fmt: skip


@pytest.mark.parametrize(("function", "says"), FUNCTIONS)
def test_functions(function, says):
    assert of_function(function, "give(x, k)", cases) == says


def test_what_cannot_be_used_is_told():
    def needs_a_method(give):
        yield give(1).item(), 1

    says = of_function(lambda x: [x], "give(x)", needs_a_method)
    assert says.startswith("What your function returns cannot be used. AttributeError: 'list'")


def test_results_may_differ_by_a_period():
    def phase(give):
        yield give(1.0), 1.0

    assert of_function(lambda x: x - 2 * np.pi, "give(x)", phase, period=2 * np.pi) == ""
    assert of_function(lambda x: x - 2 * np.pi, "give(x)", phase) != ""


ANGLES = [
    (lambda x: x - 2 * np.pi * (x > 0), ""),
    (lambda x: -x, SIGN),
    (lambda x: np.angle(np.exp(-1j * x)), SIGN),
    (lambda x: np.angle(np.exp(1j * (x + 2))), CONSTANT),
    (lambda x: 2 - x, f"{CONSTANT} The sign is wrong too."),
    (np.degrees, "It is 180 / pi times too large: degrees in place of radians?"),
    (lambda x: x + x**2, None),
]


@pytest.mark.parametrize(("angle", "says"), ANGLES)
def test_angles_may_be_turned_or_start_elsewhere(angle, says):
    def phases(give):
        phi = np.linspace(-3, 3, 40)
        yield give(phi), phi

    told = of_function(angle, "give(x)", phases, period=2 * np.pi, unit="rad")
    assert told == (says and f"Your function returns something else. {says}")
