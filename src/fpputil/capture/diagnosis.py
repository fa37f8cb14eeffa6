"""What is wrong with a capture, by name, and what to change in the setup (chapter 12).

Each check looks for one fault that a decoder would otherwise turn into plausible numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations
from typing import NamedTuple

import cv2
import numpy as np

from fpputil.capture.gamma import LEAST_STEPS, harmonic_ratio, linearise
from fpputil.capture.marking import Reason
from fpputil.capture.measurement import Measurement
from fpputil.capture.photographs import Capture
from fpputil.capture.steps import exchanged, misfits, strong

SHARE = 0.02  # of the lit pixels, above which a fault of pixels is one of the setup
HARMONIC = 0.02  # second harmonic over the fringe, above which a response counts as not linear
PITCH_OFF = 0.25  # relative error of a pitch as the photographs show it
SURE = 0.6  # length of a circular mean, above which it tells something
OFFSET = 0.15  # of an order step
SMOOTH = (9, 9)  # pixels, over which the local frequency is averaged


ORDER = ("offset", "disagree", "orders")
FOLLOW = {
    **dict.fromkeys(("frame", "exchanged"), (*ORDER, "response")),
    **dict.fromkeys(("swapped", "pitch", "direction"), ORDER),
    "offset": ("orders",),
    **dict.fromkeys(("dark", "saturated"), (*ORDER[1:], "noise", "pitch", "response")),
    "clipped": ("response",),
}
"""Doubts that another one explains, and that are not told beside it."""


class Finding(NamedTuple):
    """One finding.

    Parameters
    ----------
    code : str
        A word for machines.
    severe : bool
        True if the phases are wrong, not only noisier or fewer.
    found, remedy : str
        For people.
    """

    code: str
    severe: bool
    found: str
    remedy: str


def diagnose(scan: Measurement, capture: Capture) -> list[Finding]:
    """All that speaks against a scan, the severe first. Chapter 12."""
    checks = (_repeated, _frequencies, _offset, _saturation, _projector, _response, _orders,
              _darkness, _contrast, _noise)  # fmt: skip
    found = [doubt for check in checks for doubt in check(scan, capture)]
    codes = {doubt.code for doubt in found}
    follow = {f for cause, effects in FOLLOW.items() if cause in codes for f in effects}
    found = [doubt for doubt in found if doubt.code not in follow]
    return sorted(found, key=lambda doubt: not doubt.severe)


def local_frequencies(scan: Measurement) -> np.ndarray:
    """Median local frequency of each pitch across the picture, radians a pixel, (P,); signed.

    From left to right for fringes along columns, downwards for those along rows. Above pi a
    pixel it wraps, and tells nothing.
    """
    along = 1 if scan.axis == "column" else 0
    lit = scan.reason != Reason.DARK
    found = []
    for phi in scan.wrapped:
        phasor = np.exp(1j * phi)
        turn = np.roll(phasor, -1, along) * phasor.conj() * (lit & np.roll(lit, -1, along))
        parts = (cv2.boxFilter(np.ascontiguousarray(p, np.float32), -1, SMOOTH)
                 for p in (turn.real, turn.imag))  # fmt: skip
        real, imaginary = parts
        found.append(np.median(np.arctan2(imaginary, real)[lit]) if lit.any() else np.nan)
    return np.array(found)


def _name(scan: Measurement, k: int) -> str:
    return f"pitch {scan.fringes[k].pitch:g} along the {scan.axis}s"


def _repeated(scan, capture) -> Iterator[Finding]:
    """Photographs that do not fit the sinusoid of the others, or would fit in another place."""
    numbers = [k for k, f in enumerate(capture.patterns.fringes) if f.axis == scan.axis]
    for k, (frames, number) in enumerate(zip(scan.sample, numbers, strict=True)):
        frames = strong(linearise(frames, scan.power))
        if frames.shape[1] < 20:
            continue
        files = [shot.file for shot in capture.of(number)]
        bad, pair = misfits(frames), exchanged(frames)
        if pair:
            yield Finding(
                "exchanged", True, f"{files[pair[0]]} and {files[pair[1]]} are exchanged",
                "exchange their names",
            )  # fmt: skip
        elif bad:
            names = ", ".join(files[n] for n in bad)
            yield Finding(
                "frame", True, f"{names}: does not fit the other steps of {_name(scan, k)}",
                "photograph again: a trigger was missed, a step was shown twice or too late, or "
                "the light changed",
            )  # fmt: skip


def _frequencies(scan, capture) -> Iterator[Finding]:
    """What the local frequencies tell of the pitches and of the direction."""
    found = local_frequencies(scan)
    yield from _pitches(scan, np.abs(found))
    yield from _direction(scan, capture, found)


def _pitches(scan, found) -> Iterator[Finding]:
    """Fringes whose pictures are as coarse as another one's should be."""
    lit = scan.reason != Reason.DARK
    if lit.sum() < 1000 or np.median(scan.modulation[:, lit]) < 16:
        return  # a slow fringe cannot be told from noise
    if len(found) < 2 or not np.isfinite(found).all() or (found < 1e-3).any():
        return
    declared = np.array([f.pitch for f in scan.fringes])

    def off(pitches):
        logs = np.log(found * pitches)
        return np.ptp(logs)

    limit = 2 * np.log1p(PITCH_OFF)
    nearest = np.abs(np.subtract.outer(declared, declared))[~np.eye(len(declared), dtype=bool)]
    if off(declared) < limit or nearest.min() < PITCH_OFF * declared.min():
        return
    best = min(permutations(declared), key=off) if len(declared) <= 6 else tuple(declared)
    shown = ", ".join(f"{p:g}" for p in declared)
    if off(np.array(best)) < limit:
        yield Finding(
            "swapped", True, f"the fringes called {shown} look like "
            + ", ".join(f"{p:g}" for p in best),
            "exchange the names of the photographs, or the pitches in the pattern file",
        )  # fmt: skip
    else:
        seen = ", ".join(f"{declared[0] * found[0] / f:.3g}" for f in found)
        yield Finding(
            "pitch", True, f"pitches {shown} along the {scan.axis}s are given; the photographs "
            f"show {seen}, if the first is right", "give the pitches that were projected",
        )  # fmt: skip


