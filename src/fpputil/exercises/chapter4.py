"""Exercises of chapter 4, temporal unwrapping."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from fpputil.decoding.noise import order_error_rate
from fpputil.decoding.unwrap import absolute_phase, beat, fringe_order
from fpputil.exercises import exercise


@exercise(
    "4.1",
    "first the order K from the scaled reference, then the phase; it keeps the accuracy of phi_h.",
    "K = round((8 * 1.95 + 3.0) / 2 pi), and Phi_h = phi_h + 2 pi K.",
    unit="rad",
)
def phase_of_an_order():
    phi, Phi_ref = np.array(-3.0), np.array(1.95)
    return absolute_phase(phi, fringe_order(phi, Phi_ref, 912 / 114))


@exercise(
    "4.2",
    "the spread is sqrt(1 + r^2) sigma_phi.",
    "set 5 sqrt(1 + r^2) sigma_phi equal to pi and solve for r; keep the 1.",
)
def largest_ratio():
    return math.sqrt((math.pi / (5 * 0.05)) ** 2 - 1)


@exercise(
    "4.3",
    "solve the equation of the beat for the second pitch.",
    "24 q / (q - 24) = 912 gives q = 24 * 912 / (912 - 24).",
    unit="columns",
)
def pitch_for_beat():
    return brentq(lambda q: beat(24, q) - 912, 24.5, 30)


@exercise(
    "4.4",
    "the two phases repeat together after the least common multiple of the pitches.",
    "27 has a divisor in common with 15: try larger ones until the multiple reaches 400.",
    unit="columns",
)
def smallest_partner():
    return next(q for q in range(16, 400) if math.lcm(15, q) >= 400)


@exercise(
    "4.5",
    "noise.order_error_rate, in a loop over the steps.",
    "raise the steps until order_error_rate(8, 50, steps, (912, 114, 15)) is below 1e-4.",
    unit="steps",
)
def steps_for_orders():
    pitches = (912, 114, 15)
    return next(N for N in range(3, 200) if order_error_rate(8, 50, N, pitches) < 1e-4)
