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
from fpputil.capture.files.images import CHANNELS, LOSSY, grey
from fpputil.capture.measurement import Measurement
from fpputil.capture.patterns import STARTS, Patterns
from fpputil.capture.photographs import Capture
from fpputil.capture.quality import FEW, Reason, parted, start_offsets
from fpputil.decoding import phase, unwrap
from fpputil.optics.system import System

SHARE = 0.02  # of the lit pixels, above which a fault of pixels is one of the setup
HARMONIC = 0.02  # second harmonic over the fringe, above which a response counts as not linear
SPREAD = 0.05  # of the logarithms of pitches, from which their pictures tell which is the finer
PITCH_OFF = 0.25  # relative error of a pitch as the photographs show it
SURE = 0.6  # length of a circular mean, above which it tells something
OFFSET = 0.15  # of an order
SLIGHT = 0.05  # the same by beats or a code, where no ripple of a long pitch is multiplied
FITS = 0.05  # of an order, by which a start may miss the offsets that it explains
AGREED = 0.95  # cosine of the mean of what pitches are apart, from which on they agree
LEFT_OUT = 0.05  # of the lit pixels, above which a reason is told; from a half on it is an error
CURVED = 0.1  # second harmonic, above which three steps put orders wrong
MIDDLING = 0.12  # of the grey levels, at most, between dark and bright in square fringes
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
    checks = (_relative, _repeated, _code, _offset, _clipping, _response, _light, _lost)
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


def _fringe(m: Measurement, k: int) -> str:
    return f"pitch {m.fringes[k].pitch:g} along the {m.axis}s"


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
        if frames.shape[1] < 20 or not 4 <= len(frames) <= STEPS[1]:
            continue
        files, fringe = [shot.file for shot in capture.of(number)], _fringe(m, k)
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
    yield from _pitches(m, np.abs(frequencies))
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
        yield finding_of("swapped", pitches=pitches, likely=", ".join(f"{p:g}" for p in best))
    else:
        likely = ", ".join(f"{declared[0] * frequencies[0] / f:.3g}" for f in frequencies)
        yield finding_of("pitch", pitches=pitches, axis=m.axis, likely=likely)


def _code(m, capture) -> Iterator[Finding]:
    """Bits of a Gray code that would make a smooth column if they were read otherwise."""
    if m.reading is None:
        return
    phi = m.wrapped[0] if m.sample else None
    if phi is not None and m.sharpness[0] > SURE:  # the fringes may begin otherwise
        phi = unwrap.wrap(phi - np.float32(unwrap.TWO_PI * m.offsets[0]))
    fault = code_fault(m.reading, phi, m.fringes[0].pitch, m.axis, m.lit)
    if fault is not None:
        yield finding_of(fault[0], bits=fault[1], axis=m.axis)


def _offset(m, capture) -> Iterator[Finding]:
    """Pitches that disagree by the same share everywhere, or everywhere differently."""
    start = likely_start(m, capture.patterns)
    start = f"give --start {start} if all fringes begin so at column 0; else " if start else ""
    coded = m.reading is not None
    beats = capture.patterns.unwrap == "mw"
    beats &= not unwrap.covers(m.fringes[-1].pitch, capture.patterns.width(m.axis))
    for k, (offset, sharpness) in enumerate(zip(m.offsets, m.sharpness, strict=True), -coded):
        first = _fringe(m, k) if k >= 0 else f"the Gray code along the {m.axis}s"
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
        if _square(frames):
            if len(frames) <= ROUGH:
                yield finding_of("square", fringe=_fringe(m, k), steps=len(frames))
                return
            continue
        span = (high - low)[use]
        levels = (frames[:, use] - low[use]) / span
        bright, dark = ((edge > 0.96 - 1 / span).mean() for edge in (levels, 1 - levels))
        limit = 0.24 + 0.5 / len(frames)
        if len(frames) >= 6 and dark <= limit < bright:
            yield finding_of("clipped", fringe=_fringe(m, k))
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
