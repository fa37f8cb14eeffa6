"""Answers to the exercises of chapter 11: right ones, and typical misconceptions."""

import numpy as np


def _tau(a, b):
    i, j = np.triu_indices(len(a), 1)
    return np.mean(np.sign(a[i] - a[j]) * np.sign(b[i] - b[j]))


def _spearman(a, b):
    return np.corrcoef(np.argsort(np.argsort(a)), np.argsort(np.argsort(b)))[0, 1]


def _slopes(found, true):
    return np.sum(np.diff(found) ** 2) / np.sum(np.diff(true) ** 2)


def _sharpness(found, true):
    return np.linalg.lstsq(np.diff(true, 2)[:, None], np.diff(found, 2), rcond=None)[0][0]


RIGHT = {
    "11.1": _tau,
    "11.2": lambda I0, I1, A: np.angle((I0 - A) + 1j * (A - I1)),
    "11.3": _sharpness,
    "11.4": 20 / 36,
}

WRONG = [
    ("11.1", _spearman, "Spearman's"),
    ("11.1", lambda a, b: (_tau(a, b) + 1) / 2, "share in the same order"),
    ("11.1", lambda a, b: np.corrcoef(a, b)[0, 1], "Pearson's"),
    ("11.2", lambda I0, I1, A: np.arctan2(I1 - A, I0 - A), "the sign"),
    ("11.2", lambda I0, I1, A: np.arctan2(I0 - A, A - I1), "swapped"),
    ("11.2", lambda I0, I1, A: np.arctan((A - I1) / (I0 - A)), "half the range"),
    ("11.2", lambda I0, I1, A: np.arctan2(-I1, I0), "background left in"),
    ("11.3", lambda found, true: np.diff(found, 2).std() / np.diff(true, 2).std(), "of sizes"),
    ("11.3", lambda found, true: _sharpness(true, found), "the other way round"),
    (
        "11.3",
        lambda found, true: np.sum(np.diff(found) ** 2) / np.sum(np.diff(true) ** 2),
        "slopes",
    ),
    ("11.4", 0.5, "p = 0.075"),
    ("11.4", 16 / 36, "one-sided"),
    ("11.4", 0.6667, "Spearman's"),
]
