"""Photographs of a Gray code to the cells it numbers, and to orders of fringes (chapter 12)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise
from typing import NamedTuple

import cv2
import numpy as np

from fpputil.capture.faults.gamma import linearise
from fpputil.capture.photographs import Capture
from fpputil.capture.quality import Fit, Noise, Reason, mark
from fpputil.decoding.gray import NEAR, Cells, cell_column, gray_index, gray_order, read_cells
from fpputil.decoding.unwrap import TWO_PI, absolute_phase, fringe_order, wrap
from fpputil.optics.fringes import Fringe
from fpputil.optics.graycode import GrayCode

LINES = 64  # of the picture, in which faults of the code are looked for
BLOCK = 2**21  # grey levels that are worked on at a time
MISLED = 4  # cells of a code without fringes, by which bits in doubt may mislead it
APART = 2  # pixels, of the neighbours that are compared, so that an edge may lie between
LEAST = 50  # neighbours that tell something
FINEST = 2  # bits of a code alone, for which the camera may be too coarse
FAR = 8  # periods, or pairs of cells, above which it does not matter how far two neighbours part
ROUGH = 0.03  # of these, that neighbours may part by in the mean
BETTER = 0.6  # times as much, by which another reading of the bits is the likely one


class Reading(NamedTuple):
    """A Gray code as photographed.

    `code` and its `cells`; `words`, (bits, H, W), what each bit seems to be; `average` and
    `contrast`, (H, W), the mean of white and black, and half their difference, grey levels of 255.
    """

    code: GrayCode
    cells: Cells
    words: np.ndarray
    average: np.ndarray
    contrast: np.ndarray


def read_code(
    capture: Capture, axis: str, noise: Noise, gamma: float = 1.0, fringe: Fit | None = None
) -> Reading:
    """Read the Gray code along an axis. Chapter 12.

    A bit is told from its negative, if that was shown; else by the average of a fringe, or by the
    mean of the photographs in white and in black.

    Raises
    ------
    ValueError
        If there is none of these.
    """
    number, code = capture.patterns.code(axis)
    frames, plain = capture.frames(number), None
    if not code.inverse and fringe is None:
        if len(capture.of(-1)) != 2:
            raise ValueError(
                f"{capture.folder} has a Gray code alone; its threshold needs photographs in plain "
                "light and in none (white and black), or each picture's negative (inverse)"
            )
        plain = capture.frames(-1)
    rows = max(1, BLOCK // frames[:, 0].size)
    blocks = [slice(top, top + rows) for top in range(0, capture.size[0], rows)]
    how = (code, frames, plain, fringe, gamma, capture.full)
    read = [_read(*_signed(*how, block), noise) for block in blocks]
    joined = (np.concatenate(parts, axis=-2) for parts in zip(*read, strict=True))
    index, edge, reach, words, average, contrast = joined
    strong = np.abs(contrast) >= np.median(np.abs(contrast))
    if plain is not None and np.median(contrast[strong]) < 0:
        names = " and ".join(shot.file for shot in capture.of(-1))
        raise ValueError(f"{capture.folder}: {names} seem to be exchanged: white is the darker")
    return Reading(code, Cells(index, edge, reach), words, average, contrast)


def _signed(code: GrayCode, frames, plain, fringe, gamma: float, full: float, rows: slice):
    """Bits less their threshold in some rows; average; contrast; the noise of the first, squared.

    The last in terms of the noise of one photograph.
    """
    grey = linearise(frames[:, rows], gamma, full)
    if code.inverse:
        white, black = grey[0::2], grey[1::2]
        signed = (white - black) / 2
        return signed, (white[0] + black[0]) / 2, np.abs(signed).max(axis=0), 1 / 2
    if fringe is not None:  # an average of three photographs or more
        average = fringe.average[rows]
        return grey - average, average, fringe.modulation[rows], 4 / 3
    white, black = linearise(plain[:, rows], gamma, full)
    return grey - (white + black) / 2, (white + black) / 2, (white - black) / 2, 3 / 2


def _read(signed, average, contrast, share: float, noise: Noise):
    cells = read_cells(signed, contrast, np.sqrt(share * noise.variance(average)))
    return *cells, signed > 0, average, contrast


def unwrap_by_code(
    phis: Sequence[np.ndarray], fringes: Sequence[Fringe], reading: Reading, sigma: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Absolute phases of fringes, pitches descending, and where the first order is sure.

    `sigma`, (H, W), radians, is the noise of the first wrapped phase.
    """
    K, sure, off = gray_order(phis[0], reading.cells, reading.code, fringes[0].pitch, sigma)
    Phis = [absolute_phase(phis[0], K).astype(np.float32)]
    if reading.code.cell > fringes[0].pitch * 0.75:
        # Where a cell ends with the period, a phase that is turned, by a response or motion, may
        # take the wrong end; it then stands out from its neighbours by a whole order.
        spike = np.abs(Phis[0] - cv2.medianBlur(Phis[0], 5)) > np.pi
        sure &= ~(spike & (np.abs(off) > NEAR))
    for phi, (longer, fringe) in zip(phis[1:], pairwise(fringes), strict=True):
        K = fringe_order(phi, Phis[-1], longer.pitch / fringe.pitch)
        Phis.append(absolute_phase(phi, K))
    return Phis, sure


