"""Exercises of chapter 6: from phase to a point cloud."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fpputil.decoding import phase_height, triangulation
from fpputil.exercises import exercise
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import preset


@exercise(
    "6.1",
    "first to columns, then to millimetres with system.columns_per_mm.",
    "error times pitch over 2 pi, divided by the sensitivity.",
    unit="mm",
)
def phase_error_in_mm():
    return triangulation.column(0.1, 24) / preset("tiny").system.columns_per_mm(660.0)[60, 80]


@exercise(
    "6.2",
    "a pixel coordinate gives one linear equation, u P_2 X = P_0 X with X = (x, y, z, 1).",
    "solve three equations: two rows of the camera's P, and the column's of the projector's.",
    unit="mm",
)
def meeting_point(answer):
    """meet(u, v, column, system)"""
    system = preset("tiny").system
    column = system.columns_at(640.0) + 0.5
    points = triangulation.triangulate(column, system)
    for u, v in ((20, 30), (80, 60), (110, 100)):
        yield answer(u, v, column[v, u], system), points[v, u]


@exercise(
    "6.3",
    "from the depth noise to that of the column, to that of the phase, to that of a frame.",
    "sigma = B sqrt(N / 2) sigma_phi with sigma_phi = 2 pi eta sigma_z / pitch.",
    unit="grey levels",
)
def noise_for_a_tenth():
    eta = preset("tiny").system.columns_per_mm(660.0)[60, 40]
    return 60 * np.sqrt(15 / 2) * 2 * np.pi * eta * 0.1 / 24


@exercise(
    "6.4",
    "fit_phase_height takes the degree; look at the absolute value of the error.",
    "raise the degree by one until the error at 650 mm is below 0.01 mm.",
)
def lowest_degree():
    system, heights = preset("tiny").system, np.arange(560.0, 761.0, 20.0)
    Phi = np.stack([Fringe(24).phase(system.columns_at(z))[60:61, 80:81] for z in heights])
    test = Fringe(24).phase(system.columns_at(650.0))[60:61, 80:81]

    def error(degree):
        return abs(phase_height.fit_phase_height(Phi, heights, degree).height(test) - 650)[0, 0]

    return next(k for k in range(1, 11) if error(k) < 0.01)


@exercise(
    "6.5",
    "light comes from the true system, triangulation uses the wrong one.",
    "triangulate(system.columns_at(660.0), wrong)[60, 40, 2] - 660.",
    unit="mm",
)
def depth_with_wrong_focal():
    system = preset("tiny").system
    K = system.projector.K.copy()
    K[0, 0], K[1, 1] = 1.002 * K[0, 0], 1.002 * K[1, 1]
    wrong = replace(system, projector=replace(system.projector, K=K))
    return triangulation.triangulate(system.columns_at(660.0), wrong)[60, 40, 2] - 660
