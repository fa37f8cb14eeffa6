"""Checkers of chapter 7: the dataset."""

from __future__ import annotations

import numpy as np

from fpputil.dataset.generation import POSES, split_by_model
from fpputil.decoding.decoder import decode
from fpputil.exercises import close, exercise
from fpputil.optics import shapes
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import preset


@exercise("7.1", "A tenth of 347 models, rounded, is validation, as many test; the rest trains.")
def training_views(answer) -> bool:
    return answer == len(POSES) * split_by_model(347, 0).count("training")


@exercise("7.2", "It returns True or False. Try two models of which one is in two splits.")
def finds_leaks(answer) -> bool:
    rng = np.random.default_rng(0)
    models = rng.permutation(np.repeat([f"m{k}" for k in range(40)], 6))
    own = dict(zip(sorted(set(models)), split_by_model(40, 1), strict=True))
    by_model = [own[m] for m in models]
    one_view = [*by_model]
    one_view[7] = "test" if by_model[7] != "test" else "training"
    by_view = list(rng.permutation(by_model))
    cases = [(by_model, False), (one_view, True), (by_view, True), (["test"] * 240, False)]
    return all(bool(answer(list(models), splits)) is leak for splits, leak in cases)


@exercise("7.3", "Between 1/4 and 1/2 the steps are 2**-12; half of one, times 255.")
def rounding_of_the_shade(answer) -> bool:
    steps = np.spacing(np.float16(0.3)).astype(float)
    return close(answer, 255 * steps / 2)


@exercise("7.4", "M = -sin(phi) and D = cos(phi) inside, 0 outside, stacked as (2, H, W).")
def network_target(answer) -> bool:
    column = np.random.default_rng(0).uniform(0, 911, (7, 9))
    column[2:4, 3:] = np.nan
    phi = 2 * np.pi * column / 18
    expected = np.nan_to_num(np.stack([-np.sin(phi), np.cos(phi)]), nan=0.0)
    return close(answer(column.copy(), 18), expected, rtol=0, atol=1e-9)


@exercise("7.5", "The error is decoded.Phi minus Fringe(24).phase(view.column), in radians.")
def noise_of_a_view(answer) -> bool:
    view = raycast(shapes.place(shapes.part(3)), preset("tiny").system)
    fringes = fringe_set((912, 114, 24))
    decoded = decode(view.frames(fringes, noise=4.0, seed=0), fringes, 912)
    seen = decoded.modulation[-1] > 20
    error = (decoded.Phi - fringes[-1].phase(view.column))[seen]
    return close(answer, np.sqrt(np.mean(error**2)), rtol=5e-3)
