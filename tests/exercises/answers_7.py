"""Answers to the exercises of chapter 7: right ones, and typical misconceptions."""

import numpy as np


def _leaks(models, splits):
    return len(set(zip(models, splits, strict=True))) > len(set(models))


def _target(column, pitch, sign=-1, outside=0.0, swapped=False):
    phi = 2 * np.pi * column / pitch
    M, D = sign * np.sin(phi), np.cos(phi)
    return np.nan_to_num(np.stack([D, M] if swapped else [M, D]), nan=outside)


NOISE = 0.01765

RIGHT = {
    "7.1": 277 * 36,
    "7.2": _leaks,
    "7.3": 0.03113,
    "7.4": _target,
    "7.5": NOISE,
}

WRONG = [
    ("7.1", 347 * 36, "all of them"),
    ("7.1", 312 * 36, "9:1"),
    ("7.1", 0.8 * 347 * 36, "parts of a model"),
    ("7.1", 277, "models, not views"),
    ("7.2", lambda m, s: not _leaks(m, s), "the other way round"),
    ("7.2", lambda m, s: len(set(s)) > 1, "more than one split at all"),
    ("7.2", lambda m, s: len(set(m)) < len(m), "a model with several views"),
    ("7.2", True, "no function"),
    ("7.3", 0.06226, "a whole step"),
    ("7.3", 0.01556, "a step too fine"),
    ("7.3", 2**-12, "not in grey levels"),
    ("7.4", lambda c, p: _target(c, p, sign=1), "M without its minus"),
    ("7.4", lambda c, p: _target(c, p, outside=np.nan), "NaN left outside"),
    ("7.4", lambda c, p: _target(np.nan_to_num(c), p), "D = 1 outside"),
    ("7.4", lambda c, p: _target(c, p, swapped=True), "M and D swapped"),
    ("7.5", NOISE / 4, "noise 1"),
    ("7.5", NOISE * 24 / 6.2832, "in columns"),
    ("7.5", NOISE * 5**0.5, "three steps"),
]
