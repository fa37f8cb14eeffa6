"""Gray code: black and white stripes to the order of a fringe (chapter 4).

One bit changes from a cell of the code to the next, so a pixel on an edge has one bit in doubt, and
that bit tells which edge it is. The phase then says on which side of it the pixel lies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fpputil.decoding.unwrap import TWO_PI
from fpputil.optics.graycode import GrayCode

DOUBT = 0.5  # of the contrast, below which a bit may be that of an edge
FAINT = 0.25  # of the contrast, below which any other bit is a guess
SURE = 5.0  # standard deviations of the noise, within which a bit or an order is a guess
NEAR = 0.25  # of a period off the middle of a cell, from which the edge counts


class Cells(NamedTuple):
    """What a Gray code says of each pixel, (H, W) arrays.

    `index` of the cell; `edge`, the index of the cell that begins at the edge on which the pixel
    lies, -1 if it lies on none; `reach`, the number of cells by which bits in doubt, but for that
    of the edge, may have misled the index.
    """

    index: np.ndarray
    edge: np.ndarray
    reach: np.ndarray


def gray_index(bits) -> np.ndarray:
    """Number of a reflected binary code, of bools (N, ...), the most significant bit first.

    >>> gray_index(np.array([[0, 0, 1, 1], [0, 1, 1, 0]], bool)).tolist()
    [0, 1, 2, 3]
    """
    bits = np.asarray(bits, bool)
    index, bit = np.zeros(bits.shape[1:], np.int32), np.zeros(bits.shape[1:], bool)
    for gray in bits:
        bit = bit ^ gray
        index = 2 * index + bit
    return index


def read_cells(signed: np.ndarray, contrast, noise=0.0) -> Cells:
    """Cells of a Gray code out of its photographs. Chapter 4.

    Parameters
    ----------
    signed : (bits, H, W) array
        Photographs less their threshold, or less that of the negative; grey levels.
    contrast : (H, W) array
        What a bit is above its threshold where it is no edge, grey levels.
    noise : float or (H, W) array
        Standard deviation of `signed`, grey levels.

    Examples
    --------
    >>> signed = 100.0 * np.array([[-1, -1, 0.1, 1], [-1, 1, 1, 1]])[:, None]
    >>> cells = read_cells(signed, 100.0)
    >>> cells.index.tolist(), cells.edge.tolist()  # the third pixel lies where cell 2 begins
    ([[0, 1, 2, 2]], [[-1, -1, 2, -1]])
    """
    index = gray_index(signed > 0)
    margin = np.abs(signed)
    weakest = margin.argmin(axis=0)
    least = margin.min(axis=0)
    turned = [index ^ ((2 << k) - 1) for k in range(len(signed) - 1, -1, -1)]  # one bit each
    other = np.take_along_axis(np.stack(turned), weakest[None], axis=0)[0]
    on_edge = (np.abs(other - index) == 1) & (least < DOUBT * contrast)
    on_edge &= (1 - DOUBT) * contrast > SURE * noise  # or noise alone would do
    np.put_along_axis(margin, weakest[None], np.where(on_edge, np.inf, least)[None], axis=0)
    faint = np.maximum(FAINT * contrast, SURE * noise)
    reach = sum((m < faint) * np.abs(t - index) for m, t in zip(margin, turned, strict=True))
    return Cells(index, np.where(on_edge, np.maximum(index, other), -1), reach)


def cell_column(cells: Cells, code: GrayCode) -> np.ndarray:
    """Projector column (or row) of the middle of each pixel's cell, (H, W), pixels.

    >>> bits = 100.0 * np.array([[-1, -1], [-1, 1]])[:, None]
    >>> cell_column(read_cells(bits, 100.0), GrayCode(cell=2, bits=2)).tolist()
    [[0.5, 2.5]]
    """
    return (code.edge(cells.index) + code.edge(cells.index + 1)) / 2


def gray_order(phi, cells: Cells, code: GrayCode, pitch: float, sigma=0.0):
    """Order K of a fringe by a Gray code, and where it is sure. Chapter 4.

    The order is that whose column lies nearest to the middle of the cell; so a cell of half a
    period may be misread by one. Farther from the middle than `NEAR`, the edge stands in for the
    middle on which the pixel lies; without one, the order is a guess within `SURE` standard
    deviations of the phase.

    Parameters
    ----------
    phi : (H, W) array
        Wrapped phase, radians.
    cells, code
        As of `read_cells`, and the code that was shown.
    pitch : float
        Projector pixels.
    sigma : float or (H, W) array
        Standard deviation of `phi`, radians.

    Returns
    -------
    K : (H, W) array
    sure : (H, W) bool array
    off : (H, W) array
        By how much the middle of the cell misses the column, periods, -0.5 to 0.5.

    Examples
    --------
    >>> from fpputil.decoding.unwrap import wrap
    >>> code, column = GrayCode(cell=8, bits=3), np.array([[3.0, 20.0, 60.0]])
    >>> bits = np.stack([code.intensity(column, n) for n in range(3)])
    >>> cells = read_cells(bits - 127.5, 127.5)
    >>> K, sure, off = gray_order(wrap(TWO_PI * column / 16), cells, code, 16)
    >>> K.tolist(), sure.tolist()
    ([[0.0, 1.0, 4.0]], [[True, True, True]])
    """
    turns = np.asarray(phi) / TWO_PI
    at = cell_column(cells, code) / pitch - turns
    K = np.round(at)
    off = at - K
    near = np.abs(off) > NEAR
    on_edge = near & (cells.edge >= 0)
    K = np.where(on_edge, np.round(code.edge(cells.edge) / pitch - turns), K)
    clear = cells.reach <= (1 if code.cell <= pitch / 2 * (1 + 1e-9) else 0)
    # A period farther on the column must lie outside the cell, which may be the longer by a pixel.
    half = (code.edge(cells.index + 1) - code.edge(cells.index)) / (2 * pitch)
    room = np.minimum(0.5, 1 - half) - np.abs(off)
    sure = clear & (~near | on_edge | (room * TWO_PI > SURE * sigma))
    return K, sure, off
