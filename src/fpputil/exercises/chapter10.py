"""Checkers of chapter 10: the comparison."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.stats import t

from fpputil.exercises import close, exercise


@exercise("10.1", "s / sqrt(3) times the quantile of Student's t with two degrees of freedom.")
def half_interval(answer) -> bool:
    values = np.array([0.31, 0.34, 0.40])
    return close(answer, t.ppf(0.975, 2) * values.std(ddof=1) / math.sqrt(3))


@exercise("10.2", "Draw the same models for both methods, then subtract, then take percentiles.")
def paired_interval(answer) -> bool:
    rng = np.random.default_rng(0)
    hard = rng.gamma(2, 0.1, 40)  # what makes a model hard for both
    a, b = hard + rng.normal(0.02, 0.01, (2, 40)) * [[1.0], [0.2]]
    draws = rng.integers(40, size=(500, 40))
    expected = np.percentile(np.mean((a - b)[draws], axis=1), [2.5, 97.5])
    return close(answer(a, b, draws), expected)


@exercise("10.3", "The distance transform of what is no edge; then a mean in each class.")
def errors_by_distance(answer) -> bool:
    rng = np.random.default_rng(1)
    e, edges = rng.normal(size=(20, 30)), rng.random((20, 30)) < 0.02
    distance = distance_transform_edt(~edges)
    limits = [0, 1, 2, 4, math.inf]
    expected = [
        np.abs(e)[(distance >= a) & (distance < b)].mean()
        for a, b in zip(limits, limits[1:], strict=False)
    ]
    return close(answer(e, edges, limits), expected)


@exercise("10.4", "A mean of two kinds of pixels, and the root of a mean of squares of both.")
def what_orders_cost(answer) -> bool:
    wrong, sigma = 0.008, 0.1
    mae = (1 - wrong) * sigma * math.sqrt(2 / math.pi) + wrong * 2 * math.pi
    rmse = math.sqrt((1 - wrong) * sigma**2 + wrong * (2 * math.pi) ** 2)
    return close(answer, (mae, rmse))
