"""Checks of input that every room shares: numbers, the structure of JSON, and limits of size."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from functools import partial
from numbers import Integral, Real
from pathlib import Path

import numpy as np

MOST = {"FPP_MOST_PIXELS": 2**28, "FPP_MOST_PHOTOGRAPHS": 2**14}
"""Pixels of a picture (a camera of 151 megapixels has 2**27.2), and photographs of a capture.

More is taken for a slip or a damaged file and refused before memory is; an environment variable of
the same name sets another limit.
"""


def _printed(value) -> str:
    """The value as both lines of NumPy print it, or its beginning."""
    text = repr(value.item() if isinstance(value, np.generic) else value)
    return text if len(text) <= 200 else f"{text[:200]}..."


def one_line(error: BaseException) -> str:
    """What an error says, in one line."""
    return " ".join(str(error).split()) or type(error).__name__


def _is_number(value, least: float) -> bool:
    real = type(value) is float or (isinstance(value, Real) and not isinstance(value, bool))
    return real and least <= value <= sys.float_info.max  # of whole numbers, too


def positive(name: str, value, unit: str = "") -> float:
    """The value as a float; ValueError unless it is a finite number above 0."""
    if not (_is_number(value, 0) and value > 0):
        of = f" of {unit}" if unit else ""
        raise ValueError(f"{name} {_printed(value)} given; a positive number{of} is needed")
    return float(value)


def not_negative(name: str, value, unit: str = "") -> float:
    """The value as a float; ValueError unless it is a finite number of 0 or more."""
    if not _is_number(value, 0):
        of = f" of {unit}" if unit else ""
        raise ValueError(f"{name} {_printed(value)} given; a number{of}, 0 or more, is needed")
    return float(value)


def finite(name: str, value) -> float:
    """The value as a float; ValueError unless it is a finite number."""
    if not _is_number(value, -sys.float_info.max):
        raise ValueError(f"{name} {_printed(value)} given; a finite number is needed")
    return float(value)


def whole(name: str, value, least: int, most: float = float("inf")) -> int:
    """The value as an int; ValueError unless it is a whole number from `least` to `most`."""
    is_whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not (is_whole and least <= value <= most):
        reach = f"of {least} or more" if most == float("inf") else f"from {least} to {most}"
        raise ValueError(f"{name} {_printed(value)} given; a whole number {reach} is needed")
    return int(value)


def text(name: str, value) -> str:
    """The value; ValueError unless it is a string."""
    if not isinstance(value, str):
        raise ValueError(f"{name} {_printed(value)} given; a text is needed")
    return value


def at_most(name: str, value: int, limit: str) -> None:
    """ValueError if a number of pixels or photographs is above its limit, a name in `MOST`."""
    most = os.environ.get(limit, str(MOST[limit]))
    if not most.isdecimal():
        raise ValueError(f"{limit} {most!r} found in the environment; a whole number is needed")
    if value > int(most):
        raise ValueError(
            f"{name} {value} given; more than {most} are refused, unless the environment variable "
            f"{limit} says otherwise"
        )


natural, one_or_more = partial(whole, least=0), partial(whole, least=1)

Form = Callable | list | tuple | dict


def anything(name: str, value) -> None:
    """The form of an entry that nobody asks for."""


def or_null(form: Form) -> Form:
    """The form of what has another form, or is null."""
    return lambda name, value: value is None or conform(name, value, form)


def conform(name: str, value, form: Form) -> None:
    """ValueError unless a value out of JSON has a form, which names the entry that has not.

    A form is a function of name and value that raises; ``[form]``, a list of any length; a tuple
    of forms, a list of as many; or a dict, a table of these entries, where ``...`` stands for all
    others.

    >>> conform("scene", {"pitches": [24, 114], "x": 1}, {"pitches": [positive], ...: anything})
    >>> conform("scene", {"pitches": [24, "114"]}, {"pitches": [positive]})
    Traceback (most recent call last):
    ValueError: scene.pitches.1 '114' given; a positive number is needed
    """
    if callable(form):
        form(name, value)
        return
    if isinstance(form, dict):
        if not isinstance(value, dict):
            raise ValueError(f"{name} {_printed(value)} given; a table is needed")
        if lacking := [key for key in form if key is not ... and key not in value]:
            raise ValueError(f"no {_inside(name, lacking[0])}")
        if ... not in form and (unknown := [key for key in value if key not in form]):
            raise ValueError(f"{_inside(name, unknown[0])} is not known")
        entries = [(key, entry, form[key if key in form else ...]) for key, entry in value.items()]
    else:
        number = len(form) if isinstance(form, tuple) else None
        if not isinstance(value, list) or number not in (None, len(value)):
            needed = "a list" if number is None else f"a list of {number}"
            raise ValueError(f"{name} {_printed(value)} given; {needed} is needed")
        forms = form if number is not None else form * len(value)
        entries = [(k, entry, forms[k]) for k, entry in enumerate(value)]
    for key, entry, each in entries:
        if not callable(each):
            conform(_inside(name, key), entry, each)
            continue
        try:  # results hold a million numbers: no name is made for those that are right
            each("", entry)
        except ValueError:
            each(_inside(name, key), entry)


def _inside(name: str, key) -> str:
    return f"{name}.{key}" if name else str(key)


def parse_json(data: bytes | str, form: Form):
    """What JSON says; ValueError unless it is whole and has the form."""
    try:
        value = json.loads(data)
    except RecursionError:
        raise ValueError("lists inside of lists without end") from None
    conform("", value, form)
    return value


def read_json(path: Path, form: Form, kind: str):
    """What a JSON file says; ValueError that calls it no `kind` unless it has the form."""
    try:
        return parse_json(path.read_bytes(), form)
    except ValueError as error:
        raise ValueError(f"{path} is cut or no {kind} ({one_line(error)})") from error


def rotation_matrix(name: str, R) -> np.ndarray:
    """R as a (3, 3) float64 array; ValueError unless it is orthonormal with determinant +1."""
    R = np.asarray(R, np.float64)
    if R.shape != (3, 3):
        raise ValueError(f"{name} of shape {R.shape} given; a rotation is a (3, 3) matrix")
    turns = np.abs(R).max() < 2 and np.allclose(R @ R.T, np.eye(3), atol=1e-6)
    if not (turns and np.linalg.det(R) > 0):
        raise ValueError(f"{name} {R.tolist()} given; a rotation is orthonormal with det +1")
    return R


def seeded(seed) -> np.random.Generator:
    """A generator from a seed; ValueError unless the seed is a whole number of 0 or more."""
    return np.random.default_rng(whole("seed", seed, 0))
