"""Exercises of chapter 7: the dataset."""

from __future__ import annotations

import numpy as np

from fpputil.dataset.generation import POSES, split_by_model
from fpputil.decoding.decoder import decode
from fpputil.exercises import exercise
from fpputil.optics import shapes
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import preset


@exercise(
    "7.1",
    "a split holds whole models: a tenth of them, rounded, for validation, as many for the test.",
    "36 * (347 - 2 * 35).",
    unit="views",
)
def training_views():
    return len(POSES) * split_by_model(347, 0).count("training")


@exercise(
    "7.2",
    "collect the pairs; try two models of which one is in two splits.",
    "without a leak there are as many different pairs as different models.",
)
def finds_leaks(answer):
    """leaks(models, splits)"""
    rng = np.random.default_rng(0)
    models = rng.permutation(np.repeat([f"m{k}" for k in range(40)], 6))
    own = dict(zip(sorted(set(models)), split_by_model(40, 1), strict=True))
    by_model = [own[m] for m in models]
    one_view = [*by_model]
    one_view[7] = "test" if by_model[7] != "test" else "training"
    by_view = list(rng.permutation(by_model))
    for splits, leak in (
        (by_model, False),
        (one_view, True),
        (by_view, True),
        (["test"] * 240, False),
    ):
        yield answer(list(models), splits), leak


@exercise(
    "7.3",
    "how wide are the steps of such a float between 1/4 and 1/2? Rounding errs by half a step.",
    "the steps are 2**-12; half of one, times 255.",
    unit="grey levels",
)
def rounding_of_the_shade():
    return 255 * np.spacing(np.float16(0.3)).astype(float) / 2


@exercise(
    "7.4",
    "the phase need not be wrapped for a sine; fill NaN before, not after.",
    "M = -sin(phi) and D = cos(phi) with phi = 2 pi column / pitch, and 0 outside.",
)
def network_target(answer):
    """target(column, pitch)"""
    column = np.random.default_rng(0).uniform(0, 911, (7, 9))
    column[2:4, 3:] = np.nan
    phi = 2 * np.pi * column / 18
    yield answer(column.copy(), 18), np.nan_to_num(np.stack([-np.sin(phi), np.cos(phi)]), nan=0.0)


@exercise(
    "7.5",
    "the truth is Fringe(24).phase(view.column); decoded.modulation[-1] is that of the last pitch.",
    "the root of the mean of (decoded.Phi - truth)^2 where that modulation exceeds 20.",
    unit="rad",
)
def noise_of_a_view():
    view = raycast(shapes.place(shapes.part(3)), preset("tiny").system)
    fringes = fringe_set((912, 114, 24))
    decoded = decode(view.frames(fringes, noise=4.0, seed=0), fringes, 912)
    seen = decoded.modulation[-1] > 20
    error = (decoded.Phi - fringes[-1].phase(view.column))[seen]
    return np.sqrt(np.mean(error**2))
