"""Answers to the exercises of chapter 8: right ones, and typical misconceptions."""

import numpy as np
import torch


def _wrap(x):
    return (x + np.pi) % (2 * np.pi) - np.pi


RIGHT = {
    "8.1": 1_180_152,
    "8.2": lambda values, mask: values[mask].sum() / mask.sum(),
    "8.3": (0.15502, 0.24802),
    "8.4": lambda phi, Phi: np.mean(_wrap(np.diff(phi - Phi)) ** 2),
}

WRONG = [
    ("8.1", 1_180_152 - 1008, "without biases"),
    ("8.1", 2 * 1_180_152, "both encoders"),
    ("8.1", 1_180_224, "two photographs"),
    ("8.2", lambda values, mask: (values * mask).sum() / mask.sum(), "times the mask"),
    (
        "8.2",
        lambda values, mask: torch.where(mask, values**2 / values, 0).sum() / mask.sum(),
        "where",
    ),
    ("8.2", lambda values, mask: values.nanmean(), "what is not NaN"),
    ("8.3", (0.31, 0.496), "a whole period"),
    ("8.3", (0.24802, 0.15502), "the other way round"),
    ("8.3", 0.15502, "only one"),
    ("8.3", (63.7, 39.8), "the ratio upside down"),
    ("8.4", lambda phi, Phi: np.mean((np.diff(phi) - np.diff(Phi)) ** 2), "not wrapped"),
    (
        "8.4",
        lambda phi, Phi: np.mean((_wrap(np.diff(phi)) - np.diff(Phi)) ** 2),
        "one gradient wrapped",
    ),
    ("8.4", lambda phi, Phi: np.mean(_wrap(phi - Phi) ** 2), "errors, not their differences"),
]
