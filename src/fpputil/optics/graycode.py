"""Gray code: black and white stripes that number the projector's columns (chapter 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fpputil.checks import finite, positive, whole
from fpputil.optics.fringes import WHITE


@dataclass(frozen=True)
class GrayCode:
    """Pictures of a reflected binary code, the most significant bit first. Chapter 4.

    Pixel i of the projector, column or row, lies in cell ``c = floor((i + shift) / cell)``. Picture
    n is white where bit n of ``c XOR (c >> 1)`` is 1: from one cell to the next one bit changes.

    Parameters
    ----------
    cell : float
        Projector pixels of the narrowest stripe.
    bits : int
        Pictures; they number 2 ** bits cells.
    axis : {"column", "row"}
        Coordinate that is numbered.
    shift : float
        Projector pixels by which the cells begin before pixel 0.
    inverse : bool
        After each picture its negative is shown, too, which spares a threshold.

    Examples
    --------
    >>> code = GrayCode(cell=2, bits=2)
    >>> [code.intensity([0, 2, 4, 6], n).tolist() for n in range(code.steps)]
    [[0.0, 0.0, 255.0, 255.0], [0.0, 255.0, 255.0, 0.0]]
    """

    cell: float
    bits: int
    axis: str = "column"
    shift: float = 0.0
    inverse: bool = False

    ideal = False  # of `View`: no sinusoid
    start = 0.0

    def __post_init__(self):
        positive("cell", self.cell, "projector pixels")
        whole("bits", self.bits, 1, 15)
        finite("shift", self.shift)
        if self.axis not in ("column", "row"):
            raise ValueError(f"axis {self.axis!r} given; a code numbers 'column' or 'row'")
        if not isinstance(self.inverse, bool):
            raise ValueError(f"inverse {self.inverse!r} given; true or false is needed")

    @property
    def steps(self) -> int:
        """Number of pictures."""
        return self.bits * (2 if self.inverse else 1)

    @property
    def pitch(self) -> float:
        """Projector pixels that the code numbers."""
        return self.cell * 2**self.bits

    def intensity(self, coordinate: np.ndarray, n: int) -> np.ndarray:
        """Light of picture n, 0 or 255, at projector columns (or rows), (...), of sharp pixels."""
        pixel = np.floor(np.asarray(coordinate, np.float64) + 0.5)
        c = np.floor((pixel + self.shift) / self.cell).astype(np.int64)
        n, negative = divmod(n, 2) if self.inverse else (n, 0)
        bit = ((c ^ (c >> 1)) >> (self.bits - 1 - n)) & 1
        return WHITE * (bit != negative)

    def edge(self, c):
        """Projector coordinate, pixels, at which cell c begins: half a pixel before its first one.

        >>> GrayCode(2.5, 4).edge(np.arange(4)).tolist()
        [-0.5, 2.5, 4.5, 7.5]
        """
        return np.ceil(np.asarray(c) * self.cell - self.shift - 1e-9) - 0.5


def gray_code(
    pitch: float, width: int, kind: str = "complementary", axis: str = "column", inverse=False
) -> GrayCode:
    """The code that tells the order of fringes of a pitch on a projector so wide. Chapter 4.

    ``plain`` has a cell a period; ``shifted`` has cells that begin half a period before it;
    ``complementary`` has two cells a period, by one bit more.

    >>> gray_code(16, 1024), gray_code(16, 1024, "plain").bits
    (GrayCode(cell=8.0, bits=7, axis='column', shift=0.0, inverse=False), 6)
    """
    if kind not in KINDS:
        raise ValueError(f"code {kind!r} given; one of {', '.join(KINDS)} is needed")
    divisor, part = KINDS[kind]
    cell, shift = pitch / divisor, pitch * part
    bits = max(1, math.ceil(math.log2(math.ceil((width + shift) / cell - 1e-9))))
    return GrayCode(cell, bits, axis, shift, inverse)


KINDS = {"complementary": (2, 0.0), "plain": (1, 0.0), "shifted": (1, 0.5)}
"""Of each code with fringes how many cells a period has, and by what share of one they are shifted.
"""