def _direction(scan, capture, found) -> Iterator[Finding]:
    """Phases that fall where projector coordinates should grow."""
    clear = np.abs(found) > 1e-3
    if not clear.any() or np.median(np.sign(found[clear])) > 0:
        return
    way = "from right to left" if scan.axis == "column" else "upwards"
    yield Finding(
        "direction", True, f"the projector's {scan.axis}s grow {way} in the picture",
        f"give shift {-capture.patterns.shift}: the steps go the other way; if they do not, the "
        "projector or the camera is mirrored or upside down: set it right, or use --accept",
    )  # fmt: skip


def _offset(scan, capture) -> Iterator[Finding]:
    """Pitches that disagree by the same share everywhere, or everywhere differently."""
    for k, (offset, sharpness) in enumerate(zip(scan.offsets, scan.sharpness, strict=True)):
        pair = f"{_name(scan, k)} and pitch {scan.fringes[k + 1].pitch:g}"
        if sharpness > SURE and abs(offset) > OFFSET:
            yield Finding(
                "offset", True, f"the phases of {pair} are apart by {offset:+.2f} of an order "
                "everywhere", "check that both begin with step 0 and have the steps that were "
                "projected",
            )  # fmt: skip
        elif sharpness < SURE / 2 and (scan.reason != Reason.DARK).any():
            yield Finding(
                "disagree", True, f"the phases of {pair} do not belong together",
                "check pitches, their order, the direction of the shift and the unwrapping; or "
                "the noise is far too high for these pitches",
            )  # fmt: skip


