"""What is wrong with a capture, by name, and what to change in the setup (chapter 12).

Each check looks for one fault that a decoder would otherwise turn into plausible numbers.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import cv2
import numpy as np

from fpputil.capture.coding import code_fault
from fpputil.capture.faults.consistency import FLICKERS, STEPS, doubled, exchanged, misfits
from fpputil.capture.faults.findings import (
    FOLLOW,
    LOST,
    ORDER,
    Finding,
    finding_of,
)
from fpputil.capture.faults.gamma import LEAST_STEPS, few_ratio, harmonic_ratio, linearise, ripple
from fpputil.capture.faults.mounting import (
    growth,
    growth_by,
    heading,
    local_gradients,
    sense,
    way,
    writing,
)
from fpputil.capture.faults.pitches import (
    SURE,
    fringe_name,
    looks_square,
    offset_findings,
    pitch_findings,
)
from fpputil.capture.files.images import CHANNELS, LOSSY, grey
from fpputil.capture.measurement import Measurement
from fpputil.capture.photographs import Capture
from fpputil.capture.quality import FEW, Reason
from fpputil.decoding import phase, unwrap
from fpputil.optics.system import System

SHARE = 0.02  # of the lit pixels, above which a fault of pixels is one of the setup
HARMONIC = 0.02  # second harmonic over the fringe, above which a response counts as not linear
LEFT_OUT = 0.05  # of the lit pixels, above which a reason is told; from a half on it is an error
CURVED = 0.1  # second harmonic, above which three steps put orders wrong
ROUGH = 8  # steps at most, with which square fringes give no phase
STRONG = 400  # pixels at which photographs are compared
ONE_COLOUR = 0.5  # of the brightest channel, under which grey is a waste of light


def diagnose(
    measurement: Measurement,
    capture: Capture,
    system: System | None = None,
    ignored: Collection[str] = (),
) -> list[Finding]:
    """All that speaks against a capture along the axis of a measurement. Chapter 12.

    The severe come first; what another finding explains is left out, but for a severe one that only
    one that is not would explain. With a system the fringes are to run as it says that the
    projector hangs, without one as an upright one's. The codes of findings that are ignored neither
    count nor explain others.

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
    checks = (_relative, _repeated, _code, offset_findings, _clipping, _response, _light, _lost)
    if not measurement.sample:  # a Gray code alone
        checks = (_code, _light, _lost)
    findings = list(_frequencies(measurement, capture, system))
    findings += [finding for check in checks for finding in check(measurement, capture)]
    findings = [finding for finding in findings if finding.code not in ignored]
    hidden = {(code, True) for f in findings if f.severe for code in FOLLOW.get(f.code, ())}
    hidden |= {(code, False) for f in findings for code in FOLLOW.get(f.code, ())}
    if any(f.code == "response" and f.severe for f in findings):
        hidden |= {(code, severe) for code in (*ORDER, "pitch") for severe in (True, False)}
    if any(f.severe and (f.code, True) not in hidden and f.code != "lost" for f in findings):
        hidden |= {("lost", True), ("lost", False)}
    axis = measurement.axis if len(capture.patterns.axes) > 1 else ""
    findings = [f._replace(axis=axis) for f in findings if (f.code, f.severe) not in hidden]
    return sorted(findings, key=lambda finding: not finding.severe)


def of_files(capture: Capture) -> Iterator[Finding]:
    """What the kind of the photographs costs: bits, compression, colours; none is severe."""
    if capture.levels.said:
        yield finding_of("levels", **capture.levels._asdict())
    if number := sum(shot.file.lower().endswith(LOSSY) for shot in capture.shots):
        yield finding_of("jpeg", number=number)
    if capture.colourful:
        yield from _colours(capture)


