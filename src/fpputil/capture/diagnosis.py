"""What is wrong with a capture, by name, and what to change in the setup (chapter 12).

Each check looks for one fault that a decoder would otherwise turn into plausible numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import cv2
import numpy as np

from fpputil.capture.coding import code_fault
from fpputil.capture.gamma import LEAST_STEPS, harmonic_ratio, linearise
from fpputil.capture.measurement import Measurement
from fpputil.capture.patterns import STARTS, Patterns
from fpputil.capture.photographs import Capture
from fpputil.capture.quality import Reason, start_offsets
from fpputil.decoding import phase, unwrap

FINDINGS = {
    "exchanged": ("{first} and {second} are exchanged", "exchange their names"),
    "frame": (
        "{files}: does not fit the other steps of {fringe}",
        "photograph again: a trigger was missed, a step was shown twice or too late, or the light "
        "changed",
    ),
    "swapped": (
        "the fringes called {pitches} look like {likely}",
        "exchange the names of the photographs, or the pitches in the pattern file",
    ),
    "pitch": (
        "pitches {pitches} along the {axis}s are given; the photographs show {likely}, if the "
        "first is right",
        "give the pitches that were projected",
    ),
    "direction": (
        "the projector's {axis}s grow {way} in the picture",
        "give shift {shift}: the steps go the other way; if they do not, the projector or the "
        "camera is mirrored or upside down: set it right, or use --accept",
    ),
    "bits": (
        "the pictures of bits {bits} of the Gray code along the {axis}s are exchanged (0 is the "
        "first)",
        "exchange their names",
    ),
    "inverted": (
        "black and white are exchanged in {bits} of the Gray code's pictures along the {axis}s (0 "
        "is the first)",
        "photograph the pictures of `fpp patterns`, or invert the photographs",
    ),
    "backwards": (
        "the bits of the Gray code along the {axis}s come with the least significant one first",
        "name them in the other order",
    ),
    "binary": (
        "the code along the {axis}s looks like plain binary numbers, not like a Gray code",
        "project a Gray code: of binary numbers several bits change at one edge",
    ),
    "offset": (
        "the phases of {pair} are apart by {offset:+.2f} of an order everywhere",
        "{start}check that both begin with step 0 and have the steps that were projected",
    ),
    "disagree": (
        "the phases of {pair} do not belong together",
        "{periods}check the pitches, the direction of the shift and the unwrapping; or the noise "
        "is far too high for these pitches",
    ),
    "saturated": (
        "the camera is saturated at {share:.0%} of the lit pixels",
        "expose less, or close the aperture, until no fringe reaches full scale",
    ),
    "clipped": (
        "the bright halves of {fringe} are flat, below the camera's full scale",
        "the projector is saturated: lower its brightness and contrast to their neutral values, "
        "or project with less amplitude",
    ),
    "response": (
        "the response is not linear: the second harmonic is {second:+.1%} of the fringe",
        "give --gamma, from a capture of five steps or more with the same setup; with three or "
        "four steps it turns the phase by about as many radians",
    ),
    "orders": (
        "the order is a guess at {share:.0%} of the lit pixels",
        "take more steps at the long pitches, or a pitch between two that are far apart{coded}",
    ),
    "dark": (
        "{lit:.1%} of the pixels are lit, with a median modulation of {level:.0f} grey levels",
        "expose longer, open the aperture, or darken the room",
    ),
    "contrast": (
        "the modulation of the finest pitch is {contrast:.0%} of the light: the rest is noise "
        "without use",
        "darken the room, focus the projector and the camera on the object, or project a longer "
        "pitch",
    ),
    "relative": (
        "the phase was unwrapped from pixel to pixel: it is known but for a multiple of 2 pi, "
        "another one in each of {parts} connected part(s), and wrong beyond a step that turns it "
        "by more than pi",
        "take it as a relief of one smooth surface, or its difference to a plane (--reference); "
        "columns, depth and points need a second pitch or a Gray code",
    ),
    "noise": (
        "so few steps do not tell the noise, nor whether the response is linear; the uncertainty "
        "counts the rounding of grey levels alone",
        "take five steps or more at one pitch, or give --noise and --gamma",
    ),
}
"""Of each finding by its code what is the matter, and what to do about it."""

SEVERE = (
    "exchanged",
    "frame",
    "swapped",
    "pitch",
    "direction",
    "offset",
    "disagree",
    "clipped",
    "bits",
    "inverted",
    "backwards",
    "binary",
)
"""Findings with which the phases are wrong; with the others they are noisier or fewer."""

ORDER = ("offset", "disagree", "orders")
FOLLOW = {
    **dict.fromkeys(("frame", "exchanged"), (*ORDER, "response")),
    **dict.fromkeys(("swapped", "pitch", "direction"), ORDER),
    **dict.fromkeys(("bits", "inverted", "backwards", "binary"), (*ORDER, "direction")),
    "offset": ("orders",),
    **dict.fromkeys(("dark", "saturated"), (*ORDER[1:], "noise", "pitch", "response")),
    "clipped": ("response",),
}
"""Findings that another one explains, and that are not told beside it."""

SHARE = 0.02  # of the lit pixels, above which a fault of pixels is one of the setup
HARMONIC = 0.02  # second harmonic over the fringe, above which a response counts as not linear
SPREAD = 0.05  # of the logarithms of pitches, from which their pictures tell which is the finer
PITCH_OFF = 0.25  # relative error of a pitch as the photographs show it
SURE = 0.6  # length of a circular mean, above which it tells something
OFFSET = 0.15  # of an order
FITS = 0.05  # of an order, by which a start may miss the offsets that it explains
SMOOTH = (9, 9)  # pixels, over which the local frequency is averaged
ALONE = 4.0  # times what a sinusoid leaves of the other photographs of its fringe
STEPS = (6, 24)  # with fewer, what is left does not tell which photograph is to blame
STRONG = 400  # pixels at which photographs are compared


class Finding(NamedTuple):
    """What speaks against a capture: a key of `FINDINGS`, what is the matter, what to do about it.

    With a severe one the phases are wrong, not only noisier or fewer.
    """

    code: str
    severe: bool
    message: str
    remedy: str


def diagnose(measurement: Measurement, capture: Capture) -> list[Finding]:
    """All that speaks against a capture along the axis of a measurement. Chapter 12.

    The severe come first; what another finding explains is left out.

    Examples
    --------
    >>> import tempfile
    >>> from fpputil.capture import Patterns, measure, open_capture, photograph_into
    >>> from fpputil.optics import fringe_set, preset, raycast, shapes
    >>> system = preset("tiny").system
    >>> view = raycast(shapes.sphere(100, [0, 0, 660]), system)
    >>> patterns = Patterns((912, 1140), fringe_set((912, 114, 24), 4))
    >>> turned = Patterns((912, 1140), patterns.fringes, shift=-1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     photograph_into(folder, view, patterns, system)
    ...     capture = open_capture(folder, turned)
    ...     [finding.code for finding in diagnose(measure(capture), capture)]
    ['direction']
    """
    checks = (_relative, _repeated, _frequencies, _code, _offset, _clipping, _response, _light)
    if not measurement.sample:  # a Gray code alone
        checks = (_frequencies, _code, _light)
    findings = [finding for check in checks for finding in check(measurement, capture)]
    codes = {finding.code for finding in findings}
    follow = {effect for cause in codes for effect in FOLLOW.get(cause, ())}
    findings = [finding for finding in findings if finding.code not in follow]
    return sorted(findings, key=lambda finding: not finding.severe)


def _finding(code: str, severe: bool | None = None, **values) -> Finding:
    message, remedy = (text.format(**values) for text in FINDINGS[code])
    return Finding(code, code in SEVERE if severe is None else severe, message, remedy)


def _fringe(m: Measurement, k: int) -> str:
    return f"pitch {m.fringes[k].pitch:g} along the {m.axis}s"


def _share(m: Measurement, reason: Reason) -> float:
    """Of the lit pixels the share that is left out for a reason."""
    return float((m.reason == reason).sum() / max(m.lit.sum(), 1))


def _relative(m, capture) -> Iterator[Finding]:
    """What spatial unwrapping leaves open."""
    if m.unwrapped_in_space:
        yield _finding("relative", parts=cv2.connectedComponents(m.mask.astype(np.uint8))[0] - 1)


def _repeated(m, capture) -> Iterator[Finding]:
    """Photographs that do not fit the sinusoid of the others, or would fit in another place."""
    for k, number in enumerate(capture.patterns.along(m.axis)):
        frames = linearise(m.sample[k], m.gamma)
        modulation = phase.modulation(*phase.numerator_denominator(frames), len(frames))
        strong = (modulation > 16) & (frames.max(axis=0) < 254)
        frames = frames[:, strong][:, :: max(1, strong.sum() // STRONG)]
        if frames.shape[1] < 20 or not STEPS[0] <= len(frames) <= STEPS[1]:
            continue
        files = [shot.file for shot in capture.of(number)]
        if pair := exchanged(frames):
            yield _finding("exchanged", first=files[pair[0]], second=files[pair[1]])
        elif bad := misfits(frames):
            yield _finding("frame", files=", ".join(files[n] for n in bad), fringe=_fringe(m, k))


def _frequencies(m, capture) -> Iterator[Finding]:
    """What the local frequencies tell of the pitches and of the direction."""
    frequencies = local_frequencies(m)
    yield from _pitches(m, np.abs(frequencies))
    clear = np.abs(frequencies) > 1e-3
    if clear.any() and np.median(np.sign(frequencies[clear])) <= 0:  # they fall, and should grow
        way = "from right to left" if m.axis == "column" else "upwards"
        severe = not m.unwrapped_in_space  # which turns a relief inside out, no more
        yield _finding("direction", severe, axis=m.axis, way=way, shift=-capture.patterns.shift)


def _pitches(m, frequencies) -> Iterator[Finding]:
    """Fringes whose pictures are as coarse as another one's should be."""
    if m.lit.sum() < 1000 or np.median(m.modulation[:, m.lit]) < 16:
        return  # a slow fringe cannot be told from noise
    if len(frequencies) < 2 or not (frequencies >= 1e-3).all():
        return
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
        yield _finding("swapped", pitches=pitches, likely=", ".join(f"{p:g}" for p in best))
    else:
        likely = ", ".join(f"{declared[0] * frequencies[0] / f:.3g}" for f in frequencies)
        yield _finding("pitch", pitches=pitches, axis=m.axis, likely=likely)


def local_frequencies(m: Measurement) -> np.ndarray:
    """Median local frequency of each pitch along its axis, radians a pixel, (P,); signed.

    Above pi a pixel it wraps, and tells nothing.
    """
    along, lit, medians = (1 if m.axis == "column" else 0), m.lit, []
    for phi in m.wrapped:
        phasor = np.exp(1j * phi)
        turn = np.roll(phasor, -1, along) * phasor.conj() * (lit & np.roll(lit, -1, along))
        parts = turn.view(np.float32).reshape(*lit.shape, 2)
        smooth = cv2.boxFilter(parts, -1, SMOOTH).view(np.complex64)[..., 0]
        medians.append(np.median(np.angle(smooth[lit])) if lit.any() else np.nan)
    return np.array(medians)


def _code(m, capture) -> Iterator[Finding]:
    """Bits of a Gray code that would make a smooth column if they were read otherwise."""
    if m.reading is None:
        return
    phi = m.wrapped[0] if m.sample else None
    if phi is not None and m.sharpness[0] > SURE:  # the fringes may begin otherwise
        phi = unwrap.wrap(phi - np.float32(unwrap.TWO_PI * m.offsets[0]))
    fault = code_fault(m.reading, phi, m.fringes[0].pitch, m.axis, m.lit)
    if fault is not None:
        yield _finding(fault[0], bits=fault[1], axis=m.axis)


def _offset(m, capture) -> Iterator[Finding]:
    """Pitches that disagree by the same share everywhere, or everywhere differently."""
    start = likely_start(m, capture.patterns)
    start = f"give --start {start} if all fringes begin so at column 0; else " if start else ""
    coded = m.reading is not None
    for k, (offset, sharpness) in enumerate(zip(m.offsets, m.sharpness, strict=True), -coded):
        first = _fringe(m, k) if k >= 0 else f"the Gray code along the {m.axis}s"
        pair = f"{first} and pitch {m.fringes[k + 1].pitch:g}"
        if sharpness > SURE and abs(offset) > OFFSET:
            yield _finding("offset", pair=pair, offset=offset, start=start)
        elif sharpness < SURE / 2 and m.lit.any():
            periods = "these look like periods, not pitches (--periods); else "
            yield _finding("disagree", pair=pair, periods=periods if _look_like_periods(m) else "")


def _look_like_periods(m: Measurement) -> bool:
    """Whether the fringes are the finer in the picture the larger their pitches are said to be."""
    pitches, frequencies = np.array([f.pitch for f in m.fringes]), np.abs(local_frequencies(m))
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


def _clipping(m, capture) -> Iterator[Finding]:
    """Saturation of the camera; else fringes whose bright halves are flat by the projector."""
    share = _share(m, Reason.SATURATED)
    if share > SHARE:
        yield _finding("saturated", severe=share > 0.5, share=share)
    for k, frames in enumerate(m.sample):
        low, high = frames.min(axis=0), frames.max(axis=0)
        use = (high - low > 40) & (high < 0.97 * 255)
        if len(frames) < 6 or use.sum() < 20:
            continue
        bright = (frames[:, use] > high[use] - 0.04 * (high - low)[use] - 1).mean()
        if bright > 0.24 + 0.5 / len(frames):
            yield _finding("clipped", fringe=_fringe(m, k))
            return


def _response(m, capture) -> Iterator[Finding]:
    """A second harmonic, where a pitch has too few steps for it to fall out."""
    if min(f.steps for f in m.fringes) >= LEAST_STEPS:
        return
    for frames in (linearise(f, m.gamma) for f in m.sample if len(f) >= LEAST_STEPS):
        use = (np.ptp(frames, axis=0) > 40) & (frames.max(axis=0) < 0.97 * 255)
        second = harmonic_ratio(frames[:, use], 2) if use.sum() > 20 else 0.0
        if abs(second) > HARMONIC:
            yield _finding("response", second=second)
            return


def _light(m, capture) -> Iterator[Finding]:
    """Orders that are a guess; too little light, contrast, or steps to tell the noise."""
    lit, unsure = m.lit.mean(), _share(m, Reason.UNSURE)
    if unsure > SHARE:
        coded = "" if m.reading is None else "; or show the complementary code"
        yield _finding("orders", share=unsure, coded=coded)
    level = float(np.median(m.modulation.min(axis=0)[m.lit])) if lit > 0 else 0.0
    if lit < 0.02 or level < 20 and _share(m, Reason.SATURATED) < 0.5:
        yield _finding("dark", severe=not m.mask.any(), lit=lit, level=level)
    contrast = np.median(m.modulation[m.finest][m.lit] / m.average[m.lit]) if lit > 0 else 1.0
    if contrast < 0.3:
        yield _finding("contrast", contrast=contrast)
    if not m.noise.known:
        yield _finding("noise")


def misfits(frames) -> list[int]:
    """Steps of (N, S) without which a sinusoid leaves much less of the others, worst first."""
    bad: list[int] = []
    while len(bad) < len(frames) // 4:
        keep = [n for n in range(len(frames)) if n not in bad]
        left = _left(frames, keep)
        worst = keep[int(np.argmax(left))]
        without = np.median(_left(frames, [n for n in keep if n != worst]))
        if left.max() < max(ALONE * without, 3.0) or without > 0.6 * np.median(left):
            break
        bad.append(worst)
    return bad


def exchanged(frames) -> tuple[int, int] | None:
    """The two steps of (N, S) that, exchanged, make them a sinusoid; None if there are none."""
    steps = list(range(len(frames)))
    before, after = np.median(_left(frames, steps)), {}
    for a, b in combinations(steps, 2):
        order = [{a: b, b: a}.get(n, n) for n in steps]
        after[a, b] = np.median(_left(frames[order], steps))
    best = min(after, key=after.get)
    return best if before > 3.0 and after[best] < before / ALONE else None


def _left(frames, keep) -> np.ndarray:
    """RMS of what a sinusoid leaves of each kept step, by the median over the pixels."""
    delta = 2 * np.pi * np.array(keep) / len(frames)
    terms = np.stack([np.ones_like(delta), np.cos(delta), np.sin(delta)], 1)
    kept = frames[keep]
    return np.sqrt(np.median((kept - terms @ (np.linalg.pinv(terms) @ kept)) ** 2, axis=1))
