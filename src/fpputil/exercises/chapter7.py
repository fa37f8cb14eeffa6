"""Checkers of chapter 7: the dataset."""

from __future__ import annotations

import numpy as np

from fpputil.exercises import close, exercise
from fpputil.learning.plan import POSES, split_by_model


@exercise("7.1", "A tenth of 340 models is validation, a tenth test; the rest trains.")
def training_views(answer) -> bool:
    return answer == len(POSES) * split_by_model(340, 0).count("training")


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


@exercise("7.3", "Half of 2**-11, the rounding error of the shade, times 255.")
def rounding_of_the_shade(answer) -> bool:
    steps = np.spacing(np.float16(0.7)).astype(float)
    return close(answer, 255 * steps / 2)


@exercise("7.4", "M = -sin(phi) and D = cos(phi) inside, 0 outside, stacked as (2, H, W).")
def network_target(answer) -> bool:
    column = np.random.default_rng(0).uniform(0, 911, (7, 9))
    column[2:4, 3:] = np.nan
    phi = 2 * np.pi * column / 18
    expected = np.nan_to_num(np.stack([-np.sin(phi), np.cos(phi)]), nan=0.0)
    return close(answer(column.copy(), 18), expected, rtol=0, atol=1e-9)


@exercise("7.5", "Multiply the scenes by the seconds, and divide by the seconds of a day.")
def days_of_cycles(answer) -> bool:
    return close(answer, 18_000 * 220 / 86_400)