def _colours(capture) -> Iterator[Finding]:
    """Light of one colour, and channels that are saturated though their mixture is not."""
    fringe = int(np.argmin([f.steps for f in capture.patterns.fringes]))
    frames = np.stack(capture.photographs(fringe)).astype(np.float32)[:, ::FEW, ::FEW]
    high, swing = frames.max(axis=0), np.ptp(frames, axis=0)
    lit = (swing > 2 * phase.THRESHOLD / capture.scale).any(axis=-1)
    if not lit.any():
        return
    strength = swing[lit].mean(axis=0)
    brightest = int(np.argmax(strength))
    share = float(grey(strength[None, None])[0, 0] / strength[brightest])
    if capture.channel == "grey" and share < ONE_COLOUR:
        yield finding_of("channel", channel=CHANNELS[brightest + 1], grey=share)
    clipped = (high[lit] >= capture.full).mean(axis=0)
    worst = int(np.argmax(clipped))
    if capture.channel == "grey" and clipped[worst] > SHARE:
        yield finding_of("overflow", channel=CHANNELS[worst + 1], share=clipped[worst])


def _share(m: Measurement, reason: Reason) -> float:
    """Of the lit pixels the share that is left out for a reason."""
    return float((m.reason == reason).sum() / max(m.lit.sum(), 1))


def _relative(m, capture) -> Iterator[Finding]:
    """What spatial unwrapping leaves open."""
    if m.unwrapped_in_space:
        yield finding_of("relative", parts=cv2.connectedComponents(m.mask.astype(np.uint8))[0] - 1)


