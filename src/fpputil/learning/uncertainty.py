"""How far off a prediction may be, pixel by pixel: from two phases that should agree (chapter 8).

The phase of the lower pitch names the order of the higher one. How far the order lies from a whole
number tells how well the two agree; what that is worth in radians is read off views with truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from fpputil.checks import conform, finite
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.decoding.unwrap import TWO_PI, wrap
from fpputil.learning.evaluation import predictions
from fpputil.learning.loaders import spread
from fpputil.learning.weights import Trained, read_beside, write_beside
from fpputil.networks.sfnet import SECOND
from fpputil.optics.system import Pitches

WINDOWS = (1, 5, 11)  # pixels a side: an order is doubtful if it is so here, or around
CLASSES = 60  # of equally many pixels each, in which errors are counted
VIEWS = 400  # of a split, to be calibrated on
KEPT = (1.0, 0.99, 0.98, 0.95, 0.9, 0.8)  # shares of pixels that stay when the doubtful go
FORM = {name: [finite] for name in ("doubt", "error_68", "error_95")}


def doubt(Phi: np.ndarray, phi_r: np.ndarray, mask: np.ndarray, ratio: float) -> np.ndarray:
    """How far fringe orders lie from whole numbers, here and around: (H, W) orders. Chapter 8.

    Root of the mean over `WINDOWS` of the mean squares in each.

    Parameters
    ----------
    Phi, phi_r : (H, W) arrays
        Absolute phase of the high pitch and wrapped phase of the lower one, radians.
    mask : (H, W) bool array
        Neighbours outside it do not count.
    ratio : float
        Lower over high pitch.

    Examples
    --------
    >>> Phi = np.full((12, 12), 40.0)
    >>> off = doubt(Phi, wrap(Phi / 4.75) + 0.1, np.ones((12, 12), bool), 4.75)
    >>> bool(abs(off - 0.1 * 4.75 / TWO_PI).max() < 1e-6)
    True
    """
    rest = wrap(np.asarray(Phi, np.float32) / np.float32(ratio) - phi_r) * (ratio / TWO_PI)
    square, inside = np.where(mask, rest**2, 0).astype(np.float32), mask.astype(np.float32)
    sums = ([cv2.boxFilter(a, -1, (k, k), normalize=False, borderType=cv2.BORDER_CONSTANT)
             for a in (square, inside)] for k in WINDOWS)  # fmt: skip
    means = (np.maximum(total, 0) / np.maximum(number, 1) for total, number in sums)
    return np.sqrt(sum(means) / len(WINDOWS))


def doubt_of(trained: Trained, prediction, mask: np.ndarray) -> np.ndarray:
    """`doubt` (H, W) of a `Prediction`; ValueError if its method has but one phase."""
    name, pitches = trained.method.reference, Pitches(**trained.metadata["pitches"])
    if name is None:
        raise ValueError("a method of one wrapped phase given; two are needed that may disagree")
    ratio = getattr(pitches, SECOND[name]) / pitches.high
    return doubt(prediction.Phi, prediction.phi_r, mask, ratio)


@dataclass(frozen=True)
class Uncertainty:
    """How large errors are where phases disagree by so much.

    Parameters
    ----------
    doubt : sequence of N floats
        Orders, ascending.
    error_68, error_95 : sequences of N floats
        What 68 and 95 % of the errors of Phi stay below, radians, wrong orders among them.

    Examples
    --------
    >>> told = Uncertainty.of(np.array([0.1, 0.1, 0.4, 0.4]), np.array([0.0, 0.1, 0.2, 6.3]), 2)
    >>> told.error_95, told(np.array([0.1]))[1]
    ((0.095, 5.995), array([0.095]))
    """

    doubt: Sequence[float]
    error_68: Sequence[float]
    error_95: Sequence[float]

    @classmethod
    def of(cls, scores: np.ndarray, errors: np.ndarray, classes: int = CLASSES) -> Uncertainty:
        """From doubts (P,) and absolute errors (P,), radians, of the same pixels."""
        order = np.array_split(np.argsort(scores, kind="stable"), classes)
        at = [float(np.median(scores[part])) for part in order]
        ends = np.array([np.quantile(errors[part], (0.68, 0.95)) for part in order])
        ends = np.maximum.accumulate(ends)  # more doubt is never less doubt
        return cls(tuple(at), *(tuple(column.round(6).tolist()) for column in ends.T))

    @classmethod
    def from_json(cls, stored: dict) -> Uncertainty:
        """What `asdict` gave; ValueError if it has another form."""
        conform("uncertainty", stored, FORM)
        return cls(**{name: tuple(stored[name]) for name in FORM})

    def __call__(self, score: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What 68 and 95 % of errors stay below where phases disagree so, arrays of one shape."""
        ends = (self.error_68, self.error_95)
        return tuple(np.interp(score, self.doubt, end) for end in ends)


