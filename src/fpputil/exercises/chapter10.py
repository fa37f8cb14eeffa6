"""Exercises of chapter 10: the comparison."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.stats import t

from fpputil.exercises import exercise


@exercise(
    "10.1",
    "three values know their own spread badly: Student's t with two degrees of freedom.",
    "s / sqrt(3) times the quantile t.ppf(0.975, 2), with s over n - 1.",
    unit="rad",
)
def half_interval():
    values = np.array([0.31, 0.34, 0.40])
    return t.ppf(0.975, 2) * values.std(ddof=1) / math.sqrt(3)


@exercise(
    "10.2",
    "the same models for both methods, in every draw.",
    "np.percentile((a - b)[draws].mean(axis=1), [2.5, 97.5]).",
)
def paired_interval(answer):
    """paired(a, b, draws)"""
    rng = np.random.default_rng(0)
    hard = rng.gamma(2, 0.1, 40)  # what makes a model hard for both
    a, b = hard + rng.normal(0.02, 0.01, (2, 40)) * [[1.0], [0.2]]
    draws = rng.integers(40, size=(500, 40))
    yield answer(a, b, draws), np.percentile(np.mean((a - b)[draws], axis=1), [2.5, 97.5])


@exercise(
    "10.3",
    "scipy.ndimage.distance_transform_edt gives the distance to the nearest pixel that is False.",
    "the distance transform of ~edges, then the mean of |e| in each class.",
)
def errors_by_distance(answer):
    """by_distance(e, edges, limits)"""
    rng = np.random.default_rng(1)
    e, edges = rng.normal(size=(20, 30)), rng.random((20, 30)) < 0.02
    distance = distance_transform_edt(~edges)
    limits = [0, 1, 2, 4, math.inf]
    expected = [
        np.abs(e)[(distance >= a) & (distance < b)].mean()
        for a, b in zip(limits, limits[1:], strict=False)
    ]
    yield answer(e, edges, limits), expected


@exercise(
    "10.4",
    "a mean over two kinds of pixels; the mean of |e| of a Gaussian is sigma sqrt(2 / pi).",
    "0.992 sigma sqrt(2 / pi) + 0.008 * 2 pi, and the root of 0.992 sigma^2 + 0.008 (2 pi)^2.",
    unit="rad",
)
def what_orders_cost():
    wrong, sigma = 0.008, 0.1
    mae = (1 - wrong) * sigma * math.sqrt(2 / math.pi) + wrong * 2 * math.pi
    rmse = math.sqrt((1 - wrong) * sigma**2 + wrong * (2 * math.pi) ** 2)
    return np.array([mae, rmse])
