"""What the fringes of a capture say of each other's pitches and starts (chapter 12).

Their pictures are as coarse as their pitches, and their absolute phases agree; where they do not,
something was written down wrongly or shown late.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fpputil.capture.faults.findings import Finding, finding_of
from fpputil.capture.faults.mounting import local_gradients
from fpputil.capture.measurement import Measurement
from fpputil.capture.patterns import STARTS, Patterns
from fpputil.capture.quality import FEW, parted, start_offsets
from fpputil.decoding import unwrap

SPREAD = 0.05  # of the logarithms of pitches, from which their pictures tell which is the finer
PITCH_OFF = 0.25  # relative error of a pitch as the photographs show it
SURE = 0.6  # length of a circular mean, above which it tells something
OFFSET = 0.15  # of an order
SLIGHT = 0.05  # the same by beats or a code, where no ripple of a long pitch is multiplied
FITS = 0.05  # of an order, by which a start may miss the offsets that it explains
AGREED = 0.95  # cosine of the mean of what pitches are apart, from which on they agree
MIDDLING = 0.12  # of the grey levels, at most, between dark and bright in square fringes


def fringe_name(m: Measurement, k: int) -> str:
    """How messages name the k-th fringe of a measurement."""
    return f"pitch {m.fringes[k].pitch:g} along the {m.axis}s"


def looks_square(frames) -> bool:
    """Whether nearly all grey levels of photographs (N, S) are either dark or bright."""
    low, span = frames.min(axis=0), np.ptp(frames, axis=0)
    levels = ((frames - low) / np.maximum(span, 1))[:, span > 40]
    return levels.size > 0 and ((levels > 0.15) & (levels < 0.85)).mean() < MIDDLING


def pitch_findings(m, frequencies) -> Iterator[Finding]:
    """Fringes whose pictures are as coarse as another one's should be."""
    if m.lit.sum() < 1000 or np.median(m.modulation[:, m.lit]) < 16:
        return  # a slow fringe cannot be told from noise
    if len(frequencies) < 2 or not (frequencies >= 1e-3).all():
        return
    if any(looks_square(frames) for frames in m.sample):
        return  # their phase goes up in stairs
    declared = np.array([f.pitch for f in m.fringes])

    def spread(pitches):  # frequency times pitch is the same for all, if they are right
        return np.ptp(np.log(frequencies * pitches))

    limit = 2 * np.log1p(PITCH_OFF)
    nearest = np.diff(np.sort(declared)).min()
    if spread(declared) < limit or nearest < PITCH_OFF * declared.min():
        return
    pitches = ", ".join(f"{p:g}" for p in declared)
    best = declared.copy()
    best[np.argsort(frequencies)] = np.sort(declared)[::-1]  # the coarser the longer
    if spread(best) < limit:
        yield finding_of("swapped", pitches=pitches, likely=", ".join(f"{p:g}" for p in best))
    else:
        likely = ", ".join(f"{declared[0] * frequencies[0] / f:.3g}" for f in frequencies)
        yield finding_of("pitch", pitches=pitches, axis=m.axis, likely=likely)


def offset_findings(m, capture) -> Iterator[Finding]:
    """Pitches that disagree by the same share everywhere, or everywhere differently."""
    start = likely_start(m, capture.patterns)
    start = f"give --start {start} if all fringes begin so at column 0; else " if start else ""
    coded = m.reading is not None
    beats = capture.patterns.unwrap == "mw"
    beats &= not unwrap.covers(m.fringes[-1].pitch, capture.patterns.width(m.axis))
    for k, (offset, sharpness) in enumerate(zip(m.offsets, m.sharpness, strict=True), -coded):
        first = fringe_name(m, k) if k >= 0 else f"the Gray code along the {m.axis}s"
        pair = f"{first} and pitch {m.fringes[k + 1].pitch:g}"
        if abs(offset) > (SLIGHT if beats or k < 0 else OFFSET) and sharpness > SURE / 2:
            began = [
                f"pitch {m.fringes[j].pitch:g} began with step {step}"
                for j, step in _late(m, capture.patterns)
            ]
            late = f"; it looks as if {' or '.join(began)}" if began else ""
            if late or sharpness > SURE:
                yield finding_of("offset", pair=pair, offset=offset, start=start, late=late)
        elif sharpness < SURE / 2 and m.lit.any():
            periods = "these look like periods, not pitches (--periods); else "
            yield finding_of(
                "disagree", pair=pair, periods=periods if _look_like_periods(m) else ""
            )


def _look_like_periods(m: Measurement) -> bool:
    """Whether the fringes are the finer in the picture the larger their pitches are said to be."""
    pitches = np.array([f.pitch for f in m.fringes])
    frequencies = np.linalg.norm(local_gradients(m), axis=1)
    if np.ptp(np.log(pitches)) < SPREAD or not (frequencies > 1e-3).all():
        return False
    return np.polyfit(np.log(pitches), np.log(frequencies), 1)[0] > 0.5  # it should be -1


def likely_start(m: Measurement, patterns: Patterns) -> str:
    """The usual start of all fringes that explains the offsets between them, "" if none does."""
    clear = m.sharpness > SURE
    if not clear.any() or any(f.start for f in m.fringes):
        return ""
    pitches, width = [f.pitch for f in m.fringes], patterns.width(m.axis)

    def miss(degrees):
        offsets = start_offsets(pitches, patterns.unwrap, width, degrees / 360)
        return np.abs((m.offsets - offsets + 0.5) % 1 - 0.5)[clear].max()

    # Others than the usual ones would also explain a single pitch that begins with another step.
    usual = [*STARTS.items(), *((str(d), d) for d in (90, 120, -120))]
    return " or ".join(name for name, degrees in usual if miss(degrees) < FITS)


def _late(m, patterns) -> list[tuple[int, int]]:
    """Pitches, by number, and the steps with which they would begin if all then agree."""
    if patterns.unwrap not in unwrap.TEMPORAL:
        return []
    method, pitches = unwrap.TEMPORAL[patterns.unwrap], [f.pitch for f in m.fringes]
    few, width = m.wrapped[:, ::FEW, ::FEW][:, m.lit[::FEW, ::FEW]], patterns.width(m.axis)
    exact, agree = [np.float32(0)] * len(pitches), {}
    for j, fringe in enumerate(m.fringes):
        for step in range(1, fringe.steps):
            phis = list(few)
            phis[j] = unwrap.wrap(phis[j] - patterns.shift * unwrap.TWO_PI * step / fringe.steps)
            Phis = method(phis, pitches, width)
            apart = [
                np.nanmean(np.exp(1j * unwrap.TWO_PI * orders))
                for orders, _ in parted(Phis, pitches, exact, patterns.unwrap, width)
            ]
            if all(a.real > AGREED * abs(a) for a in apart):
                agree[j, step] = sum(a.real for a in apart)
    best = max(agree.values(), default=0.0)
    enough = max(best - 0.02, len(apart) * SURE / 2) if agree else 0.0
    return [key for key, value in agree.items() if value > enough]
