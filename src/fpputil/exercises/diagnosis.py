"""What is wrong with a value: one table of likely faults for each expected number.

Tolerance, the same for every number of every exercise: a number is right if it is the expected one
rounded to four significant digits, or nearer; of several numbers, the largest has the four digits
and the others as many decimals. A whole number is exact.

A table is a list of rows (values, tolerance, what it means). An answer means what the first row
says that it agrees with; the first row of all is the right answer. `check` reads the table in a
notebook, ``exercises.js`` on a page.
"""

from __future__ import annotations

import inspect
import itertools
import math
import traceback

import numpy as np

DIGITS = 4
NEARLY = "Right as far as it goes; give four digits, rounded."
NOT_WHOLE = "A whole number is wanted."
CLOSE = "It is close, but not right to four digits: rounded on the way, or a small term left out?"
SIGN = "The size is right, the sign is wrong."
LARGE, SMALL = "It is far too large.", "It is far too small."
SMALL_WHOLE = 20  # of a whole number below it no more is told than these two
TOO_LARGE, TOO_SMALL = "It is too large.", "It is too small."
TO_WHOLE = "It is rounded to whole numbers."
ROUNDED = "It is rounded: return all digits."
CONSTANT = "It is right up to a constant."
FACTORS = (  # times the right one, and what it may be
    (100, "It is 100 times too large."),
    (1 / 100, "It is 100 times too small."),
    (1000, "It is 1000 times too large: look at the units."),
    (1 / 1000, "It is 1000 times too small: look at the units."),
    (10, "It is 10 times too large."),
    (1 / 10, "It is 10 times too small."),
    (180 / math.pi, "It is 180 / pi times too large: degrees in place of radians?"),
    (math.pi / 180, "It is 180 / pi times too small: radians in place of degrees?"),
    (2 * math.pi, "It is 2 pi times too large."),
    (1 / (2 * math.pi), "It is 2 pi times too small."),
    (2, "It is twice the right one."),
    (1 / 2, "It is half the right one."),
)
PER_CENT = {  # what it may be instead where the unit is none, or per cent
    ("", 100): "It is 100 times too large: per cent in place of a share?",
    ("%", 1 / 100): "It is 100 times too small: a share in place of per cent?",
}
PLACES = ("the first", "the second", "the third", "the fourth")


def table(expected, unit: str = "", last: float | None = None) -> list[tuple]:
    """List right and likely wrong answers, each with what it means.

    Parameters
    ----------
    expected : number or array
        The right answer; integers are exact.
    unit : str
        "rad" and "px" have faults of their own: whole turns, half pixels. A share has
        none, and "%" is per cent.
    last : float, optional
        What one in the fourth digit is, where `expected` is one of several numbers.

    Returns
    -------
    list of (values, tolerance, meaning)
        The meaning of the right answer is "".

    Examples
    --------
    >>> table(13)[:2]
    [(array(13), 0.0, ''), (array(-13), 0.0, 'The size is right, the sign is wrong.')]
    """
    e = np.asarray(expected)
    whole = e.dtype.kind in "iu"
    e = e if whole else e.astype(float)
    last = last or unit_of_digit(e, DIGITS)
    near = 0.0 if whole else 5 * last  # a fault is told to three digits
    rows = [(e, 0.0 if whole else last / 2, "")]

    def likely(values, says, tolerance=near):
        rows.append((np.asarray(values), tolerance, says))

    if not whole:  # at least two digits; fewer than three only if they are rounded
        for step, roundings in (
            (last, (np.rint, np.trunc)),
            (10 * last, (np.rint, np.trunc)),
            (100 * last, (np.rint,)),
        ):
            if step < 2 * unit_of_digit(e, 2):
                for rounding in roundings:
                    likely(rounding(e / step * (1 + 1e-12)) * step, NEARLY, 1e-9 * step)
    if np.max(np.abs(e), initial=0) > last / 2:
        likely(-e, SIGN)
    few = e.ndim == 1 and len(e) <= len(PLACES) and not whole
    for order in list(itertools.permutations(e))[1:] if few else [e[::-1]] if e.ndim else []:
        if np.abs(order - e).max() > near:
            likely(order, "The values are right, their order is not.")
    if whole and np.max(np.abs(e), initial=0) < SMALL_WHOLE:
        return rows
    if whole:
        likely(e + 1, "It is one too many.")
        likely(e - 1, "It is one too few.")
    if unit == "px":
        for half in (0.5, -0.5):
            likely(e + half, "It is half a pixel off: pixel centres are whole numbers.", last / 2)
    if e.ndim > 1 and e.T.shape == e.shape:
        likely(e.T, "The axes are swapped.")
    if unit == "rad":
        for turns in (1, -1, 2, -2, 3, -3):
            likely(e + turns * 2 * math.pi, "It is off by a multiple of 2 pi.")
    simple = np.max(np.abs(e), initial=0) < SMALL_WHOLE and np.allclose(e, np.rint(e), atol=1e-9)
    for factor, says in FACTORS if e.any() else ():
        if simple and factor in (2, 1 / 2):
            continue  # would give it away, as with whole numbers
        says = says if whole else PER_CENT.get((unit, factor), says)
        near_it = 5 * unit_of_digit(factor * e, DIGITS)
        likely(factor * e, says, near_it)
        likely(-factor * e, f"{says} The sign is wrong too.", near_it)
    if e.all() and np.all(np.abs(np.abs(e) - 1) > 0.05):  # powers of 1 are 1
        for values, says in (
            (1 / e, "It is upside down: that is the reciprocal."),
            (e.astype(float) ** 2, "It is the square of the right one."),
            (np.sqrt(np.abs(e)), "It is the root of the right one."),
        ):
            likely(values, says, 5 * unit_of_digit(values, DIGITS))
    if not whole:
        likely(e, CLOSE)
    elif abs(e).max() >= 1000:
        likely(e, "It is close, but a whole number must be exact.", 1e-3 * abs(e).max())
    return rows


