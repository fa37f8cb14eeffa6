"""What is wrong with a capture, by name, and what to change in the setup (chapter 12).

Each check looks for one fault that a decoder would otherwise turn into plausible numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np

from fpputil.capture.consistency import FLICKERS, STEPS, doubled, exchanged, misfits
from fpputil.capture.gamma import LEAST_STEPS, few_ratio, harmonic_ratio, linearise, ripple
from fpputil.capture.measurement import Measurement
from fpputil.capture.photographs import Capture
from fpputil.capture.quality import FEW, Reason, order_step
from fpputil.decoding import phase, unwrap

FINDINGS = {
    "exchanged": ("{first} and {second} are exchanged", "exchange their names"),
    "frame": (
        "{files}: does not fit the other steps of {fringe}{same}",
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
    "offset": (
        "the phases of {pair} are apart by {offset:+.2f} of an order everywhere{likely}",
        "check that both begin with step 0 and have the steps that were projected",
    ),
    "disagree": (
        "the phases of {pair} do not belong together",
        "check pitches, their order, the direction of the shift and the unwrapping; or the noise "
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
    "square": (
        "the fringes of {fringe} are square, and {steps} steps let their harmonics through",
        "take many steps (18), put square fringes out of focus, or project sinusoids",
    ),
    "flicker": (
        "the brightness changes by up to {share:.0%} from photograph to photograph; it was "
        "divided out{but}",
        "let the exposure be a whole number of the projector's frames, and fix the camera's gain",
    ),
    "response": (
        "the response is not linear: the second harmonic is {second:+.1%} of the fringe",
        "with three or four steps it turns the phase by about as many radians: give --gamma, or "
        "take five steps or more at one pitch, or photographs in plain light and in none (white "
        "and black), which tell it; or project corrected patterns (fpp patterns --gamma)",
    ),
    "lost": ("{share:.0%} of the lit pixels are left out: {why}", "{remedy}"),
    "orders": (
        "the order is a guess at {share:.0%} of the lit pixels",
        "take more steps at the long pitches, or a pitch between two that are far apart",
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
    "noise": (
        "so few steps do not tell the noise, nor whether the response is linear; the uncertainty "
        "counts the rounding of grey levels alone",
        "take five steps or more at one pitch, or give --noise and --gamma",
    ),
}
"""Of each finding by its code what is the matter, and what to do about it."""

LOST = {
    Reason.SCATTERED: (
        "their steps lie on no sinusoid",
        "project one fringe at a time, and keep light and scene still; or the number of steps is "
        "another one",
    ),
    Reason.UNSTEADY: (
        "their modulation changes from pitch to pitch, and not as that around them",
        "keep light and scene still from the first photograph to the last",
    ),
    Reason.OUTSIDE: (
        "their columns or rows lie outside the projector",
        "check the projector's size and the pitches",
    ),
}
"""Of reasons that no other finding tells, what is the matter, and what to do about it."""

SEVERE = (
    "exchanged",
    "frame",
    "swapped",
    "pitch",
    "direction",
    "offset",
    "disagree",
    "clipped",
    "square",
)
"""Findings with which the phases are wrong; with the others they are noisier or fewer."""

ORDER = ("offset", "disagree", "orders")
FOLLOW = {
    **dict.fromkeys(("frame", "exchanged"), (*ORDER, "response")),
    **dict.fromkeys(("swapped", "pitch", "direction"), ORDER),
    "offset": ("orders",),
    **dict.fromkeys(("dark", "saturated"), (*ORDER[1:], "noise", "pitch", "response")),
    "clipped": ("response",),
    "square": (*ORDER, "response", "clipped", "pitch"),
}
"""Findings that another one explains, and that are not told beside it."""

SHARE = 0.02  # of the lit pixels, above which a fault of pixels is one of the setup
HARMONIC = 0.02  # second harmonic over the fringe, above which a response counts as not linear
PITCH_OFF = 0.25  # relative error of a pitch as the photographs show it
SURE = 0.6  # length of a circular mean, above which it tells something
OFFSET = 0.15  # of an order step
AGREED = 0.95  # cosine of the mean of what pitches are apart, from which on they agree
SMOOTH = (9, 9)  # pixels, over which the local frequency is averaged
LEFT_OUT = 0.05  # of the lit pixels, above which a reason is told; from a half on it is an error
CURVED = 0.1  # second harmonic, above which three steps put orders wrong
MIDDLING = 0.12  # of the grey levels, at most, between dark and bright in square fringes
ROUGH = 8  # steps at most, with which square fringes give no phase
STRONG = 400  # pixels at which photographs are compared


class Finding(NamedTuple):
    """What speaks against a capture: a key of `FINDINGS`, what is the matter, what to do about it.

    With a severe one the phases are wrong, not only noisier or fewer. `axis` is that of the
    fringes, "" if there is but one.
    """

    code: str
    severe: bool
    message: str
    remedy: str
    axis: str = ""

    @property
    def where(self) -> str:
        """Before the message in a list of several axes: ``"columns: "``."""
        return f"{self.axis}s: " if self.axis else ""


def diagnose(measurement: Measurement, capture: Capture) -> list[Finding]:
    """All that speaks against a capture along the axis of a measurement. Chapter 12.

    The severe come first; what another finding explains is left out, but for a severe one that only
    one that is not would explain.

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
    checks = (_repeated, _frequencies, _offset, _clipping, _response, _light, _lost)
    findings = [finding for check in checks for finding in check(measurement, capture)]
    hidden = {(code, True) for f in findings if f.severe for code in FOLLOW.get(f.code, ())}
    hidden |= {(code, False) for f in findings for code in FOLLOW.get(f.code, ())}
    if any(f.code == "response" and f.severe for f in findings):
        hidden |= {(code, severe) for code in (*ORDER, "pitch") for severe in (True, False)}
    if any(f.severe and (f.code, True) not in hidden and f.code != "lost" for f in findings):
        hidden |= {("lost", True), ("lost", False)}
    axis = measurement.axis if len(capture.patterns.axes) > 1 else ""
    findings = [f._replace(axis=axis) for f in findings if (f.code, f.severe) not in hidden]
    return sorted(findings, key=lambda finding: not finding.severe)


