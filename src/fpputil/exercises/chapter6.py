"""Checkers of chapter 6: from phase to a point cloud."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fpputil.decoding import phase_height, triangulation
from fpputil.exercises import close, exercise
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import preset


@exercise("6.1", "Error in phase times pitch over 2 pi, then divided by the sensitivity.")
def phase_error_in_mm(answer) -> bool:
    columns = triangulation.column(0.1, 24)
    return close(answer, columns / preset("tiny").system.columns_per_mm(660.0)[60, 80], rtol=5e-3)


@exercise("6.2", "Solve three equations: two rows of the camera's P, and the column's of P'.")
def meeting_point(answer) -> bool:
    system = preset("tiny").system
    column = system.columns_at(640.0) + 0.5
    points = triangulation.triangulate(column, system)
    pixels = ((20, 30), (80, 60), (110, 100))
    found = [answer(u, v, column[v, u], system) for u, v in pixels]
    return close(found, [points[v, u] for u, v in pixels], rtol=0, atol=1e-3)


@exercise("6.3", "sigma = B sqrt(N / 2) sigma_phi with sigma_phi = 2 pi eta sigma_z / pitch.")
def noise_for_a_tenth(answer) -> bool:
    eta = preset("tiny").system.columns_per_mm(660.0)[60, 40]
    return close(answer, 60 * np.sqrt(15 / 2) * 2 * np.pi * eta * 0.1 / 24, rtol=5e-3)


@exercise("6.4", "Raise the degree by one until the error at 650 mm is below 0.01 mm.")
def lowest_degree(answer) -> bool:
    system, heights = preset("tiny").system, np.arange(560.0, 761.0, 20.0)
    Phi = np.stack([Fringe(24).phase(system.columns_at(z))[60:61, 80:81] for z in heights])
    test = Fringe(24).phase(system.columns_at(650.0))[60:61, 80:81]

    def error(degree):
        return abs(phase_height.fit_phase_height(Phi, heights, degree).height(test) - 650)[0, 0]

    return int(answer) == answer and answer == next(k for k in range(1, 11) if error(k) < 0.01)


@exercise("6.5", "Triangulate true columns with the wrong projector, and keep the sign.")
def depth_with_wrong_focal(answer) -> bool:
    system = preset("tiny").system
    K = system.projector.K.copy()
    K[0, 0], K[1, 1] = 1.002 * K[0, 0], 1.002 * K[1, 1]
    wrong = replace(system, projector=replace(system.projector, K=K))
    expected = triangulation.triangulate(system.columns_at(660.0), wrong)[60, 40, 2] - 660
    return close(answer, expected, rtol=5e-3)
