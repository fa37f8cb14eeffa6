"""Answers to the exercises of chapter 10: right ones, and typical misconceptions."""

import math

import cv2
import numpy as np


def _paired(a, b, draws):
    return np.quantile([np.mean(a[d]) - np.mean(b[d]) for d in draws], [0.025, 0.975])


def _by_distance(e, edges, limits, kind=cv2.DIST_L2):
    size = cv2.DIST_MASK_PRECISE if kind == cv2.DIST_L2 else 3
    distance = cv2.distanceTransform((~edges).astype(np.uint8), kind, size)
    at = np.digitize(distance, limits) - 1
    return [np.mean(np.abs(e[at == k])) for k in range(len(limits) - 1)]


def _signed(e, edges, limits):
    return _by_distance(np.maximum(e, 0), edges, limits)


def _alone(a, b, draws):
    rng = np.random.default_rng(2)
    other = rng.integers(len(b), size=draws.shape)
    return np.percentile(a[draws].mean(1) - b[other].mean(1), [2.5, 97.5])


RIGHT = {
    "10.1": 0.11384,
    "10.2": _paired,
    "10.3": _by_distance,
    "10.4": (0.1294, 0.5707),
}

WRONG = [
    ("10.1", 1.96 * np.std([0.31, 0.34, 0.40], ddof=1) / math.sqrt(3), "normal quantile"),
    ("10.1", 0.19718, "not of the mean"),
    ("10.1", 0.09295, "n in place of n - 1"),
    ("10.2", _alone, "drawn apart"),
    ("10.2", lambda a, b, d: np.percentile((a - b)[d], [2.5, 97.5]), "models, not means"),
    ("10.2", lambda a, b, d: np.percentile((b - a)[d].mean(1), [2.5, 97.5]), "the wrong way round"),
    ("10.3", _signed, "signed errors"),
    ("10.3", lambda e, edges, x: _by_distance(e, edges, x, cv2.DIST_L1), "steps, no distance"),
    ("10.3", lambda e, edges, x: np.cumsum(_by_distance(e, edges, x)), "added up"),
    ("10.4", (0.15047, 0.57069), "sigma for the mean of |e|"),
    ("10.4", (0.12942, 0.3257), "squares not rooted"),
    ("10.4", (0.07979, 0.1), "without the orders"),
]
