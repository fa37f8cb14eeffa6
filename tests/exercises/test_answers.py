"""Each exercise accepts a right answer, refuses typical wrong ones, and says what is wrong."""

import math
import runpy
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from fpputil.exercises import EXERCISES, find
from fpputil.exercises.diagnosis import NEARLY, NOT_WHOLE, SMALL_WHOLE, TOO_LARGE, TOO_SMALL

FILES = sorted(Path(__file__).parent.glob("answers_*.py"))
CHAPTERS = [runpy.run_path(str(file)) for file in FILES]
RIGHT = {key: answer for chapter in CHAPTERS for key, answer in chapter["RIGHT"].items()}
WRONG = [case for chapter in CHAPTERS for case in chapter["WRONG"]]
NUMBERS = [key for key in RIGHT if not find(key).form]


@pytest.mark.parametrize("key", RIGHT)
def test_right(key):
    assert find(key).diagnose(RIGHT[key]) == ""


@pytest.mark.parametrize(
    ("key", "answer", "why"), WRONG, ids=[f"{key}-{why}" for key, _, why in WRONG]
)
def test_wrong(key, answer, why):
    assert find(key).diagnose(answer) != "", why


def test_every_exercise_has_three_wrong_answers():
    counts = Counter(key for key, _, _ in WRONG)
    assert set(EXERCISES) == set(RIGHT) == set(counts)
    assert min(counts.values()) >= 3


def digits(values, number):
    step = 10.0 ** (math.floor(math.log10(np.abs(values).max())) + 1 - number)
    return np.rint(values / step) * step


GENERIC = {
    "sign": (lambda e: -e, "The size is right, the sign is wrong."),
    "per cent": (lambda e: 100 * e, "It is 100 times too large: per cent in place of a share?"),
    "hundred": (lambda e: 100 * e, "It is 100 times too large."),
    "metres": (lambda e: e / 1000, "It is 1000 times too small: look at the units."),
    "degrees": (np.degrees, "It is 180 / pi times too large: degrees in place of radians?"),
    "twice, and the sign": (lambda e: -2 * e, "It is twice the right one. The sign is wrong too."),
    "reciprocal": (lambda e: 1 / e, "It is upside down: that is the reciprocal."),
    "too few": (lambda e: e - 1, "It is one too few."),
    "too many": (lambda e: e + 1, "It is one too many."),
    "turned": (lambda e: e + 2 * np.pi, "It is off by a multiple of 2 pi."),
    "order": (lambda e: e[::-1], "The values are right, their order is not."),
    "digits": (lambda e: digits(e, 3), NEARLY),
}


@pytest.mark.parametrize("fault", GENERIC)
@pytest.mark.parametrize("key", NUMBERS)
def test_faults_of_every_number(key, fault):
    """What is told is true for the very numbers of the book: no fault looks like another."""
    change, says = GENERIC[fault]
    exercise = find(key)
    expected = np.asarray(exercise.expected)
    whole = expected.dtype.kind in "iu"
    if (
        (whole and fault in ("degrees", "digits", "reciprocal"))
        or (not whole and fault.startswith("too"))
        or (exercise.unit != "rad" and fault == "turned")
        or fault == ("per cent" if exercise.unit or whole else "hundred")
        or (expected.ndim == 0 and fault == "order")
        or (not expected.all() and fault == "reciprocal")
        or (key == "1.1" and fault.startswith("twice"))  # -3 would be given away
    ):
        return
    wrong = change(expected)
    if np.allclose(wrong, expected, rtol=1e-4, atol=0):
        return  # -3, 14.25 and 1200 have three digits and no more
    if whole and np.abs(expected).max() < SMALL_WHOLE and fault not in ("sign", "order"):
        says = TOO_LARGE if wrong.max() > expected.max() else TOO_SMALL  # gives nothing away
        says = says if np.all(wrong == np.rint(wrong)) else NOT_WHOLE
        if expected.ndim:
            assert exercise.diagnose(wrong).endswith(f" are wrong. {says}")
            return
    assert exercise.diagnose(wrong) == says


@pytest.mark.parametrize("key", NUMBERS)
def test_four_digits_are_right_for_every_number(key):
    expected = np.asarray(find(key).expected)
    if expected.dtype.kind not in "iu":
        assert find(key).diagnose(digits(expected, 4)) == ""
        largest = np.abs(expected).max()
        assert find(key).diagnose(expected + 1.5e-3 * largest) != ""
