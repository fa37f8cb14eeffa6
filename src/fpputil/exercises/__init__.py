"""Exercises that check themselves: ``check("2.1", answer)``.

The exercises of chapter c live in ``fpputil.exercises.chapter<c>``. Each computes its right answer
from the library and has hints, the formula last; what is wrong with an answer is found for all of
them in one place, `fpputil.exercises.diagnosis`.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from fpputil.exercises import diagnosis


@dataclass(frozen=True)
class Exercise:
    """What an exercise asks for: a number or numbers, or a function of a given form."""

    solve: Callable
    hints: tuple[str, ...]
    unit: str = ""
    form: str = ""
    period: float = 0.0

    @cached_property
    def expected(self):
        """The right number, computed once."""
        return self.solve()

    def diagnose(self, answer) -> str | None:
        """Say what is wrong with an answer: "" if nothing is, None if nobody knows."""
        if self.form:
            return diagnosis.of_function(answer, self.form, self.solve, self.period, self.unit)
        return diagnosis.of_number(answer, self.expected, self.unit)


EXERCISES: dict[str, Exercise] = {}
_WRONG: Counter[str] = Counter()  # answers in a row, by exercise


def exercise(key: str, *hints: str, unit: str = "", period: float = 0.0):
    """Decorator: register an exercise.

    A function without arguments returns the right number or numbers. One that has an argument is
    given the reader's function, calls it, and yields pairs: what it returned, and what is right;
    its docstring says how the reader's function is called.

    Parameters
    ----------
    key : str
        Such as "2.1".
    hints : str
        From the first push to the formula.
    unit : str
        Of the numbers: "rad", "px", "mm"; "" for none.
    period : float
        Results of a function that differ by a multiple of it are the same.
    """

    def register(solve):
        form = (inspect.getdoc(solve) or "") if inspect.signature(solve).parameters else ""
        EXERCISES[key] = Exercise(solve, hints, unit, form, period)
        return solve

    return register


def check(key: str, answer) -> None:
    """Say whether an answer is right, and if it is not, why; a hint more from time to time.

    The first wrong answer is told what is wrong with it, each further one gets the next hint.
    Numbers need four digits.

    Parameters
    ----------
    key : str
        Chapter and number, such as "2.1".
    answer : object
        What the exercise asks for: a number, several, or a function.

    Raises
    ------
    ValueError
        If there is no such exercise.

    Examples
    --------
    >>> check("3.1", -1.107)
    Exercise 3.1: not yet. The size is right, the sign is wrong.
    >>> check("3.1", 63.43)
    Exercise 3.1: not yet. It is 180 / pi times too large: degrees in place of radians?
    Hint 1 of 2: with four steps the sines and cosines are 0, 1 and -1.
    >>> check("3.1", 1.107)
    Exercise 3.1: right.
    """
    exercise = find(key)
    says = exercise.diagnose(answer)
    if says == "":
        del _WRONG[str(key)]
        print(f"Exercise {key}: right.")
    elif says == diagnosis.NEARLY:
        print(f"Exercise {key}: {says}")
    else:
        print(f"Exercise {key}: not yet. {says or ''}".rstrip())
        if number := min(_WRONG[str(key)], len(exercise.hints)):
            print(f"Hint {number} of {len(exercise.hints)}: {exercise.hints[number - 1]}")
        _WRONG[str(key)] += 1


def reset() -> None:
    """Forget all wrong answers: the hints begin again."""
    _WRONG.clear()


def find(key: str) -> Exercise:
    """Look an exercise up by its number.

    Raises
    ------
    ValueError
        If there is none of that number; the message says which there are.
    """
    chapters = sorted(
        int(module.name.removeprefix("chapter"))
        for module in pkgutil.iter_modules(__path__)
        if module.name.startswith("chapter")
    )
    chapter = str(key).split(".")[0]
    if chapter not in map(str, chapters):
        raise ValueError(f"exercise {key} given; chapters 1 to {chapters[-1]} have exercises")
    importlib.import_module(f"{__name__}.chapter{chapter}")
    if str(key) not in EXERCISES:
        there = ", ".join(k for k in EXERCISES if k.split(".")[0] == chapter)
        raise ValueError(f"exercise {key} given; chapter {chapter} has {there}")
    return EXERCISES[str(key)]
