"""Exercises of chapter 11: the ablations."""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import kendalltau

from fpputil.exercises import exercise


@exercise(
    "11.1",
    "np.triu_indices(n, 1) names all pairs.",
    "pairs in the same order less pairs in the other, over all pairs.",
)
def rank_agreement(answer):
    """tau(a, b)"""
    a, b = np.random.default_rng(0).random((2, 9))
    yield answer(a, b), kendalltau(a, b).statistic


@exercise(
    "11.2",
    "I_n = A + B cos(phi + n pi / 2).",
    "with the background gone, the photographs are B cos(phi) and -B sin(phi): "
    "atan2(A - I1, I0 - A).",
    unit="rad",
    period=2 * math.pi,
)
def two_steps(answer):
    """two_steps(I0, I1, A)"""
    phi = np.linspace(-math.pi, math.pi, 50, endpoint=False)
    A, B = np.random.default_rng(1).uniform((90, 20), (120, 80), (50, 2)).T
    yield answer(A + B * np.cos(phi), A - B * np.sin(phi), A), phi


@exercise(
    "11.3",
    "np.diff(x, 2) of both profiles.",
    "the slope of a least-squares line through the origin: sum of xy over sum of xx.",
)
def roundness(answer):
    """sharpness(found, true)"""
    x = np.linspace(-3, 3, 61)
    true = np.abs(x)
    kernel = np.ones(5) / 5
    found = np.convolve(np.pad(true, 2, mode="edge"), kernel, mode="valid")
    bent, expected = np.diff(true, 2), np.diff(found, 2)
    yield answer(found, true), (expected @ bent) / (bent @ bent)


@exercise(
    "11.4",
    "count the orders of nine rows by how many pairs are turned round.",
    "a new row turns round none to n - 1 pairs: convolve with n ones, from 1 to 9 rows.",
    "tau is 1 - 2 k / 36 for k pairs turned round; twice the tail is below 1/20 up to k = 8.",
)
def least_agreement():
    counts = np.ones(1)  # orders of one row by number of pairs turned round
    for rows in range(2, 10):
        counts = np.convolve(counts, np.ones(rows))
    tail = 2 * np.cumsum(counts) / counts.sum()
    turned = np.flatnonzero(tail < 0.05)[-1]
    return 1 - 2 * turned / 36
