"""Exercises that check themselves: ``check("2.1", answer)``.

The checkers of chapter c live in ``fpputil.exercises.chapter<c>``; each computes its expected
answer from the library.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Exercise:
    """A checker, which returns True for a right answer, and the hint shown for a wrong one."""

    accepts: Callable[[object], bool]
    hint: str


EXERCISES: dict[str, Exercise] = {}


def exercise(key: str, hint: str):
    """Decorator: register a checker under a key such as "2.1"."""

    def register(accepts):
        EXERCISES[key] = Exercise(accepts, hint)
        return accepts

    return register


def check(key: str, answer) -> bool:
    """Say whether an answer to an exercise is right, and give a hint if it is not.

    Parameters
    ----------
    key : str
        Chapter and number, such as "2.1".
    answer : object
        What the exercise asks for: a number, an array or a function.

    Returns
    -------
    bool

    Raises
    ------
    ValueError
        If there is no such exercise.
    """
    right = accepts(key, answer)
    digits = " Numbers need four digits." if isinstance(answer, float) else ""
    hint = f"not yet. {_find(key).hint}{digits}"
    print(f"Exercise {key}: {'right.' if right else hint}")
    return right


def accepts(key: str, answer) -> bool:
    """Whether an answer is right; an answer of the wrong kind is simply not."""
    test = _find(key).accepts
    try:
        return bool(test(answer))
    except (TypeError, ValueError, AttributeError, LookupError, ArithmeticError):
        return False


def close(answer, expected, atol: float = 0.0, rtol: float = 1e-3) -> bool:
    """True if numbers or arrays agree in shape and value; NaN equals NaN."""
    answer, expected = np.asarray(answer, np.float64), np.asarray(expected, np.float64)
    return answer.shape == expected.shape and np.allclose(
        answer, expected, rtol=rtol, atol=atol, equal_nan=True
    )


def _find(key: str) -> Exercise:
    chapter = str(key).split(".")[0]
    if chapter.isdigit():
        try:
            importlib.import_module(f"{__name__}.chapter{chapter}")
        except ModuleNotFoundError:
            pass
    if key not in EXERCISES:
        raise ValueError(f"exercise {key!r} given; no chapter has one of that number")
    return EXERCISES[key]
