"""Checks of input that every room shares, and files that are written whole or not at all."""

from __future__ import annotations

from numbers import Integral, Real

import numpy as np


def _printed(value) -> str:
    """The value as both lines of NumPy print it."""
    return repr(value.item() if isinstance(value, np.generic) else value)


def positive(name: str, value, unit: str = "") -> float:
    """The value as a float; ValueError unless it is a finite number above 0."""
    if not (isinstance(value, Real) and np.isfinite(value) and value > 0):
        of = f" of {unit}" if unit else ""
        raise ValueError(f"{name} {_printed(value)} given; a positive number{of} is needed")
    return float(value)


def not_negative(name: str, value, unit: str = "") -> float:
    """The value as a float; ValueError unless it is a finite number of 0 or more."""
    if not (isinstance(value, Real) and np.isfinite(value) and value >= 0):
        of = f" of {unit}" if unit else ""
        raise ValueError(f"{name} {_printed(value)} given; a number{of}, 0 or more, is needed")
    return float(value)


def whole(name: str, value, least: int) -> int:
    """The value as an int; ValueError unless it is a whole number of `least` or more."""
    if not (isinstance(value, Integral) and not isinstance(value, bool) and value >= least):
        raise ValueError(
            f"{name} {_printed(value)} given; a whole number of {least} or more is needed"
        )
    return int(value)


def rotation(name: str, R) -> np.ndarray:
    """R as a (3, 3) float64 array; ValueError unless it is orthonormal with determinant +1."""
    R = np.asarray(R, np.float64)
    if R.shape != (3, 3):
        raise ValueError(f"{name} of shape {R.shape} given; a rotation is a (3, 3) matrix")
    if not (np.allclose(R @ R.T, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0):
        raise ValueError(f"{name} {R.tolist()} given; a rotation is orthonormal with det +1")
    return R


def seeded(seed) -> np.random.Generator:
    """A generator from a seed; ValueError unless the seed is a whole number of 0 or more."""
    return np.random.default_rng(whole("seed", seed, 0))
