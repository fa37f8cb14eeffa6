"""Checkers of chapter 9: SIDO, PSNet and DLALNet."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import erfc

from fpputil.decoding.noise import phase_sigma
from fpputil.exercises import close, exercise


@exercise("9.1", "erfc(r / (sigma sqrt(2))), with r the room, pi times the ratio of the pitches.")
def wrong_orders(answer) -> bool:
    return close(answer, erfc(math.pi * 24 / 912 / (0.03 * math.sqrt(2))))


@exercise("9.2", "Equal ratios: the pitch between is the geometric mean of the other two.")
def pitch_between(answer) -> bool:
    return close(answer, math.sqrt(912 * 24))


@exercise("9.3", "Differences of neighbours, around the end, of both stacks; squared, averaged.")
def loss_of_steps(answer) -> bool:
    found, true = np.random.default_rng(0).random((2, 5, 3, 4))
    expected = np.mean([(found[n] - found[n - 1] - true[n] + true[n - 1]) ** 2 for n in range(5)])
    return close(answer(found, true), expected)


@exercise("9.4", "sqrt(2 / N) sigma / B of chapter 3, with the errors of the made photographs.")
def phase_of_made_photographs(answer) -> bool:
    return close(answer, (phase_sigma(10, 50, 5), phase_sigma(10, 50, 15)))