def _finding(code: str, severe: bool | None = None, **values) -> Finding:
    message, remedy = (text.format(**values) for text in FINDINGS[code])
    return Finding(code, code in SEVERE if severe is None else severe, message, remedy)


def _fringe(m: Measurement, k: int) -> str:
    return f"pitch {m.fringes[k].pitch:g} along the {m.axis}s"


def _share(m: Measurement, reason: Reason) -> float:
    """Of the lit pixels the share that is left out for a reason."""
    return float((m.reason == reason).sum() / max(m.lit.sum(), 1))


def _repeated(m, capture) -> Iterator[Finding]:
    """Photographs off the curve of the others, or that would fit in another place; and flicker."""
    for k, number in enumerate(capture.patterns.along(m.axis)):
        frames = m.sample[k]
        modulation = phase.modulation(*phase.numerator_denominator(frames), len(frames))
        strong = (modulation > 16) & (frames.max(axis=0) < 254)
        frames = frames[:, strong][:, :: max(1, strong.sum() // STRONG)]
        if frames.shape[1] < 20 or not 4 <= len(frames) <= STEPS[1]:
            continue
        files, fringe = [shot.file for shot in capture.of(number)], _fringe(m, k)
        if pair := doubled(frames):
            one, other = (files[n] for n in pair)
            same = f"; it is the picture of {other}"
            if len(frames) < STEPS[0]:  # which of both is wrong, so few do not tell
                one, same = f"{one} or {other}", "; both are one picture"
            yield _finding("frame", files=one, fringe=fringe, same=same)
        elif len(frames) < STEPS[0]:
            continue
        elif pair := exchanged(frames):
            yield _finding("exchanged", first=files[pair[0]], second=files[pair[1]])
        elif bad := misfits(frames):
            names = ", ".join(files[n] for n in bad)
            yield _finding("frame", files=names, fringe=fringe, same="")
    share = max(np.abs(gains - 1).max() for gains in m.gains)
    if share > SHARE / 2:
        few = sorted({f.steps for f in m.fringes if f.steps < FLICKERS[0]})
        but = f", but for the pitches of {few[0]} steps, which do not tell it" if few else ""
        yield _finding("flicker", share=share, but=but)


def _frequencies(m, capture) -> Iterator[Finding]:
    """What the local frequencies tell of the pitches and of the direction."""
    frequencies = local_frequencies(m)
    yield from _pitches(m, np.abs(frequencies))
    clear = np.abs(frequencies) > 1e-3
    if clear.any() and np.median(np.sign(frequencies[clear])) <= 0:  # they fall, and should grow
        way = "from right to left" if m.axis == "column" else "upwards"
        yield _finding("direction", axis=m.axis, way=way, shift=-capture.patterns.shift)


def _pitches(m, frequencies) -> Iterator[Finding]:
    """Fringes whose pictures are as coarse as another one's should be."""
    if m.lit.sum() < 1000 or np.median(m.modulation[:, m.lit]) < 16:
        return  # a slow fringe cannot be told from noise
    if len(frequencies) < 2 or not (frequencies >= 1e-3).all():
        return
    if any(_square(frames) for frames in m.sample):
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


def _offset(m, capture) -> Iterator[Finding]:
    """Pitches that disagree by the same share everywhere, or everywhere differently."""
    for k, (offset, sharpness) in enumerate(zip(m.offsets, m.sharpness, strict=True)):
        pair = f"{_fringe(m, k)} and pitch {m.fringes[k + 1].pitch:g}"
        if abs(offset) > OFFSET and sharpness > SURE / 2:
            late = [
                f"pitch {m.fringes[j].pitch:g} began with step {step}"
                for j, step in _late(m, capture.patterns)
            ]
            likely = f"; it looks as if {' or '.join(late)}" if late else ""
            if late or sharpness > SURE:
                yield _finding("offset", pair=pair, offset=offset, likely=likely)
        elif sharpness < SURE / 2 and m.lit.any():
            yield _finding("disagree", pair=pair)


def _late(m, patterns) -> list[tuple[int, int]]:
    """Pitches, by number, and the steps with which they would begin if all then agree."""
    if patterns.unwrap not in unwrap.TEMPORAL:
        return []
    method, pitches = unwrap.TEMPORAL[patterns.unwrap], [f.pitch for f in m.fringes]
    few = m.wrapped[:, ::FEW, ::FEW][:, m.lit[::FEW, ::FEW]]
    agree = {}
    for j, fringe in enumerate(m.fringes):
        for step in range(1, fringe.steps):
            phis = list(few)
            phis[j] = unwrap.wrap(phis[j] - patterns.shift * unwrap.TWO_PI * step / fringe.steps)
            Phis = method(phis, pitches, patterns.width(m.axis))
            apart = [
                np.nanmean(np.exp(1j * unwrap.TWO_PI * (A * p - B * q) / (unwrap.TWO_PI * size)))
                for (A, p), (B, q) in pairwise(zip(Phis, pitches, strict=True))
                for size in [order_step(patterns.unwrap, p, q)]
            ]
            if all(a.real > AGREED * abs(a) for a in apart):
                agree[j, step] = sum(a.real for a in apart)
    best = max(agree.values(), default=0.0)
    enough = max(best - 0.02, len(apart) * SURE / 2) if agree else 0.0
    return [key for key, value in agree.items() if value > enough]


def _clipping(m, capture) -> Iterator[Finding]:
    """Saturation of the camera; else fringes whose bright halves are flat by the projector."""
    share = _share(m, Reason.SATURATED)
    if share > SHARE:
        yield _finding("saturated", severe=share > 0.5, share=share)
    for k, frames in enumerate(m.sample):
        low, high = frames.min(axis=0), frames.max(axis=0)
        use = (high - low > 40) & (high < 0.97 * 255)
        if use.sum() < 20:
            continue
        if _square(frames):
            if len(frames) <= ROUGH:
                yield _finding("square", fringe=_fringe(m, k), steps=len(frames))
                return
            continue
        span = (high - low)[use]
        levels = (frames[:, use] - low[use]) / span
        bright, dark = ((edge > 0.96 - 1 / span).mean() for edge in (levels, 1 - levels))
        limit = 0.24 + 0.5 / len(frames)
        if len(frames) >= 6 and dark <= limit < bright:
            yield _finding("clipped", fringe=_fringe(m, k))
            return


def _square(frames) -> bool:
    """Whether nearly all grey levels of photographs (N, S) are either dark or bright."""
    low, span = frames.min(axis=0), np.ptp(frames, axis=0)
    levels = ((frames - low) / np.maximum(span, 1))[:, span > 40]
    return levels.size > 0 and ((levels > 0.15) & (levels < 0.85)).mean() < MIDDLING


def _response(m, capture) -> Iterator[Finding]:
    """A second harmonic that is left, where a pitch has too few steps for it to fall out."""
    steps = [f.steps for f in m.fringes]
    if min(steps) >= LEAST_STEPS:
        return
    second, frames = 0.0, [linearise(f, m.gamma) for f in m.sample]
    use = [(np.ptp(f, axis=0) > 40) & (f.max(axis=0) < 0.97 * 255) for f in frames]
    common = np.all(use, axis=0)
    if m.curved:  # the pitches' modulations then are those of the curve
        good = m.lit & (m.modulation > 16).all(axis=0)
        second = ripple(m.wrapped[:, good], np.log(m.modulation[:, good]), steps)
    elif max(steps) >= LEAST_STEPS:
        k = int(np.argmax(steps))
        second = harmonic_ratio(frames[k][:, use[k]], 2) if use[k].sum() > 20 else 0.0
    elif common.sum() > 100:
        second = few_ratio([f[:, common] for f in frames])
    if abs(second) > HARMONIC:
        severe = abs(second) > CURVED and bool(
            (m.sharpness < SURE).any() or m.mask.sum() < 0.5 * m.lit.sum()
        )
        yield _finding("response", severe, second=second)


def _lost(m, capture) -> Iterator[Finding]:
    """Reasons that take many of the lit pixels, and that nothing else tells."""
    shares = {reason: _share(m, reason) for reason in Reason if reason > Reason.DARK}
    emptied = m.mask.sum() < 0.5 * m.lit.sum()
    for reason, (why, remedy) in LOST.items():
        share = shares[reason]
        if share > LEFT_OUT:
            severe = share >= 0.5 or (emptied and share == max(shares.values()))
            yield _finding("lost", severe, share=share, why=why, remedy=remedy)


def _light(m, capture) -> Iterator[Finding]:
    """Orders that are a guess; too little light, contrast, or steps to tell the noise."""
    lit, unsure = m.lit.mean(), _share(m, Reason.UNSURE)
    if unsure > SHARE:
        yield _finding("orders", unsure >= 0.5, share=unsure)
    level = float(np.median(m.modulation.min(axis=0)[m.lit])) if lit > 0 else 0.0
    if lit < 0.02 or level < 20 and _share(m, Reason.SATURATED) < 0.5:
        yield _finding("dark", severe=not m.mask.any(), lit=lit, level=level)
    contrast = (
        np.median(m.modulation[m.finest][m.lit] / np.maximum(m.average[m.lit], 1))
        if lit > 0
        else 1.0
    )
    if contrast < 0.3:
        yield _finding("contrast", contrast=contrast)
    if not m.noise.known:
        yield _finding("noise")