def _share(scan, reason) -> float:
    lit = (scan.reason != Reason.DARK).sum()
    return float((scan.reason == reason).sum() / max(lit, 1))


def _saturation(scan, capture) -> Iterator[Finding]:
    share = _share(scan, Reason.SATURATED)
    if share > SHARE:
        yield Finding(
            "saturated", share > 0.5, f"the camera is saturated at {share:.0%} of the lit pixels",
            "expose less, or close the aperture, until no fringe reaches full scale",
        )  # fmt: skip


def _projector(scan, capture) -> Iterator[Finding]:
    """Fringes whose bright halves are flat although the camera is not saturated."""
    for k, frames in enumerate(scan.sample):
        if len(frames) < 6:
            continue
        low, high = frames.min(axis=0), frames.max(axis=0)
        use = (high - low > 40) & (high < 0.97 * 255)
        if use.sum() < 20:
            continue
        bright = (frames[:, use] > high[use] - 0.04 * (high - low)[use] - 1).mean()
        if bright > 0.24 + 0.5 / len(frames):
            yield Finding(
                "clipped", True, f"the bright halves of {_name(scan, k)} are flat, below the "
                "camera's full scale", "the projector is saturated: lower its brightness and "
                "contrast to their neutral values, or project with less amplitude",
            )  # fmt: skip
            return


def _response(scan, capture) -> Iterator[Finding]:
    """A second harmonic, where a pitch has too few steps for it to fall out."""
    if min(f.steps for f in scan.fringes) >= LEAST_STEPS:
        return
    for frames in scan.sample:
        frames = linearise(frames, scan.power)
        if len(frames) < LEAST_STEPS:
            continue
        use = (np.ptp(frames, axis=0) > 40) & (frames.max(axis=0) < 0.97 * 255)
        second = harmonic_ratio(frames[:, use], 2) if use.sum() > 20 else 0.0
        if abs(second) > HARMONIC:
            yield Finding(
                "response", False, f"the response is not linear: the second harmonic is "
                f"{second:+.1%} of the fringe", "give --power, from a capture of five steps or "
                "more with the same setup; with three or four steps it turns the phase by about "
                "as many radians",
            )  # fmt: skip
            return


def _orders(scan, capture) -> Iterator[Finding]:
    share = _share(scan, Reason.UNSURE)
    if share > SHARE:
        yield Finding(
            "orders", False, f"the order is a guess at {share:.0%} of the lit pixels",
            "take more steps at the long pitches, or a pitch between two that are far apart",
        )  # fmt: skip


def _darkness(scan, capture) -> Iterator[Finding]:
    dark = (scan.reason == Reason.DARK).mean()
    modulation = scan.modulation.min(axis=0)
    level = float(np.median(modulation[scan.reason != Reason.DARK])) if dark < 1 else 0.0
    if dark > 0.98 or level < 20 and _share(scan, Reason.SATURATED) < 0.5:
        yield Finding(
            "dark", not scan.mask.any(), f"{1 - dark:.1%} of the pixels are lit, with a median "
            f"modulation of {level:.0f} grey levels",
            "expose longer, open the aperture, or darken the room",
        )  # fmt: skip


def _contrast(scan, capture) -> Iterator[Finding]:
    lit = scan.reason != Reason.DARK
    if not lit.any():
        return
    contrast = float(np.median(scan.modulation[scan.finest][lit] / scan.average[lit]))
    if contrast < 0.3:
        yield Finding(
            "contrast", False, f"the modulation of the finest pitch is {contrast:.0%} of the "
            "light: the rest is noise without use", "darken the room, focus the projector and the "
            "camera on the object, or project a longer pitch",
        )  # fmt: skip


def _noise(scan, capture) -> Iterator[Finding]:
    if not scan.noise.known:
        yield Finding(
            "noise", False, "so few steps do not tell the noise, nor whether the response is "
            "linear; the uncertainty counts the rounding of grey levels alone", "take five steps "
            "or more at one pitch, or give --noise and --power",
        )  # fmt: skip
