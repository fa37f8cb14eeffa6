"""Exercises of chapter 9: SIDO, PSNet and DLALNet."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import erfc

from fpputil.decoding.noise import phase_sigma
from fpputil.exercises import exercise


@exercise(
    "9.1",
    "an order is wrong in both tails beyond the room, pi times the ratio of the pitches.",
    "erfc(r / (sigma sqrt(2))) with r = pi * 24 / 912.",
)
def wrong_orders():
    return erfc(math.pi * 24 / 912 / (0.03 * math.sqrt(2)))


@exercise(
    "9.2",
    "write down the room of both steps: the ratios must be equal.",
    "the geometric mean of the other two, sqrt(912 * 24).",
    unit="columns",
)
def pitch_between():
    return math.sqrt(912 * 24)


@exercise(
    "9.3",
    "np.roll along the first axis gives each step its neighbour, around the end.",
    "with e = found - true: mean((e - np.roll(e, -1, axis=0))^2).",
)
def loss_of_steps(answer):
    """steps_loss(found, true)"""
    found, true = np.random.default_rng(0).random((2, 5, 3, 4))
    expected = np.mean([(found[n] - found[n - 1] - true[n] + true[n - 1]) ** 2 for n in range(5)])
    yield answer(found, true), expected


@exercise(
    "9.4",
    "chapter 3 has the phase noise of photographs.",
    "sqrt(2 / N) sigma / B for N = 5 and N = 15.",
    unit="rad",
)
def phase_of_made_photographs():
    return np.array([phase_sigma(10, 50, 5), phase_sigma(10, 50, 15)])