def _repeated(m, capture) -> Iterator[Finding]:
    """Photographs off the curve of the others, or that would fit in another place; and flicker."""
    for k, number in enumerate(capture.patterns.along(m.axis)):
        frames = m.sample[k]
        modulation = phase.modulation(*phase.numerator_denominator(frames), len(frames))
        strong = (modulation > 16) & (frames.max(axis=0) < 254)
        frames = frames[:, strong][:, :: max(1, strong.sum() // STRONG)]
        if frames.shape[1] < 20 or len(frames) > STEPS[1]:
            continue
        if len(frames) < LEAST_STEPS:  # whose curve has no harmonics
            frames = linearise(frames, m.gamma)
        files, fringe = [shot.file for shot in capture.of(number)], fringe_name(m, k)
        if pair := doubled(frames):
            one, other = (files[n] for n in pair)
            same = f"; it is the picture of {other}"
            if len(frames) < STEPS[0]:  # which of both is wrong, so few do not tell
                one, same = " or ".join(sorted((one, other))), "; both are one picture"
            yield finding_of("frame", files=one, fringe=fringe, same=same)
        elif len(frames) < STEPS[0]:
            continue
        elif pair := exchanged(frames):
            yield finding_of("exchanged", first=files[pair[0]], second=files[pair[1]])
        elif bad := misfits(frames):
            names = ", ".join(files[n] for n in bad)
            yield finding_of("frame", files=names, fringe=fringe, same="")
    share = max((np.abs(gains - 1).max() for gains in m.gains), default=0.0)
    if share > SHARE / 2:
        steady = [f.steps for f, g in zip(m.fringes, m.gains, strict=True) if (g == 1).all()]
        few = [number for number in steady if number < FLICKERS[0]]
        but = f", but for the pitches of {min(few)} steps, which do not tell it" if few else ""
        yield finding_of("flicker", share=share, but=but)


def mirrored(column: Measurement, row: Measurement, system: System | None = None) -> list[Finding]:
    """A mirror between camera and projector, which fringes along both axes show. Chapter 12.

    A projector that is turned, or steps that go the other way, do not look like one.
    """
    turn = sense([growth(m, local_gradients(m)) for m in (column, row)])
    if not turn * (1 if system is None else sense(growth_by(system))) < 0:
        return []
    return [
        finding_of("mirrored", against="" if system is None else " against those of the system")
    ]


def _frequencies(m, capture, system) -> Iterator[Finding]:
    """What the local frequencies tell of the pitches and of the direction."""
    grown = growth(m, gradients := local_gradients(m))
    towards = heading(m.axis, grown, system)
    frequencies = np.linalg.norm(gradients, axis=1) if towards is None else gradients @ towards
    yield from pitch_findings(m, np.abs(frequencies))
    clear = np.abs(frequencies) > 1e-3
    if towards is None or not clear.any() or np.median(np.sign(frequencies[clear])) > 0:
        return  # they grow, as they should
    named = {"axis": m.axis, "way": way(grown), "shift": -capture.patterns.shift}
    if system is None:
        severe = not m.unwrapped_in_space  # which turns a relief inside out, no more
        yield finding_of("direction", severe, **named)
    else:
        named |= {"expected": way(towards), "writing": writing(system)}
        yield finding_of("mounting", **named)


def _code(m, capture) -> Iterator[Finding]:
    """Bits of a Gray code that would make a smooth column if they were read otherwise."""
    if m.reading is None:
        return
    phi = m.wrapped[0] if m.sample else None
    if phi is not None and m.sharpness[0] > SURE:  # the fringes may begin otherwise
        phi = unwrap.wrap(phi - np.float32(unwrap.TWO_PI * m.offsets[0]))
    known = m.fringes[0].pitch, m.axis, m.lit
    fault = code_fault(m.reading, phi, *known)
    if fault == ("inverted", "0") and phi is not None and not code_fault(m.reading, -phi, *known):
        yield finding_of("against", axis=m.axis, shift=-capture.patterns.shift)
    elif fault is not None:
        yield finding_of(fault[0], bits=fault[1], axis=m.axis)


def _clipping(m, capture) -> Iterator[Finding]:
    """Saturation of the camera; else fringes whose bright halves are flat by the projector."""
    share = _share(m, Reason.SATURATED)
    if share > SHARE:
        yield finding_of("saturated", severe=share > 0.5, share=share)
    for k, frames in enumerate(m.sample):
        low, high = frames.min(axis=0), frames.max(axis=0)
        use = (high - low > 40) & (high < 0.97 * 255)
        if use.sum() < 20:
            continue
        if looks_square(frames):
            if len(frames) <= ROUGH:
                yield finding_of("square", fringe=fringe_name(m, k), steps=len(frames))
                return
            continue
        span = (high - low)[use]
        levels = (frames[:, use] - low[use]) / span
        bright, dark = ((edge > 0.96 - 1 / span).mean() for edge in (levels, 1 - levels))
        limit = 0.24 + 0.5 / len(frames)
        if len(frames) >= 6 and dark <= limit < bright:
            yield finding_of("clipped", fringe=fringe_name(m, k))
            return


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
        yield finding_of("response", severe, second=second)


def _lost(m, capture) -> Iterator[Finding]:
    """Reasons that take many of the lit pixels, and that nothing else tells."""
    shares = {reason: _share(m, reason) for reason in Reason if reason > Reason.DARK}
    emptied = m.mask.sum() < 0.5 * m.lit.sum()
    for reason, (why, remedy) in LOST.items():
        share = shares[reason]
        if share > LEFT_OUT:
            severe = share >= 0.5 or (emptied and share == max(shares.values()))
            yield finding_of("lost", severe, share=share, why=why, remedy=remedy)


def _light(m, capture) -> Iterator[Finding]:
    """Orders that are a guess; too little light, contrast, or steps to tell the noise."""
    lit, unsure = m.lit.mean(), _share(m, Reason.UNSURE)
    if unsure > SHARE:
        coded = "" if m.reading is None else "; or show the complementary code"
        yield finding_of("orders", unsure >= 0.5, share=unsure, coded=coded)
    level = float(np.median(m.modulation.min(axis=0)[m.lit])) if lit > 0 else 0.0
    if lit < 0.02 or level < 20 and _share(m, Reason.SATURATED) < 0.5:
        yield finding_of("dark", severe=not m.mask.any(), lit=lit, level=level)
    contrast = (
        np.median(m.modulation[m.finest][m.lit] / np.maximum(m.average[m.lit], 1))
        if lit > 0
        else 1.0
    )
    if contrast < 0.3:
        yield finding_of("contrast", contrast=contrast)
    if not m.noise.known:
        yield finding_of("noise")