def unit_of_digit(values, digits: int) -> float:
    """One in the last of so many significant digits of the largest value.

    >>> unit_of_digit(97.92, 4)
    0.01
    """
    largest = float(np.max(np.abs(values), initial=0))
    return 10.0 ** (math.floor(math.log10(largest or 1)) - digits + 1)


def read_off(answer, rows) -> str | None:
    """Say what an array of the right shape means: "" if it is right, None if nobody knows."""
    for values, tolerance, says in rows:
        if np.all(np.abs(answer - values) <= tolerance * (1 + 1e-9)):
            return says
    expected, size = rows[0][0], np.max(np.abs(answer), initial=0)
    whole = expected.dtype.kind in "iu"
    if whole and np.any(answer != np.rint(answer)):
        return NOT_WHOLE
    largest = np.max(np.abs(expected), initial=0)
    if whole and expected.ndim == 0 and largest < SMALL_WHOLE:
        return TOO_LARGE if answer > expected else TOO_SMALL
    return LARGE if size > 10 * largest > 0 else SMALL if 10 * size < largest else None


def of_number(answer, expected, unit: str = "") -> str | None:
    """Say what is wrong with numbers.

    Parameters
    ----------
    answer : object
        Whatever was given.
    expected : bool, number or array
        The right answer.
    unit : str
        As in `table`.

    Returns
    -------
    str or None
        "" if they are right, None if the fault is unknown.

    Examples
    --------
    >>> of_number(63.43, 1.1071, "rad")
    'It is 180 / pi times too large: degrees in place of radians?'
    >>> of_number(1.11, 1.1071)
    'Right as far as it goes; give four digits, rounded.'
    >>> of_number((351.8, -223.3), (351.82, 223.34))
    'Only the second is wrong. The size is right, the sign is wrong.'
    >>> of_number([[1, 2, 3]], [1, 2, 3])
    'The shape (1, 3) given; 3 numbers wanted.'
    """
    if isinstance(expected, bool):
        if not isinstance(answer, (bool, np.bool_)):
            return f"{kind(answer)} given; True or False wanted."
        return "" if answer == expected else f"It is {answer} where {expected} is right."
    e = np.asarray(expected)
    if (a := as_floats(answer)) is None:
        return f"{kind(answer)} given; {amount(e.shape)} wanted."
    if a.shape != e.shape:
        swapped = ": the axes are swapped" if e.ndim > 1 and a.T.shape == e.shape else ""
        given = amount(a.shape)
        return f"{given[0].upper()}{given[1:]} given; {amount(e.shape)} wanted{swapped}."
    if np.any(bad := ~np.isfinite(a)):
        return f"NaN or infinity given{where(bad)}; numbers wanted."
    says = read_off(a, table(e, unit))
    if e.ndim and says in (None, NOT_WHOLE, LARGE, SMALL):
        few = len(e) <= len(PLACES)
        return _of_few(a, parts(e, unit), says) if few else _of_many(a, e) or says
    return says


def as_floats(answer) -> np.ndarray | None:
    """An array of numbers; None if the answer is something else."""
    try:
        a = np.asarray(answer)
        return None if a.dtype.kind not in "iufbO" or answer is None else a.astype(float)
    except (TypeError, ValueError, AttributeError, RuntimeError, OverflowError):
        return None


