"""A capture to absolute phases, with what each pixel is worth: mask, reason, uncertainty (ch. 12).

One fringe at a time is in memory. Of all photographs a few thousand pixels are kept, for what can
only be seen in them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fpputil.capture.coding import (
    Reading,
    cells_alone,
    code_offset,
    read_code,
    unwrap_by_code,
)
from fpputil.capture.faults.consistency import STEPS, flicker_of, flickers_of
from fpputil.capture.faults.curve import (
    LEAST_LIT,
    Response,
    blur_of,
    fit_response,
    lit_pixels,
    response_of,
)
from fpputil.capture.faults.gamma import LEAST_STEPS, linearise
from fpputil.capture.photographs import Capture
from fpputil.capture.quality import (
    Noise,
    Reason,
    judge,
    mark,
    noise_of,
    noise_of_curves,
    phase_noise,
    response_share,
)
from fpputil.capture.unwrapping import unwrapper
from fpputil.checks import not_negative
from fpputil.decoding import phase, unwrap
from fpputil.decoding.triangulation import depth_of, in_range, triangulate
from fpputil.optics.fringes import WHITE, Fringe
from fpputil.optics.system import System

SAMPLE = 64  # rows and columns of the grid of pixels that are kept whole
KEPT = 2**27  # bytes of photographs that are kept, at most, if they are wanted twice
SHOWN = 2**20  # grey levels of all photographs that a report shows


@dataclass(frozen=True, eq=False, kw_only=True)
class Measurement:
    """What the fringes along one axis tell.

    Parameters
    ----------
    axis : {"column", "row"}
    fringes : tuple of P Fringe
        In the order of the patterns.
    wrapped, modulation : (P, H, W) float32 arrays
        Radians, and grey levels of 255, at every pixel.
    average : (H, W) float32 array
        Mean of all photographs of the finest pitch, grey levels of 255.
    Phi, sigma : (H, W) float32 arrays
        Absolute phase of the finest pitch, and its standard deviation by noise and modulation,
        radians; NaN outside the mask.
    reason, offsets, sharpness
        As of `fpputil.capture.quality.judge`.
    noise : Noise
    gamma : float
        Exponent of the response that was taken back.
    told : str
        What told gamma; "" if it is 1 for want of anything that did.
    curved : bool
        Whether the curve of a power was fitted, black being known, and no sinusoid.
    gains : list of (steps,) arrays
        Of each fringe how bright each photograph is, over their mean, which was divided out; ones
        where it does not flicker, or is not told.
    sample : list of (steps, S) arrays
        Of each fringe the grey levels of a grid of pixels, of 255, as photographed.
    shown : list of (steps, h, w) uint8 arrays
        Of each fringe every k-th row and column of the photographs, of 255, for a report.
    reading : Reading or None
        Of a Gray code; without fringes `fringes` are the code itself.
    unwrapped_in_space : bool
        Whether `Phi` is known but for a multiple of 2 pi, another one in each connected part.
    """

    axis: str
    fringes: tuple[Fringe, ...]
    wrapped: np.ndarray
    modulation: np.ndarray
    average: np.ndarray
    Phi: np.ndarray
    sigma: np.ndarray
    reason: np.ndarray
    offsets: np.ndarray
    sharpness: np.ndarray
    noise: Noise
    gamma: float
    told: str
    curved: bool
    gains: list[np.ndarray]
    sample: list[np.ndarray]
    shown: list[np.ndarray]
    reading: Reading | None = None
    unwrapped_in_space: bool = False

    @property
    def finest(self) -> int:
        """Number of the fringe of the shortest pitch."""
        return int(np.argmin([f.pitch for f in self.fringes]))

    @property
    def pitch(self) -> float:
        """Pitch of `Phi`, the shortest one, projector pixels."""
        return self.fringes[self.finest].pitch

    @property
    def mask(self) -> np.ndarray:
        """(H, W) bool array: True where there is nothing against a pixel."""
        return self.reason == Reason.GOOD

    @property
    def lit(self) -> np.ndarray:
        """(H, W) bool array: True where the fringes are seen."""
        return self.reason != Reason.DARK

    @property
    def coordinate(self) -> np.ndarray:
        """Projector column (or row), (H, W), pixels; NaN outside the mask."""
        return self.Phi * np.float32(self.pitch / unwrap.TWO_PI)

    def points(self, system: System) -> np.ndarray:
        """Points of this axis alone, (H, W, 3), mm; NaN outside mask and measuring range."""
        coordinate = self.Phi.astype(np.float64) * (self.pitch / unwrap.TWO_PI)
        columns, rows = (coordinate, None) if self.axis == "column" else (None, coordinate)
        points = triangulate(columns, system, rows)
        points[~in_range(depth_of(points, system), system)] = np.nan
        return points

    def arrays(self) -> dict[str, np.ndarray]:
        """What there is to store, by name: float32; wrapped phase and modulation everywhere.

        The absolute phase, its uncertainty and the coordinate are NaN outside the mask.
        """
        names = ("Phi", "sigma", "coordinate")
        names = names[:-1] if self.unwrapped_in_space else names
        phases = {name: getattr(self, name) for name in names}
        named = {k: np.where(self.mask, v, np.nan).astype("f4") for k, v in phases.items()}
        named |= {name: getattr(self, name) for name in ("wrapped", "modulation")}
        named |= {"mask": self.mask, "reason": self.reason}
        return {f"{self.axis}_{name}": value for name, value in named.items()}

    def numbers(self) -> dict[str, str]:
        """What a report says in numbers, as text by name."""
        mask, lit = self.mask, max(int(self.lit.sum()), 1)
        lost = {r.said: (self.reason == r).sum() / lit for r in Reason if r > Reason.DARK}
        typical = (lambda a: float(np.median(a[mask]))) if mask.any() else (lambda a: float("nan"))
        few = sorted({f.steps for f in self.fringes if not STEPS[0] <= f.steps <= STEPS[1]})
        checked = "cannot be told from {} steps".format(", ".join(map(str, few)))
        checked = checked if few else "looked for"
        bright = typical(self.modulation[self.finest])
        noise = typical(np.sqrt(self.noise.variance(self.average)))
        return {
            "pixels in the mask": f"{mask.mean():.1%}, {mask.sum() / lit:.1%} of the lit ones",
            "pitches, steps": ", ".join(f"{f.pitch:g} x {f.steps}" for f in self.fringes),
            "modulation of the finest pitch, median": f"{bright:.1f}",
            "noise, grey levels": f"{noise:.2f}" + ("" if self.noise.known else " (assumed)"),
            "gamma": f"{self.gamma:.3f}" + (f", by {self.told}" if self.told else ""),
            "exchanged and late photographs": checked,
            "uncertainty of the phase, median": f"{typical(self.sigma):.4f} rad",
            **{f"of the lit pixels {name}": f"{share:.2%}" for name, share in lost.items()},
        }


def measure(
    capture: Capture,
    axis: str = "column",
    *,
    threshold: float = phase.THRESHOLD,
    gamma: float | None = None,
    noise: float | None = None,
    system: System | None = None,
    each: Callable[[int], None] | None = None,
) -> Measurement:
    """Decode the fringes along an axis. Chapter 12.

    Parameters
    ----------
    capture : Capture
    axis : {"column", "row"}
    threshold : float
        Least modulation of every pitch, grey levels of 255.
    gamma : float, optional
        Exponent of the response, which is taken back. By default estimated from the fringe of most
        steps, if that has five or more and another one fewer: from five steps on the harmonics of
        a response fall out, and taking it back would only raise the noise of the dark.
    noise : float, optional
        Standard deviation of the camera's noise, grey levels of 255; by default estimated.
    system : System, optional
        Needed by patterns that are unwrapped by the minimum phase.
    each : callable, optional
        Called with the number of photographs after each fringe that was read.

    Raises
    ------
    ValueError
        As of `unwrapper`, or if a photograph cannot be read or differs in size.

    Examples
    --------
    >>> import tempfile
    >>> from fpputil.capture import Patterns, open_capture, photograph_into
    >>> from fpputil.optics import fringe_set, preset, raycast, shapes
    >>> system = preset("tiny").system
    >>> view = raycast(shapes.sphere(100, [0, 0, 660]), system)
    >>> patterns = Patterns((912, 1140), fringe_set((912, 114, 24), 4))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     photograph_into(folder, view, patterns, system)
    ...     result = measure(open_capture(folder))
    >>> result.Phi.shape, bool(np.nanmedian(abs(result.coordinate - view.column)) < 0.1)
    ((120, 160), True)
    """
    threshold = not_negative("threshold", threshold, "grey levels")
    patterns = capture.patterns
    try:
        unwrapped = unwrapper(patterns, axis, system, capture.size)
    except ValueError as error:
        raise ValueError(f"{capture.folder}: {error}") from error
    fringes = tuple(patterns.along(axis).values())
    if not fringes:
        variance = Noise(not_negative("noise", noise or 0.0, "grey levels") ** 2, 0.0, True)
        reading = read_code(capture, axis, variance, gamma or 1.0)
        if each is not None:
            each(reading.code.steps)
        maps = cells_alone(reading, patterns.width(axis), threshold)
        maps |= {"noise": variance, "gamma": gamma or 1.0, "reading": reading, "curved": False}
        maps |= {"told": "" if gamma is None else "the command"}
        maps |= {name: [] for name in ("gains", "sample", "shown")}
        return Measurement(axis=axis, fringes=(reading.code,), **maps)
    fits, sample, gains, shown, response = _read(capture, axis, gamma, each)
    curved = response.gamma != 1 and response.black is not None
    straight = [f if (g == 1).all() else f / g[:, None] for f, g in zip(sample, gains, strict=True)]
    if not curved:
        straight = [linearise(frames, response.gamma) for frames in straight]
    if noise is None:
        variance = noise_of(straight, threshold)
        if curved and not variance.known:
            variance = noise_of_curves(fits, threshold)
    else:
        variance = Noise(not_negative("noise", noise, "grey levels") ** 2, 0.0, True)
    reading, phis = None, [one.wrapped for one in fits]
    if patterns.code(axis) is None:
        Phis = unwrapped(phis)
    else:
        # The average of a curve is one of grey levels as they are.
        straightened = 1.0 if curved else response.gamma
        reading = read_code(capture, axis, variance, straightened, fits[0])
        if each is not None:
            each(reading.code.steps)
        Phis, sure = unwrap_by_code(
            phis, fringes, reading, phase_noise(fits[0], fringes[0].steps, variance)
        )
    spatial = patterns.unwrap == "spatial"
    width = np.inf if spatial else patterns.width(axis)  # of a phase that is no column yet
    shares = [
        0.0 if curved else response_share(frames[:, lit_pixels([frames])]) for frames in straight
    ]
    reason, sigmas, offsets, sharpness = judge(
        fits, fringes, Phis, variance, threshold, patterns.unwrap, width, shares
    )
    if reading is not None:
        mean = code_offset(reading, phis[0], fringes[0], reason == Reason.GOOD)
        offsets = np.append(np.angle(mean) / unwrap.TWO_PI, offsets)
        sharpness = np.append(np.abs(mean), sharpness)
        mark(reason, ~sure, Reason.UNSURE)
    finest, good = int(np.argmin([f.pitch for f in fringes])), reason == Reason.GOOD
    if spatial and good.any():
        Phis = [unwrap.spatial(phis[0], good)]
    return Measurement(
        axis=axis,
        fringes=fringes,
        wrapped=np.stack([one.wrapped for one in fits]),
        modulation=np.stack([one.modulation for one in fits]),
        average=fits[finest].average,
        Phi=np.where(good, Phis[finest], np.nan).astype(np.float32),
        sigma=np.where(good, sigmas[finest], np.nan).astype(np.float32),
        reason=reason,
        offsets=offsets,
        sharpness=sharpness,
        noise=variance,
        gamma=response.gamma,
        told=response.told,
        curved=curved,
        gains=gains,
        sample=sample,
        shown=shown,
        reading=reading,
        unwrapped_in_space=spatial,
    )


def _read(capture: Capture, axis: str, gamma, each):
    """Fit of each fringe, its photographs at the pixels of a grid, and the response.

    If a pitch has three or four steps, what each pitch tells of response and flicker is needed for
    the others; photographs that are too many to be kept meanwhile are read twice.
    """
    fringes, shift = capture.patterns.along(axis), capture.patterns.shift
    ticks = [np.linspace(0, n - 1, min(n, SAMPLE)).astype(int) for n in capture.size]
    grid = np.ix_(*ticks)

    def sampled(frames):
        return frames[:, *grid].reshape(len(frames), -1) * np.float32(capture.scale)

    white, black = (capture.plain(step) for step in (0, 1))
    plain = [None if one is None else one[grid].ravel() for one in (white, black)]
    most = max(f.steps for f in fringes.values())
    response, flicker, few, kept = Response(), {}, {}, {}
    if min(f.steps for f in fringes.values()) < LEAST_STEPS:
        levels = sum(f.steps for f in fringes.values()) * math.prod(capture.size)
        keep = levels * capture.dtype.itemsize <= KEPT
        for k in fringes:
            frames = capture.frames(k)
            few[k] = sampled(frames)
            if keep:
                kept[k] = frames
            del frames  # before those of the next fringe are read
        lit = lit_pixels([*few.values()])
        flicker = dict(zip(few, flickers_of([f[:, lit] for f in few.values()]), strict=True))
    if gamma is not None:
        response = Response(gamma, told="the command")
    elif flicker:
        tell = {k: f for k, f in fringes.items() if f.steps == most}
        steady = [(few[k] / flicker[k][:, None]).astype(np.float32) for k in tell]
        response = response_of(steady, [*tell.values()], *plain)
    if black is not None and (response.black is not None or gamma is not None):
        full = None if response.white is None else white
        response = response._replace(black=black, white=full)
    fits, sample, gains, shown = [], [], [], []
    number = sum(f.steps for f in capture.patterns.fringes)
    every = max(1, math.ceil(math.sqrt(math.prod(capture.size) * number / SHOWN)))
    for k, fringe in fringes.items():
        frames = kept.pop(k) if k in kept else capture.frames(k)
        how = {"black": response.black, "white": response.white}
        sample.append(few[k] if k in few else sampled(frames))
        some = frames[:, ::every, ::every] * np.float32(capture.scale)
        shown.append(np.clip(np.rint(some), 0, WHITE).astype(np.uint8))
        lit = lit_pixels(sample[-1:])
        gains.append(flicker[k] if flicker else flicker_of(sample[-1][:, lit]))
        if (gains[-1] != 1).any():
            how["gains"] = gains[-1]
        if response.gamma != 1 and response.black is not None and len(lit) >= LEAST_LIT:
            dark = response.black if black is None else plain[1][lit]
            bright = None if response.white is None else plain[0][lit]
            how["blur"] = blur_of(sample[-1][:, lit], fringe, response.gamma, dark, bright)
        fits.append(fit_response(frames, fringe, shift, response.gamma, capture.full, **how))
        del frames  # before those of the next fringe are read
        if each is not None:
            each(fringe.steps)
    return fits, sample, gains, shown, response
