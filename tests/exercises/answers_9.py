"""Answers to the exercises of chapter 9: right ones, and typical misconceptions."""

import numpy as np


def _loss(found, true):
    e = np.concatenate([found - true, (found - true)[:1]])
    return np.mean(np.diff(e, axis=0) ** 2)


RIGHT = {
    "9.1": 0.005855,
    "9.2": 147.95,
    "9.3": _loss,
    "9.4": (0.12649, 0.07303),
}

WRONG = [
    ("9.1", 0.002927, "one tail"),
    ("9.1", 3.6e-8, "twice the room"),
    ("9.1", 0.9941, "the right ones"),
    ("9.2", 468.0, "arithmetic mean"),
    ("9.2", 114.0, "the paper's"),
    ("9.2", 46.77, "harmonic mean"),
    ("9.3", lambda a, b: np.mean((np.diff(a, axis=0) - np.diff(b, axis=0)) ** 2), "not around"),
    ("9.3", lambda a, b: np.mean((a - b) ** 2), "photographs, not differences"),
    ("9.3", lambda a, b: np.sum((a - b - np.roll(a - b, 1, 0)) ** 2), "the sum"),
    ("9.4", (0.2, 0.2), "noise over modulation"),
    ("9.4", (0.08944, 0.05164), "sqrt(1 / N)"),
    ("9.4", (0.07303, 0.12649), "swapped"),
]
