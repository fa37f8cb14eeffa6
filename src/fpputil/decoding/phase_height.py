"""Phase to height by a polynomial at each pixel, from reference planes (chapter 6)."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class PhaseHeight:
    """A polynomial at each pixel that turns absolute phase into height. Chapter 6.

    Parameters
    ----------
    centre, scale : (H, W) arrays
        Phase is taken as ``(Phi - centre) / scale``, within -1 to 1 on the planes fitted.
    coefficients : (degree + 1, H, W) array
        Constant term first, mm.
    """

    centre: np.ndarray
    scale: np.ndarray
    coefficients: np.ndarray

    def height(self, Phi: np.ndarray) -> np.ndarray:
        """Height, (H, W), mm, of an absolute phase (H, W)."""
        if np.shape(Phi) != self.centre.shape:
            raise ValueError(f"phase of shape {np.shape(Phi)} given; {self.centre.shape} is needed")
        x = (Phi - self.centre) / self.scale
        return np.polynomial.polynomial.polyval(x, self.coefficients, tensor=False)


def fit_phase_height(Phi: np.ndarray, heights, degree: int = 1) -> PhaseHeight:
    """Fit height as a polynomial of phase at each pixel from reference planes. Chapter 6.

    Parameters
    ----------
    Phi : (P, H, W) array
        Absolute phase on each plane, radians; a pixel that is NaN on any plane stays NaN.
    heights : (P,) array
        Heights of the planes, mm.
    degree : int
        1 for the linear model, 2 or more for the polynomial one.

    Examples
    --------
    >>> Phi = np.array([1.0, 2.0, 3.0])[:, None, None] * np.ones((2, 2))  # of three planes
    >>> model = fit_phase_height(Phi, [600, 650, 700])
    >>> float(model.height(np.full((2, 2), 2.5))[0, 0].round(6))
    675.0
    """
    heights, Phi = np.asarray(heights, np.float64), np.asarray(Phi, np.float64)
    if not np.isfinite(heights).all():
        raise ValueError(f"heights {heights.tolist()} given; all must be finite")
    if Phi.ndim != 3 or len(Phi) != len(heights) or len(heights) <= degree or degree < 1:
        raise ValueError(
            f"{len(heights)} heights, phases of shape {Phi.shape} and degree {degree} given; "
            "a fit needs (P, H, W) phases of P planes, P above the degree, degree 1 or more"
        )
    low, high = Phi.min(axis=0), Phi.max(axis=0)
    centre, scale = (low + high) / 2, np.where(high > low, (high - low) / 2, np.nan)
    known = np.isfinite(scale)
    x = ((Phi - centre) / scale)[:, known].T
    powers = x[..., None] ** np.arange(degree + 1)
    coefficients = np.full((degree + 1, *scale.shape), np.nan)
    coefficients[:, known] = (np.linalg.pinv(powers) @ heights).T
    return PhaseHeight(centre, scale, coefficients)
