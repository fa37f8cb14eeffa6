"""Where and how a network errs: at edges, in waves, by rounding creases (chapters 10 and 11)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np

from fpputil.decoding.unwrap import wrap

DISTANCES = (0, 1, 2, 3, 5, 8, 12, math.inf)
"""Limits of the classes of distance to the nearest edge, pixels."""

HARMONICS = 6
INNER = 2.0  # pixels from an edge beyond which waves are looked for
CANNY = 30, 90  # thresholds of the gradient, grey levels


def edges_of(modulation: np.ndarray) -> np.ndarray:
    """Edges of the plain photograph, by Canny's detector. Chapter 10.

    Parameters
    ----------
    modulation : (H, W) array
        Grey levels, 0 outside the mask; white light gives twice as many.

    Returns
    -------
    (H, W) bool array
    """
    plain = np.rint(np.clip(2 * modulation, 0, 255)).astype(np.uint8)
    return cv2.Canny(plain, *CANNY) > 0


def edge_distance(modulation: np.ndarray) -> np.ndarray:
    """Distance of each pixel to the nearest edge, (H, W) float32 pixels; infinite without one."""
    edges = edges_of(modulation)
    if not edges.any():
        return np.full(edges.shape, np.inf, np.float32)
    return cv2.distanceTransform((~edges).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def waves(e: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Amplitudes of the error that repeats with the fringes (P,) -> (HARMONICS,) complex.

    Parameters
    ----------
    e, phi : (P,) arrays
        Error and true phase at the same pixels, radians.
    """
    k = np.arange(1, HARMONICS + 1)[:, None]
    return (e * np.exp(-1j * k * phi)).mean(axis=1)


def creases(phi: np.ndarray, true: np.ndarray, mask: np.ndarray) -> tuple[float, float]:
    """Sums over all triples of neighbours of phi'' Phi'' and Phi''^2, along rows and columns.

    Parameters
    ----------
    phi, true : (H, W) arrays
        Predicted, wrapped or not, and true phase, radians.
    mask : (H, W) bool array
    """
    product = square = 0.0
    for a, b, m in ((phi, true, mask), (phi.T, true.T, mask.T)):
        found, bent = (np.diff(wrap(np.diff(x.astype(float), axis=1)), axis=1) for x in (a, b))
        slope = np.abs(np.diff(b, axis=1))
        whole = m[:, :-2] & m[:, 1:-1] & m[:, 2:] & (np.maximum(slope[:, :-1], slope[:, 1:]) < 3)
        product += (wrap(found) * bent)[whole].sum()
        square += (bent[whole] ** 2).sum()
    return product, square


@dataclass(eq=False)
class Inspection:
    """Errors gathered over views by what is nearby.

    Parameters
    ----------
    classes : (3, classes) array
        Number of pixels, sum of ``|e|`` and wrong orders in each class of distance to an edge.
    power : (HARMONICS,) array
        Sum over views of their pixels times ``|amplitude|^2`` of the waves.
    inner : (2,) array
        Number of pixels away from edges, and their sum of squared errors of phi_h.
    bent : (2,) array
        Sums of `creases`.
    """

    classes: np.ndarray = field(default_factory=lambda: np.zeros((3, len(DISTANCES) - 1)))
    power: np.ndarray = field(default_factory=lambda: np.zeros(HARMONICS))
    inner: np.ndarray = field(default_factory=lambda: np.zeros(2))
    bent: np.ndarray = field(default_factory=lambda: np.zeros(2))

    def add(self, item: dict, found) -> None:
        """Add a view: an item of `SynthFringe` as arrays, and what was `Measured`."""
        mask, distance = item["mask"], edge_distance(item["modulation"])
        e = np.abs(found.Phi - item["Phi"])[mask].astype(float)
        at = np.digitize(distance[mask], DISTANCES[1:-1])
        for row, values in enumerate((np.ones_like(e), e, ~(e <= math.pi))):
            self.classes[row] += np.bincount(at, values, minlength=len(DISTANCES) - 1)
        inner = mask & (distance > INNER)
        if number := inner.sum():
            high = wrap(found.phi_h - item["Phi"])[inner].astype(float)
            self.power += number * np.abs(waves(high, item["Phi"][inner])) ** 2
            self.inner += number, (high**2).sum()
        self.bent += creases(found.phi_h, item["Phi"], mask)

    def summary(self) -> dict[str, list[float] | float]:
        """Measures of all views together.

        Returns
        -------
        dict
            edge_mae, edge_orders (radians, 0 to 1) by class of `DISTANCES`, edge_pixels their
            share; waves, the amplitude of each harmonic of the fringes in the error of phi_h,
            radians, and wave_share, their part of its variance; sharpness, by how much creases
            are as sharp as in truth: 1, or less where they are rounded. NaN where there was
            nothing to measure.
        """
        number, total, wrong = self.classes
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = self.power / self.inner[0]
            return {
                "edge_mae": (total / number).tolist(),
                "edge_orders": (wrong / number).tolist(),
                "edge_pixels": (number / number.sum()).tolist(),
                "waves": (2 * np.sqrt(mean)).tolist(),
                "wave_share": float(2 * self.power.sum() / self.inner[1]),
                "sharpness": float(self.bent[0] / self.bent[1]),
            }
