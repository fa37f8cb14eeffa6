"""Answers to the exercises of chapter 3: right ones, and typical misconceptions."""

import numpy as np

from fpputil.decoding.phase import numerator_denominator, wrapped_phase

RIGHT = {
    "3.1": 1.107,
    "3.2": 13,
    "3.3": 7,
    "3.4": 0.1084,
    "3.5": lambda frames: wrapped_phase(*numerator_denominator(frames[::-1])),
}


def decoded(frames):
    return wrapped_phase(*numerator_denominator(frames))


WRONG = [
    ("3.1", -1.107, "sign forgotten"),
    ("3.1", 63.43, "degrees"),
    ("3.1", np.arctan(40 / 80), "D over M"),
    ("3.2", 12, "rounded down"),
    ("3.2", 7, "factor 2 forgotten"),
    ("3.2", 625, "per cent of a radian"),
    ("3.3", 6, "N - 1 = 5 forgotten"),
    ("3.3", 10, "twice the highest harmonic"),
    ("3.3", 4, "only the strongest harmonic"),
    ("3.4", np.exp(-64 / 72), "steps forgotten"),
    ("3.4", np.exp(-5 * 64 / 72), "factor 2 in the exponent"),
    ("3.4", 10.8, "per cent"),
    ("3.5", decoded, "order ignored"),
    ("3.5", lambda frames: -decoded(frames), "only the sign turned"),
    ("3.5", lambda frames: np.degrees(decoded(frames[::-1])), "degrees"),
]