class Disagreements:
    """Disagreement and absolute error, radians, of the pixels of views as they are predicted."""

    def __init__(self, trained: Trained):
        self.trained, self.scores, self.errors = trained, [], []

    def add(self, item: dict, prediction) -> None:
        """Add a view: an item of `SynthFringe` as arrays, and the `Prediction` of it."""
        mask = item["mask"]
        self.scores.append(doubt_of(self.trained, prediction, mask)[mask])
        self.errors.append(np.abs(prediction.Phi - item["Phi"])[mask].astype(float))

    @property
    def together(self) -> tuple[np.ndarray, np.ndarray]:
        """Disagreements (P,) and errors (P,) of all views."""
        return np.concatenate(self.scores), np.concatenate(self.errors)


def calibrate_uncertainty(trained: Trained, data: SynthFringe, **how) -> Uncertainty:
    """`Uncertainty` from a split that the network was not trained on, the validation split.

    Of `VIEWS` views, evenly spread. Options as of `predictions`.
    """
    pixels = Disagreements(trained)
    for item, prediction in predictions(trained, data, views=spread(data, VIEWS), **how):
        pixels.add(item, prediction)
    return Uncertainty.of(*pixels.together)


def assess_uncertainty(told: Uncertainty, scores: np.ndarray, errors: np.ndarray) -> dict:
    """How true an `Uncertainty` is of `Disagreements.together`, and what it is good for. Chapter 8.

    Returns
    -------
    dict
        coverage_68, coverage_95: shares of pixels whose error stays below what was told; by share
        of pixels in `KEPT`, mae and order_errors of those that stay when the most doubtful are
        left out, and mae_best, of those that stay when the largest errors are.
    """
    covered = {n: (errors <= end).mean() for n, end in zip((68, 95), told(scores), strict=True)}
    wrong, number = errors > np.pi, len(errors)
    result = {f"coverage_{n}": float(share) for n, share in covered.items()}
    result |= {"pixels": number, "kept": KEPT}
    for name, order, values in (
        ("mae", scores, errors),
        ("order_errors", scores, wrong),
        ("mae_best", errors, errors),
    ):
        sums = np.cumsum(values[np.argsort(order, kind="stable")], dtype=float)
        at = [round(share * number) for share in KEPT]
        result[name] = [float(sums[k - 1] / k) for k in at]
    return result


def keep(path: str | Path, trained: Trained, told: Uncertainty) -> Path:
    """Write an `Uncertainty` into the JSON beside weights; ValueError as of `write_metrics`."""
    values = {name: list(values) for name, values in asdict(told).items()}
    return write_beside(path, trained, uncertainty=values)


def uncertainty_of(path: str | Path) -> Uncertainty | None:
    """The `Uncertainty` in the JSON beside weights, or None."""
    stored = read_beside(path).get("uncertainty")
    return None if stored is None else Uncertainty.from_json(stored)
