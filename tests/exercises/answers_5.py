"""Answers to the exercises of chapter 5: right ones, and typical misconceptions."""

import numpy as np

PHI_Z = np.array([-3.0, -0.5, 0.5, 3.0])
PHI_MIN = np.array([1.0, -1.0, 7.0, 15.0])
TURNS = (PHI_MIN - PHI_Z) / (2 * np.pi)


def _target(phi_u, phi_t, ratio=114 / 304, sign=-1, unwrapped=True):
    Phi = phi_t
    if unwrapped:
        start = -np.pi / 912
        unit = phi_u - 2 * np.pi * np.floor((phi_u - start) / (2 * np.pi))
        Phi = phi_t + 2 * np.pi * np.round((8 * unit - phi_t) / (2 * np.pi))
    return sign * np.sin(ratio * Phi), np.cos(ratio * Phi)


RIGHT = {
    "5.1": [1, 0, 2, 2],
    "5.2": 523.1,
    "5.3": 3.279,
    "5.4": 144,
    "5.5": _target,
}

WRONG = [
    ("5.1", np.floor(TURNS), "floor"),
    ("5.1", np.round(TURNS), "round, as in Eq. 6"),
    ("5.1", np.ceil(-TURNS), "sign flipped"),
    ("5.1", PHI_Z + 2 * np.pi * np.ceil(TURNS), "the phase instead of the order"),
    ("5.2", 523 * 304 / 114, "pitch 304"),
    ("5.2", 523 / (2 * np.pi), "a radian for a period"),
    ("5.2", 114 * 114 / 523, "times the sensitivity"),
    ("5.2", 1 / 523, "upside down"),
    ("5.3", 1.10, "unit frequency"),
    ("5.3", 7.5, "three frequencies"),
    ("5.3", 0.0599, "phase noise in radians"),
    ("5.3", 3.28 / 2, "modulation halved"),
    ("5.4", 143, "one too short"),
    ("5.4", 145, "one too long"),
    ("5.4", 304, "the preset's own"),
    ("5.4", 163, "columns outside the projector counted"),
    ("5.5", lambda u, t: _target(u, t, sign=1), "M without its minus"),
    ("5.5", lambda u, t: _target(u, t, ratio=304 / 114), "ratio upside down"),
    ("5.5", lambda u, t: _target(u, t, unwrapped=False), "the wrapped phase rescaled"),
    ("5.5", lambda u, t: _target(u, t)[::-1], "M and D swapped"),
]
