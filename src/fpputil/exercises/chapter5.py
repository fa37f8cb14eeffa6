"""Checkers of chapter 5: minimum phase and the refined reference."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from fpputil.decoding import geometric_constraint as reference
from fpputil.decoding import noise, unwrap
from fpputil.exercises import close, exercise
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import preset


@exercise("5.1", "K_z is the ceiling of (Phi_min - phi_z) / 2 pi: four whole numbers.")
def zmin_orders(answer) -> bool:
    phi_z = np.array([-3.0, -0.5, 0.5, 3.0])
    Phi_min = np.array([1.0, -1.0, 7.0, 15.0])
    return close(answer, reference.zmin_order(phi_z, Phi_min), rtol=0, atol=1e-6)


@exercise("5.2", "Divide the pitch by the sensitivity; no 2 pi is needed.")
def depth_of_a_period(answer) -> bool:
    return close(answer, 114 / preset("tiny").system.columns_per_mm(660.0)[60, 80], rtol=5e-3)


@exercise("5.3", "The pitches are (304, 15); the answer is in grey levels, not radians.")
def noise_for_one_percent(answer) -> bool:
    def excess(sigma):
        return noise.order_error_rate(sigma, 20, 15, (304, 15)) - 0.01

    return close(answer, brentq(excess, 0.5, 20), rtol=5e-3)


@exercise("5.4", "It is the first whole number above the widest walk of the column, in the image.")
def shortest_pitch(answer) -> bool:
    def accepted(pitch):
        try:
            reference.minimum_phase(preset("tiny").system, pitch)
        except ValueError:
            return False
        return True

    return int(answer) == answer and accepted(answer) and not accepted(answer - 1)


@exercise("5.5", "M_r = -sin(Phi_r), D_r = cos(Phi_r) with Phi_r = 114/304 Phi_t.")
def target_without_304(answer) -> bool:
    columns = np.random.default_rng(0).uniform(5, 905, 200)
    phi_u, phi_t = (unwrap.wrap(Fringe(pitch).phase(columns)) for pitch in (912, 114))
    Phi_r = Fringe(304).phase(columns)
    return close(answer(phi_u, phi_t), [-np.sin(Phi_r), np.cos(Phi_r)], rtol=0, atol=1e-6)
