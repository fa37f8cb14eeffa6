"""Exercises of chapter 5: minimum phase and the refined reference."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from fpputil.decoding import geometric_constraint as reference
from fpputil.decoding import noise, unwrap
from fpputil.exercises import exercise
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import preset


@exercise(
    "5.1",
    "the true phase is the first one at or above the minimum phase.",
    "K_z is the ceiling of (Phi_min - phi_z) / 2 pi.",
)
def zmin_orders():
    phi_z = np.array([-3.0, -0.5, 0.5, 3.0])
    Phi_min = np.array([1.0, -1.0, 7.0, 15.0])
    return reference.zmin_order(phi_z, Phi_min).astype(int)


@exercise(
    "5.2",
    "the sensitivity is in columns a millimetre, and one period is 114 columns.",
    "114 / system.columns_per_mm(660.0)[60, 80]; no 2 pi is needed.",
    unit="mm",
)
def depth_of_a_period():
    return 114 / preset("tiny").system.columns_per_mm(660.0)[60, 80]


@exercise(
    "5.3",
    "the centred minimum phase counts as a frequency: the pitches are (304, 15).",
    "solve noise.order_error_rate(sigma, 20, 15, (304, 15)) = 0.01 for sigma.",
    unit="grey levels",
)
def noise_for_one_percent():
    return brentq(lambda s: noise.order_error_rate(s, 20, 15, (304, 15)) - 0.01, 0.5, 20)


@exercise(
    "5.4",
    "the span must be less than one period at every pixel; only columns that the projector can "
    "light count.",
    "the first whole number above the widest walk of the column, clipped to the image.",
    unit="columns",
)
def shortest_pitch():
    def accepted(pitch):
        try:
            reference.minimum_phase(preset("tiny").system, pitch)
        except ValueError:
            return False
        return True

    return next(pitch for pitch in range(100, 304) if accepted(pitch))


@exercise(
    "5.5",
    "unwrap phi_t with phi_u and rescale; K_z is a whole number.",
    "M_r = -sin(Phi_r), D_r = cos(Phi_r) with Phi_r = 114/304 Phi_t.",
)
def target_without_304(answer):
    """target(phi_u, phi_t)"""
    columns = np.random.default_rng(0).uniform(5, 905, 200)
    phi_u, phi_t = (unwrap.wrap(Fringe(pitch).phase(columns)) for pitch in (912, 114))
    Phi_r = Fringe(304).phase(columns)
    yield answer(phi_u, phi_t), [-np.sin(Phi_r), np.cos(Phi_r)]
