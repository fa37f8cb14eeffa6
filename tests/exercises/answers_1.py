"""Answers to the exercises of chapter 1: right ones, and typical misconceptions."""

import numpy as np


def _pattern(pitch, steps, width, sign=1, first=0, white=255, degrees=False):
    n, i = np.arange(steps)[:, None] + first, np.arange(width)
    turn = 360 if degrees else 2 * np.pi
    return white / 2 * (1 + np.cos(turn * i / pitch + sign * turn * n / steps))


RIGHT = {
    "1.1": -3,
    "1.2": 18.75,
    "1.3": _pattern,
    "1.4": 2.811,
    "1.5": 0.2105,
}

WRONG = [
    ("1.1", 3, "to the right"),
    ("1.1", -24, "a whole pitch"),
    ("1.1", -2 * np.pi / 8, "radians for columns"),
    ("1.2", 15, "the same pitch"),
    ("1.2", 15 * 912 / 1140, "upside down"),
    ("1.2", 912 / 15, "the periods, not the pitch"),
    ("1.2", 19, "rounded to whole pixels"),
    ("1.3", lambda p, n, w: _pattern(p, n, w, sign=-1), "shift subtracted"),
    ("1.3", lambda p, n, w: _pattern(p, n, w, first=1), "steps counted from 1"),
    ("1.3", lambda p, n, w: _pattern(p, n, w, degrees=True), "degrees"),
    ("1.3", lambda p, n, w: _pattern(p, n, w, white=256), "white is 256"),
    ("1.3", lambda p, n, w: np.rint(_pattern(p, n, w)), "rounded"),
    ("1.3", lambda p, n, w: _pattern(p, n, w).T, "axes swapped"),
    ("1.4", 15 * np.sqrt(np.log(2)) / np.pi, "forgot the 2"),
    ("1.4", 15 * np.log(2) / (2 * np.pi**2), "forgot the root"),
    ("1.4", 15 / (np.sqrt(2) * np.pi), "1/e instead of 1/2"),
    ("1.5", 0.8 / 1.8, "(gamma - 1) / gamma"),
    ("1.5", (0.8 / 3.8) ** 2, "power instead of amplitude"),
    ("1.5", 3.8 / 0.8, "upside down"),
]
