"""Each checker accepts a right answer to three digits and rejects three typical wrong ones."""

import runpy
from collections import Counter
from pathlib import Path

import pytest

from fpputil import exercises

FILES = sorted(Path(__file__).parent.glob("answers_*.py"))
CHAPTERS = [runpy.run_path(str(file)) for file in FILES]
RIGHT = {key: answer for chapter in CHAPTERS for key, answer in chapter["RIGHT"].items()}
WRONG = [case for chapter in CHAPTERS for case in chapter["WRONG"]]


@pytest.mark.parametrize("key", RIGHT)
def test_right(key):
    assert exercises.accepts(key, RIGHT[key])


@pytest.mark.parametrize(
    ("key", "answer", "why"), WRONG, ids=[f"{key}-{why}" for key, _, why in WRONG]
)
def test_wrong(key, answer, why):
    assert not exercises.accepts(key, answer), why


def test_every_exercise_has_three_wrong_answers():
    counts = Counter(key for key, _, _ in WRONG)
    assert set(exercises.EXERCISES) == set(RIGHT) == set(counts)
    assert min(counts.values()) >= 3
