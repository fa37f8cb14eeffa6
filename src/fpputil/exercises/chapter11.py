"""Checkers of chapter 11: the ablations."""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import kendalltau

from fpputil.decoding.unwrap import wrap
from fpputil.exercises import close, exercise


@exercise("11.1", "Pairs in the same order less pairs in the other, over all pairs.")
def rank_agreement(answer) -> bool:
    a, b = np.random.default_rng(0).random((2, 9))
    return close(answer(a, b), kendalltau(a, b).statistic)


@exercise("11.2", "With the background gone, the photographs are B cos(phi) and -B sin(phi).")
def two_steps(answer) -> bool:
    phi = np.linspace(-math.pi, math.pi, 50, endpoint=False)
    A, B = np.random.default_rng(1).uniform((90, 20), (120, 80), (50, 2)).T
    found = answer(A + B * np.cos(phi), A - B * np.sin(phi), A)
    return close(wrap(found - phi), np.zeros(50), atol=1e-3)


@exercise("11.3", "The slope of a least-squares line through the origin: sum of xy over sum of xx.")
def roundness(answer) -> bool:
    x = np.linspace(-3, 3, 61)
    true = np.abs(x)
    kernel = np.ones(5) / 5
    found = np.convolve(np.pad(true, 2, mode="edge"), kernel, mode="valid")
    bent, expected = np.diff(true, 2), np.diff(found, 2)
    return close(answer(found, true), (expected @ bent) / (bent @ bent))


@exercise("11.4", "Count the orders of nine rows by how many pairs are turned round.")
def least_agreement(answer) -> bool:
    counts = np.ones(1)  # orders of one row by number of pairs turned round
    for rows in range(2, 10):
        counts = np.convolve(counts, np.ones(rows))
    tail = 2 * np.cumsum(counts) / counts.sum()
    turned = np.flatnonzero(tail < 0.05)[-1]
    return close(answer, 1 - 2 * turned / 36)