def of_function(answer, form: str, cases, period: float = 0.0, unit: str = "") -> str | None:
    """Say what is wrong with a function, which is run.

    Parameters
    ----------
    answer : object
        Whatever was given.
    form : str
        What is asked for, as "pattern(pitch, steps, width)".
    cases : callable
        Takes the function and yields pairs: what it returned, what is right.
    period : float
        Results that differ by a multiple of it are the same; 0 if none are.
    unit : str
        Of what is returned, as in `table`.

    Returns
    -------
    str or None
        As `of_number`.

    Examples
    --------
    >>> def cases(double):
    ...     yield double(3.0), 6.0
    >>> of_function(lambda x: 2 * x, "double(x)", cases)
    ''
    >>> of_function(lambda x: -2 * x, "double(x)", cases)
    'Your function returns something else. The size is right, the sign is wrong.'
    >>> of_function(6.0, "double(x)", cases)
    'An object of type float given; a function double(x) wanted: its name, without a call.'
    >>> of_function(lambda x, y: x * y, "double(x)", cases)
    'Your function is called as double(x); it takes (x, y).'
    >>> of_function(lambda x: x / 0, "double(x)", cases)
    'Your function raises ZeroDivisionError in its line 1: float division by zero.'
    """
    if not callable(answer):
        return f"{kind(answer)} given; a function {form} wanted: its name, without a call."
    if (takes := _other_arguments(answer, form.count(",") + 1)) is not None:
        return f"Your function is called as {form}; it takes {takes}."
    try:
        for found, expected in cases(answer):
            if found is None:
                return "Your function returns nothing: where is its return?"
            says = of_number(found, expected, unit)
            if says != "" and not isinstance(expected, bool):
                says = _of_returned(as_floats(found), np.asarray(expected, float), period, says)
            if says:
                return f"Your function returns something else. {says}"
            if says is None:
                return None
    except Exception as error:  # whatever it is, the reader is told
        return _raised(error, answer)
    return ""


def _of_returned(found, e, period: float, says: str | None) -> str | None:
    """Say what only shows where a function was run: rounding, and a constant added to angles."""
    if found is None or found.shape != e.shape:
        return says
    off = np.abs(found - e).max()
    if found.ndim and np.abs(e).max() > 1 > off and np.all(found == np.rint(found)):
        return TO_WHOLE if np.any(e != np.rint(e)) else says
    if says == NEARLY:
        return ROUNDED
    for sign, turned in ((1, False), (-1, True)) if period else ():
        turns = (found - sign * e) / period
        offset = np.angle(np.exp(2j * np.pi * turns).mean()) / (2 * np.pi)
        if np.abs(turns - offset - np.rint(turns - offset)).max() < 1e-4:
            if abs(offset) < 1e-4:
                return SIGN if turned else ""
            if found.ndim:
                return f"{CONSTANT} The sign is wrong too." if turned else CONSTANT
    return says


def _other_arguments(function, number: int) -> str | None:
    """The arguments of a function that cannot be called with so many, else None."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # some functions in C have none
        return None
    try:
        signature.bind(*range(number))
    except TypeError:
        return str(signature)
    return None


def _raised(error: Exception, function) -> str:
    says = f"{type(error).__name__}{{}}: {error}".rstrip(": ")
    code = getattr(function, "__code__", None)
    lines = [
        line - code.co_firstlineno + 1
        for frame, line in traceback.walk_tb(error.__traceback__)
        if frame.f_code is code
    ]
    if not lines:
        return f"What your function returns cannot be used. {says.format('')}."
    return f"Your function raises {says.format(f' in its line {lines[-1]}')}."


def amount(shape: tuple) -> str:
    """A shape in words.

    >>> amount((2,))
    '2 numbers'
    """
    if len(shape) < 2:
        return {(): "a number", (1,): "an array of one number"}.get(shape) or f"{shape[0]} numbers"
    return f"the shape {shape}"


def where(bad) -> str:
    return f" at {bad.sum()} of {bad.size} places" if bad.ndim else ""


def kind(answer) -> str:
    """What a reader sees of a thing that is no number."""
    if answer is None:
        return "None"
    if isinstance(answer, str):
        return f"The text {answer[:40]!r}"
    return "A function" if callable(answer) else f"An object of type {type(answer).__name__}"


def parts(expected, unit: str = "") -> list:
    """A table for each of a few numbers."""
    return [table(e, unit, unit_of_digit(expected, DIGITS)) for e in np.asarray(expected)]


def _of_few(answer, tables, says: str | None) -> str | None:
    """Name those that are wrong, and their fault if they have the same."""
    each = [read_off(a, rows) for a, rows in zip(answer, tables, strict=True)]
    wrong = {PLACES[k]: fault for k, fault in enumerate(each) if fault not in ("", NEARLY)}
    if not wrong:
        return NEARLY
    *others, last = wrong
    fault = wrong[last] if len(set(wrong.values())) == 1 else None
    if not others:
        return f"Only {last} is wrong. {fault or ''}".rstrip()
    if len(wrong) == len(each):
        fault = fault or says
    which = f"{', '.join(others)} and {last} are wrong."
    return f"{which[0].upper()}{which[1:]} {fault or ''}".rstrip()


def _of_many(answer, expected) -> str | None:
    wrong = np.abs(answer - expected) > unit_of_digit(expected, DIGITS) / 2
    first = tuple(map(int, np.argwhere(wrong)[0]))
    return None if wrong.all() else f"It is wrong{where(wrong)}, first at index {first}."
