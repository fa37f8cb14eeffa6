"""Where and how a network errs: at edges, in waves, by rounding creases (chapters 10 and 11)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np

from fpputil.checks import finite
from fpputil.decoding.unwrap import wrap

DISTANCES = (0, 1, 2, 3, 5, 8, 12, math.inf)
"""Limits of the classes of distance to the nearest edge, pixels."""

HARMONICS = 6
INNER, SMALL = 2.0, 0.5  # pixels from an edge, radians: waves are looked for beyond and below
ALIKE = 0.1  # combinations of terms so weak, beside the strongest, are not told apart
FORM = {
    "classes": ((finite,) * (len(DISTANCES) - 1),) * 3,
    "power": ((finite,) * HARMONICS,) * 2,
    "inner": (finite,) * 2,
    "bent": (finite,) * 2,
}
"""Of `ErrorAnalysis.sums` in JSON."""

STEP = 1.0  # radians that a crease bends at most within three pixels
CANNY = 30, 90  # thresholds of the gradient, grey levels


def edges_of(modulation: np.ndarray) -> np.ndarray:
    """Edges (H, W) of the plain photograph, by Canny's detector. Chapter 10.

    Of the modulation (H, W) in grey levels, 0 outside the mask; white light gives twice as many.

    >>> step = np.repeat([[60.0] * 6 + [20.0] * 6], 8, axis=0)
    >>> np.flatnonzero(edges_of(step)[4])
    array([5])
    """
    plain = np.rint(np.clip(2 * modulation, 0, 255)).astype(np.uint8)
    return cv2.Canny(plain, *CANNY) > 0


def edge_distance(modulation: np.ndarray) -> np.ndarray:
    """Distance of each pixel to the nearest edge, (H, W) float32 pixels; infinite without one."""
    edges = edges_of(modulation)
    if not edges.any():
        return np.full(edges.shape, np.inf, np.float32)
    return cv2.distanceTransform((~edges).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def waves(e: np.ndarray, Phi: np.ndarray) -> np.ndarray:
    """Amplitudes of the error that repeats with the fringes, and of what happens to look like it.

    Offset, harmonics 1 to `HARMONICS` of the fringe and as many frequencies half way between
    are fitted together by least squares. A smooth error leaves as much at the latter as at the
    former, a wave does not. Where a view shows too few fringes to tell terms apart, they share
    what they have in common. Error of the fine phase and true absolute phase (P,) are of the same
    pixels, in radians, as are the amplitudes (2, HARMONICS) at k and at k + 1/2 periods a fringe.
    """
    k = np.arange(1, HARMONICS + 1)[:, None]
    angles = np.concatenate([k, k + 0.5]) * Phi
    terms = np.concatenate([np.ones_like(Phi)[None], np.cos(angles), np.sin(angles)])
    _, *fit = np.linalg.lstsq(terms.T, e, rcond=ALIKE)[0]
    return np.hypot(*np.reshape(fit, (2, -1))).reshape(2, HARMONICS)


def creases(phi: np.ndarray, true: np.ndarray, mask: np.ndarray) -> tuple[float, float]:
    """Sums over all triples of neighbours of phi'' Phi'' and Phi''^2, along rows and columns.

    Of the predicted phase (H, W), wrapped or not, and the true one, radians. Triples that bend by
    more than `STEP` belong to a step in depth, not to a crease.
    """
    product = square = 0.0
    for a, b, m in ((phi, true, mask), (phi.T, true.T, mask.T)):
        guess, bent = (wrap(np.diff(x.astype(float), 2, axis=1)) for x in (a, b))
        steep = np.abs(np.diff(b.astype(float), 2, axis=1)) > STEP
        whole = m[:, :-2] & m[:, 1:-1] & m[:, 2:] & ~steep
        product += (guess * bent)[whole].sum()
        square += (bent[whole] ** 2).sum()
    return product, square


@dataclass(eq=False)
class ErrorAnalysis:
    """Errors gathered over views by what is nearby."""

    # pixels, sum of |e| and wrong orders in each class of distance to an edge
    classes: np.ndarray = field(default_factory=lambda: np.zeros((3, len(DISTANCES) - 1)))
    # pixels away from edges times the squares of `waves`; their number, sum of squares of phi_h
    power: np.ndarray = field(default_factory=lambda: np.zeros((2, HARMONICS)))
    inner: np.ndarray = field(default_factory=lambda: np.zeros(2))
    bent: np.ndarray = field(default_factory=lambda: np.zeros(2))  # sums of `creases`

    def add(self, item: dict, prediction) -> None:
        """Add a view: an item of `SynthFringe` as arrays, and the `Prediction` of it."""
        mask, distance = item["mask"], edge_distance(item["modulation"])
        e = np.abs(prediction.Phi - item["Phi"])[mask].astype(float)
        at = np.digitize(distance[mask], DISTANCES[1:-1])
        for row, values in enumerate((np.ones_like(e), e, ~(e <= math.pi))):
            self.classes[row] += np.bincount(at, values, minlength=len(DISTANCES) - 1)
        high = wrap(prediction.phi_h - item["Phi"])
        inner = mask & (distance > INNER) & (np.abs(high) < SMALL)
        if (number := inner.sum()) > 8 * HARMONICS:
            e, Phi = (a[inner].astype(float) for a in (high, item["Phi"]))
            self.power += number * waves(e, Phi) ** 2
            self.inner += number, (e**2).sum()
        self.bent += creases(prediction.phi_h, item["Phi"], mask)

    def summary(self) -> dict[str, list[float] | float]:
        """Measures of all views together; NaN where there was nothing to measure.

        edge_mae and edge_orders (radians, 0 to 1) by class of `DISTANCES`, and edge_pixels, their
        share; waves, the amplitude of each harmonic of the fringes in the error of phi_h, radians,
        and floor, that of frequencies half way between, beside the rms of that error; sharpness,
        by how much creases are as sharp as in truth: 1, or less where they are rounded.
        """
        number, total, wrong = self.classes
        with np.errstate(invalid="ignore", divide="ignore"):
            at, between = np.sqrt(self.power / self.inner[0])
            return {
                "edge_mae": (total / number).tolist(),
                "edge_orders": (wrong / number).tolist(),
                "edge_pixels": (number / number.sum()).tolist(),
                "waves": at.tolist(),
                "floor": between.tolist(),
                "rms": float(np.sqrt(self.inner[1] / self.inner[0])),
                "sharpness": float(self.bent[0] / self.bent[1]),
            }

    def sums(self) -> dict[str, list]:
        """What was gathered, as JSON holds it."""
        return {name: values.tolist() for name, values in vars(self).items()}

    @classmethod
    def of(cls, sums: list[dict[str, list]]) -> ErrorAnalysis:
        """Several `sums` together."""
        return cls(**{k: np.sum([one[k] for one in sums], axis=0) for k in sums[0]})
