"""Checkers of chapter 4, temporal unwrapping."""

from __future__ import annotations

import math

import numpy as np

from fpputil.decoding.noise import order_error_rate
from fpputil.decoding.unwrap import absolute_phase, beat, fringe_order
from fpputil.exercises import close, exercise


@exercise("4.1", "K = round((8 * 1.95 + 3.0) / 2 pi), and Phi_h = phi_h + 2 pi K.")
def phase_of_an_order(answer):
    phi, Phi_ref = np.array(-3.0), np.array(1.95)
    return close(answer, absolute_phase(phi, fringe_order(phi, Phi_ref, 912 / 114)))


@exercise("4.2", "Set 5 sqrt(1 + r^2) sigma_phi equal to pi and solve for r; keep the 1.")
def largest_ratio(answer):
    return close(answer, math.sqrt((math.pi / (5 * 0.05)) ** 2 - 1))


@exercise("4.3", "24 q / (q - 24) = 912 gives q = 24 * 912 / (912 - 24).")
def pitch_for_beat(answer):
    return float(answer) > 24 and close(beat(24, float(answer)), 912, rtol=0.02)


@exercise("4.4", "The numbers repeat after the least common multiple of the pitches.")
def unambiguous_columns(answer):
    return close(answer, math.lcm(15, 21), rtol=0)


@exercise("4.5", "Raise the steps until order_error_rate(8, 50, steps, ...) is below 1e-4.")
def steps_for_orders(answer):
    rate = (order_error_rate(8, 50, N, (912, 114, 15)) < 1e-4 for N in range(3, 200))
    return close(answer, 3 + list(rate).index(True), rtol=0)
