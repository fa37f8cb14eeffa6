"""Answers to the exercises of chapter 6: right ones, and typical misconceptions."""

import numpy as np


def _meet(u, v, column, system, swap=False, as_row=False, negative=False):
    C, P = system.camera.P, system.projector.P
    u, v = (v, u) if swap else (u, v)
    light = P[1] if as_row else P[0]
    rows = np.stack([u * C[2] - C[0], v * C[2] - C[1], column * P[2] - light])
    return np.linalg.solve(rows[:, :3], rows[:, 3] if negative else -rows[:, 3])


RIGHT = {
    "6.1": 1.753,
    "6.2": _meet,
    "6.3": 1.363,
    "6.4": 4,
    "6.5": 1.516,
}

WRONG = [
    ("6.1", 1.7528 * 2 * np.pi, "forgot 2 pi"),
    ("6.1", 1.7528 * 10, "of a whole radian"),
    ("6.1", 1.7528 * 15 / 24, "pitch of the paper preset"),
    ("6.1", 1 / 1.7528, "upside down"),
    ("6.2", lambda *a: _meet(*a, swap=True), "u and v swapped"),
    ("6.2", lambda *a: _meet(*a, as_row=True), "the projector's row"),
    ("6.2", lambda *a: _meet(*a, negative=True), "sign flipped"),
    ("6.2", lambda *a: _meet(*a)[2], "the depth alone"),
    ("6.3", 1.3628 * np.sqrt(2 / 15), "averaging over the steps forgotten"),
    ("6.3", 1.3628 * 2 / 15, "the root inverted"),
    ("6.3", 1.3628 / (2 * np.pi), "forgot 2 pi"),
    ("6.3", 1.3628 / 60, "modulation forgotten"),
    ("6.4", 3, "one too low"),
    ("6.4", 5, "number of coefficients instead of the degree"),
    ("6.4", 2, "0.01 mm read as 0.1 mm"),
    ("6.5", -1.5156, "sign flipped"),
    ("6.5", 1.5156 * 10, "2 % instead of 0.2 %"),
    ("6.5", -660 * 0.002, "depth scaled by the focal length"),
]