def cells_alone(reading: Reading, width: int, threshold: float) -> dict[str, np.ndarray]:
    """What a Gray code tells without fringes: of a `Measurement` the maps, by name. Chapter 12.

    The phase is that of the middle of the cell, or of its edge, and of a pitch that the whole code
    covers.
    """
    cells, code = reading.cells, reading.code
    column = np.where(cells.edge >= 0, code.edge(cells.edge), cell_column(cells, code))
    Phi = (column * (TWO_PI / code.pitch)).astype(np.float32)
    reason = np.zeros(column.shape, np.uint8)
    for fault, why in (
        (~(reading.contrast > threshold), Reason.DARK),
        (cells.reach > MISLED, Reason.UNSURE),
        (np.abs(column - (width - 1) / 2) > width / 2, Reason.OUTSIDE),
    ):
        mark(reason, fault, why)
    good = reason == Reason.GOOD
    spread = code.cell * (1 + 2 * cells.reach) / 12**0.5  # of cells in which it may lie, evenly
    return {
        "wrapped": wrap(Phi)[None],
        "modulation": reading.contrast[None].astype(np.float32),
        "average": reading.average.astype(np.float32),
        "Phi": np.where(good, Phi, np.nan),
        "sigma": np.where(good, spread * (TWO_PI / code.pitch), np.nan).astype(np.float32),
        "reason": reason,
        "offsets": np.empty(0),
        "sharpness": np.empty(0),
    }


def check_code(code: GrayCode, pitches: Sequence[float], width: int) -> None:
    """ValueError unless a code numbers the projector, in cells of at most a period."""
    if code.edge(2**code.bits) < width - 0.5:
        raise ValueError(
            f"a Gray code of {code.bits} bits in cells of {code.cell:g} given; it numbers "
            f"{code.edge(2**code.bits) + 0.5:g} pixels, and the projector has {width}"
        )
    if pitches and code.cell > pitches[0] * (1 + 1e-9):
        raise ValueError(
            f"cells of {code.cell:g} of a Gray code and pitch {pitches[0]:g} given; a cell is at "
            "most a period, or its order is ambiguous"
        )


def code_offset(reading: Reading, phi, fringe: Fringe, good) -> complex:
    """Circular mean of by how much the phase misses the code's edges, periods; 0 if none is seen.

    Between two neighbours of which one lies in the next cell, the phase is that of the edge.
    """
    along = 1 if fringe.axis == "column" else 0
    phi, index, good = (np.moveaxis(a, along, 1) for a in (phi, reading.cells.index, good))
    edge = (np.abs(np.diff(index)) == 1) & good[:, 1:] & good[:, :-1]
    later = np.maximum(index[:, 1:], index[:, :-1])[edge]
    middle = np.angle(np.exp(1j * phi[:, 1:][edge]) + np.exp(1j * phi[:, :-1][edge]))
    turns = np.exp(1j * (middle - fringe.phase(reading.code.edge(later))))
    return turns.mean() if turns.size >= 20 else 0j


def code_fault(reading: Reading, phi, pitch: float, axis: str, lit) -> tuple[str, str] | None:
    """How else the bits should be read: a key and the numbers of bits, None if they are right.

    Under the right reading the column hardly changes from pixel to pixel. `phi`, (H, W), is the
    wrapped phase of the fringe whose order the code tells, and `pitch` its pitch; None of a code
    alone.
    """
    maps = [lit & (reading.cells.edge < 0), *reading.words, *([] if phi is None else [phi])]
    maps = [np.moveaxis(m, 1 if axis == "column" else 0, 1) for m in maps]
    certain, *maps = (m[:: max(1, m.shape[0] // LINES)] for m in maps)
    bits = len(reading.words)
    words, phi = np.stack(maps[: bits if len(maps) > bits else bits - FINEST]), maps[bits:]
    changed = (words[:, :, APART:] != words[:, :, :-APART]).any(axis=0)
    pairs = certain[:, APART:] & certain[:, :-APART] & changed
    if pairs.sum() < LEAST:
        return None
    if phi:  # whole turns of the phase between two of a pair, by the slope of all
        one = np.exp(1j * np.diff(phi[0])) * (certain[:, 1:] & certain[:, :-1])
        turns = np.round((_apart(phi[0])[pairs] - APART * np.angle(one.sum())) / TWO_PI)

    def jumps(index) -> float:
        """By how many periods, or pairs of cells, the columns of the pairs part in the mean."""
        if phi:
            cells = Cells(index, np.full(index.shape, -1), np.zeros(index.shape, int))
            K, *_ = gray_order(phi[0], cells, reading.code, pitch)
            step = _apart(K)[pairs] + turns
        else:
            step = _apart(index / 2)[pairs]
            step = np.round(step - np.median(step))
        return float(np.minimum(np.abs(step), FAR).mean())

    now = jumps(gray_index(words))
    others = {what: jumps(index) for what, index in _readings(words)}
    best = min(others, key=others.get)
    return best if now > ROUGH and others[best] < BETTER * now else None


def _apart(values):
    return values[:, APART:] - values[:, :-APART]


def _readings(words) -> Iterator[tuple[tuple[str, str], np.ndarray]]:
    """Other readings of bits, each with its name."""
    bits = len(words)
    yield ("inverted", "all"), gray_index(~words)
    yield ("backwards", ""), gray_index(words[::-1])
    yield ("binary", ""), np.tensordot(2 ** np.arange(bits)[::-1], words, axes=1)
    for a, b in combinations(range(bits), 2):
        order = list(range(bits))
        order[a], order[b] = b, a
        yield ("bits", f"{a} and {b}"), gray_index(words[order])
    for a in range(bits):
        turned = words.copy()
        turned[a] = ~turned[a]
        yield ("inverted", str(a)), gray_index(turned)
