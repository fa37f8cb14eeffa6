"""Fringe patterns: what the projector shows (paper, Eq. 1; chapter 1)."""

from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Integral

import numpy as np
from scipy.special import ndtr

from fpputil.checks import at_most, finite, not_negative, positive, whole

WHITE = 255.0


@dataclass(frozen=True)
class Fringe:
    """One phase-shifted set of sinusoidal patterns (paper, Eq. 1).

    ``I_n = 255/2 (1 + cos(2 pi i / pitch + delta_n))`` with ``delta_n = start + 2 pi n / steps``,
    ``n = 0 .. steps-1`` and ``i`` the projector column (or row). Chapter 1.

    Parameters
    ----------
    pitch : float
        Projector pixels per period.
    steps : int
        Number of phase shifts N.
    axis : {"column", "row"}
        Coordinate along which the intensity varies: "column" gives vertical fringes,
        "row" horizontal ones.
    gamma : float
        Response of the projector: the normalised intensity is raised to this power.
    levels : int or None
        Grey levels of the projector (256 for 8 bit); None leaves the pattern unquantised.
    grid : bool
        True keeps one intensity over each projector pixel; False is a continuous slide.
    defocus : float
        Standard deviation of the Gaussian blur in projector pixels; it acts on the pixel grid.
        The pattern is taken to go on beyond the projector's border.
    start : float
        Phase of step 0 at coordinate 0, radians: 0 is a cosine, -pi/2 a sine.

    Examples
    --------
    >>> Fringe(pitch=15, steps=4).shifts.round(2).tolist()
    [0.0, 1.57, 3.14, 4.71]
    """

    pitch: float
    steps: int = 15
    axis: str = "column"
    gamma: float = 1.0
    levels: int | None = None
    grid: bool = False
    defocus: float = 0.0
    start: float = 0.0

    def __post_init__(self):
        positive("pitch", self.pitch, "projector pixels")
        if not isinstance(self.steps, Integral) or self.steps < 3:
            raise ValueError(
                f"{self.steps} steps given; average, modulation and phase are three unknowns, "
                "so phase shifting needs a whole number of 3 steps or more"
            )
        at_most("steps", self.steps, "FPP_MOST_PHOTOGRAPHS")
        if self.axis not in ("column", "row"):
            raise ValueError(f"axis {self.axis!r} given; fringes vary along 'column' or 'row'")
        positive("gamma", self.gamma)
        if self.levels is not None:
            whole("levels", self.levels, 2)
        not_negative("defocus", self.defocus, "pixels")
        finite("start", self.start)

    @property
    def shifts(self) -> np.ndarray:
        """Phase shifts delta_n in radians, shape (N,)."""
        return self.start + 2 * np.pi * np.arange(self.steps) / self.steps

    @property
    def ideal(self) -> bool:
        """True if the pattern is the sinusoid of Eq. 1 itself."""
        return self.gamma == 1 and self.levels is None and not self.grid and self.defocus == 0

    def phase(self, coordinate: np.ndarray) -> np.ndarray:
        """Absolute phase Phi = 2 pi i / pitch, in radians, of projector coordinates."""
        return 2 * np.pi * np.asarray(coordinate, np.float64) / self.pitch

    def intensity(self, coordinate: np.ndarray, n: int) -> np.ndarray:
        """Light 0 to 255 of pattern n, 0 to ``steps`` - 1, at continuous projector coordinates.

        `coordinate`, (...), is a projector column (or row) in pixels, centres at integers.

        Examples
        --------
        >>> Fringe(24, steps=4).intensity([0, 6, 12], n=0).round(6).tolist()
        [255.0, 127.5, 0.0]
        """
        i = np.asarray(coordinate, np.float64)
        if self.defocus == 0:
            return self.light(np.floor(i + 0.5) if self.grid else i, n)
        centre = np.floor(i + 0.5)
        reach = int(np.ceil(5 * self.defocus)) + 1
        total = np.zeros_like(i)
        for k in range(-reach, reach + 1):  # the share of each pixel's light that falls on i
            left = (centre + k - 0.5 - i) / self.defocus
            total += (ndtr(left + 1 / self.defocus) - ndtr(left)) * self.light(centre + k, n)
        return total

    def light(self, coordinate: np.ndarray, n: int) -> np.ndarray:
        """Light of pattern n as `intensity`, but before the lens: no pixel grid, no defocus."""
        value = self._buffer(coordinate, n)
        return value if self.gamma == 1 else WHITE * (value / WHITE) ** self.gamma

    def images(self, width: int, height: int) -> np.ndarray:
        """The patterns as the projector's frame buffer holds them, (N, H, W).

        uint8 for 256 levels, float64 otherwise. Gamma and defocus belong to the optics, so they
        do not show here.

        Examples
        --------
        >>> Fringe(24, steps=4, levels=256).images(912, 1140).shape
        (4, 1140, 912)
        """
        line = np.arange(width if self.axis == "column" else height)
        rows = np.stack([self._buffer(line, n) for n in range(self.steps)])
        rows = rows.astype(np.uint8) if self.levels == 256 else rows
        rows = rows[:, None, :] if self.axis == "column" else rows[:, :, None]
        return np.ascontiguousarray(np.broadcast_to(rows, (self.steps, height, width)))

    def _buffer(self, i, n):
        value = WHITE / 2 * (1 + np.cos(self.phase(i) + self.shifts[n]))
        if self.levels is None:
            return value
        top = self.levels - 1
        return np.rint(value / WHITE * top) * (WHITE / top)


def fringe_set(pitches: Iterable[float], steps: int | Iterable[int] = 15, **options):
    """Fringes of several pitches, a tuple of `Fringe`, as temporal unwrapping needs them.

    Pitches in projector pixels per period, steps of all or of each; `options` of every `Fringe`.

    >>> [f.pitch for f in fringe_set((912, 114, 15))]
    [912, 114, 15]
    """
    pitches = tuple(np.atleast_1d(pitches).tolist())
    each = (steps,) * len(pitches) if np.ndim(steps) == 0 else tuple(steps)
    if not pitches or len(each) != len(pitches):
        raise ValueError(
            f"{len(pitches)} pitches and {len(each)} step counts given; "
            "each of at least one pitch needs its number of steps"
        )
    return tuple(Fringe(p, n, **options) for p, n in zip(pitches, each, strict=True))
