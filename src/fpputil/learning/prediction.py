"""Absolute phase and depth from photographs of one's own, and what is odd about them (ch. 8)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import torch
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import grey_closing, grey_opening, uniform_filter

from fpputil.decoding.phase import THRESHOLD
from fpputil.decoding.triangulation import column, depth_of, triangulate
from fpputil.decoding.unwrap import TWO_PI
from fpputil.learning.devices import PRECISIONS, device_of, precision_of
from fpputil.learning.evaluation import predict_batch
from fpputil.learning.weights import Trained
from fpputil.networks.geometry import Geometry
from fpputil.networks.unet import lowered
from fpputil.optics.fringes import WHITE
from fpputil.optics.system import Pitches, System

PERIODS = 3  # in a piece of a row in which the pitch is looked for, if the object is so wide
FINE, COARSE = 0.17, 0.35  # how far off a pitch may be, with as many periods and with fewer
PIECES = 600  # are enough, evenly spread
CONTRAST = 0.2  # least of fringes, over their mean; strong ambient light leaves as much
ALIKE = 0.97  # correlation of photographs of one pitch


@dataclass(frozen=True, eq=False)
class CheckedPhotographs:
    """What a prediction starts from; `photographs` makes it.

    Frames (F, H, W) in grey levels 0 to 255, the frequency of each by name, what is known about
    the network, and the projector columns (H, W) on the plane in the middle of the range.
    """

    frames: np.ndarray
    names: tuple[str, ...]
    metadata: dict
    system: System
    columns: np.ndarray

    @property
    def pitches(self) -> Pitches:
        """Pitches that the network was trained for."""
        return Pitches(**self.metadata["pitches"])

    @property
    def axis(self) -> int:
        """Along which the columns change most: 1, the rows of the camera, or 0."""
        return int(np.argmax([np.nanmedian(np.abs(g)) for g in np.gradient(self.columns)]))

    def period(self, name: str) -> float:
        """Camera pixels of a period of a frequency, the median of the plane."""
        slopes = np.abs(np.gradient(self.columns, axis=self.axis))
        return float(getattr(self.pitches, name) / np.nanmedian(slopes))

    def window(self, along: int, across: int = 1) -> tuple[int, int]:
        """Size of a filter of pixels across the fringes and along them."""
        return (across, along) if self.axis else (along, across)


@dataclass(frozen=True, eq=False)
class DepthPrediction:
    """Maps (H, W) in float32, NaN outside the mask of `fringes_seen`.

    Phases in radians (phi_r is NaN if the method has none), the projector column in pixels, the
    depth in mm. The points (H, W, 3), mm, are NaN outside the measuring range, too.
    """

    phi_h: np.ndarray
    phi_r: np.ndarray
    Phi: np.ndarray
    column: np.ndarray
    depth: np.ndarray
    points: np.ndarray
    mask: np.ndarray


def expected_photographs(trained: Trained) -> list[str]:
    """The photographs that a network wants, in order and in words."""
    if lacking := {"pitches", "camera", "extremes"} - set(trained.metadata):
        raise ValueError(f"these weights do not say for which {min(lacking)} they are")
    pitches, shots = trained.metadata["pitches"], trained.method.photographs
    return [f"pitch {pitches[name]:g} ({name}), step {n} of {steps}" for name, steps, n in shots]


def check_photographs(trained: Trained, images, system: System) -> CheckedPhotographs:
    """Pictures (H, W) of grey levels 0 to 255, checked against network and system.

    ValueError if their number or size is wrong, or one is black, holds NaN or has no fringes.
    """
    order, camera = expected_photographs(trained), system.camera
    if len(images) != len(order):
        texts = "; ".join(f"{k}. {text}" for k, text in enumerate(order, 1))
        raise ValueError(f"{len(images)} photographs given; {len(order)} are needed: {texts}")
    sizes = [" x ".join(map(str, image.shape[::-1])) for image in images]
    if len(set(sizes)) > 1:
        raise ValueError(f"photographs of {', '.join(sizes)} pixels given; one size is needed")
    if sizes[0] != (own := f"{camera.width} x {camera.height}"):
        raise ValueError(f"photographs of {sizes[0]} pixels given; the system's camera has {own}")
    frames = np.stack(images).astype(np.float32)
    for k, frame in enumerate(frames, 1):
        if not np.isfinite(frame).all():
            raise ValueError(f"photograph {k} with NaN or infinite pixels given; take it again")
        if (top := frame.max()) <= 2 * THRESHOLD:
            raise ValueError(
                f"photograph {k} is black, its brightest grey level {top:.3g} of 255; pictures of "
                "12 bits in 16, or of numbers 0 to 1, must be scaled first"
            )
    names = tuple(name for name, *_ in trained.method.photographs)
    columns = system.columns_at((system.z_min + system.z_max) / 2)
    shown = CheckedPhotographs(frames, names, trained.metadata, system, columns)
    if not fringes_seen(shown).any():
        raise ValueError(f"no fringes seen; a modulation above {THRESHOLD:g} grey levels is needed")
    return shown


def fringes_seen(shown: CheckedPhotographs) -> np.ndarray:
    """Where there are fringes, (H, W) bool: a guess, as one photograph has no modulation.

    Half the height from troughs to crests around a pixel must exceed `THRESHOLD`. Crests come
    from closing the brightest photograph of each pixel, over 1.25 high periods, troughs from
    opening the high ones. So light without fringes does not count, shadows and gaps narrower
    than that do, and the rim of an object is uncertain by as much. The amplitude that a network
    predicts does not serve: it never learned what to answer where there are no fringes.
    """
    high = [k for k, name in enumerate(shown.names) if name == "high"]
    size = shown.window(2 * int(0.625 * shown.period("high")) + 1)
    crests = grey_closing(shown.frames.max(axis=0), size=size)
    troughs = grey_opening(shown.frames[high].min(axis=0), size=size)
    return (crests - troughs) / 2 > THRESHOLD


def predict(
    trained: Trained, shown: CheckedPhotographs, device="cpu", precision="auto"
) -> DepthPrediction:
    """Phases, depth and points; ValueError if none is in the measuring range. Chapter 8."""
    where, system, mask = device_of(device), shown.system, fringes_seen(shown)
    precision = precision_of(precision, where)
    network = trained.network.to(where, memory_format=torch.channels_last)
    if precision != "float32":
        network = lowered(network, PRECISIONS[precision])
    pitches, (low, high) = shown.pitches, shown.metadata["extremes"]
    geometry = Geometry.of(system, pitches, (low, high)).to(where)
    frames = (shown.frames - low) / (high - low)
    (found,) = predict_batch(replace(trained, network=network), frames[None], geometry, precision)
    phases = (found.phi_h, np.nan if found.phi_r is None else found.phi_r, found.Phi)
    phi_h, phi_r, Phi = (np.where(mask, phase, np.nan) for phase in phases)
    points = triangulate(i := column(Phi, pitches.high), system)
    depth = depth_of(points, system)
    inside = (depth >= system.z_min) & (depth <= system.z_max)
    if not inside.any():
        raise ValueError(
            f"none of {mask.sum()} pixels has a depth of {system.z_min:g} to {system.z_max:g} mm; "
            "photographs, network and system must belong together"
        )
    points[~inside] = np.nan
    maps = (a.astype(np.float32) for a in (phi_h, phi_r, Phi, i, depth))
    return DepthPrediction(*maps, points, mask)


def warnings(shown: CheckedPhotographs) -> list[str]:
    """What is unlike the photographs of the training, in sentences."""
    mask = fringes_seen(shown)
    return [*_odd_size(shown), *_odd_levels(shown, mask), *_odd_pitches(shown, mask)]


def _odd_size(shown) -> Iterator[str]:
    (h, w), (rows, columns), now = (
        shown.columns.shape,
        shown.metadata["camera"],
        shown.period("high"),
    )
    if (h, w) != (rows, columns):
        yield (
            f"photographs of {w} x {h} pixels; the network was trained with {columns} x {rows}. A "
            f"period has {now:.1f} pixels; in the same field of view it had {now * columns / w:.1f}"
        )


def _odd_levels(shown, mask) -> Iterator[str]:
    low, high = shown.metadata["extremes"]
    span, bright = high - low, np.percentile(shown.frames[:, mask], 99)
    if not 0.4 <= (bright - low) / span <= 1.2:
        kind = "over" if bright > high else "under"
        yield f"{kind}-exposed: crests reach {bright:.0f}, in training up to {high:g}"
    for k, frame in enumerate(shown.frames, 1):
        top, dark = min(frame[mask].max(), WHITE), np.percentile(frame, 2)
        if (share := np.mean(frame[mask] >= top - 0.5)) > 0.05:
            yield f"photograph {k}: {share:.0%} of the lit pixels are saturated at {top:.0f}"
        if dark > low + 0.05 * span:
            yield (
                f"photograph {k}: dark is grey level {dark:.0f}, in training {low:g}; keep other "
                "light out, or subtract a photograph without the projector's"
            )


def _odd_pitches(shown, mask) -> list[str]:
    names, pitches = shown.names, shown.pitches
    for j, k in combinations(range(len(names)), 2):
        alike = np.corrcoef(shown.frames[j][mask], shown.frames[k][mask])[0, 1]
        if alike > ALIKE and names[j] != names[k]:
            return [
                f"photographs {j + 1} and {k + 1} show the same fringes; two pitches are needed"
            ]
    wrong = list(_wrong_pitches(shown, mask))
    for a, b in combinations(dict.fromkeys(names), 2) if wrong else ():
        other = replace(shown, names=tuple({a: b, b: a}.get(name, name) for name in names))
        mask = fringes_seen(other)
        if mask.any() and not list(_wrong_pitches(other, mask)):
            before, after = (getattr(pitches, name) for name in (b, a))
            return [f"photographs swapped: pitch {before:g} comes before {after:g}"]
    return wrong


def _wrong_pitches(shown, mask) -> Iterator[str]:
    """Which photographs do not show the pitches of their names."""
    size = shown.window(round(shown.period("high")), 3)
    first, share = shown.frames[shown.names.index("high")], uniform_filter(mask.astype(float), size)
    shade = uniform_filter(np.where(mask, first, 0), size) / share.clip(0.1)
    for k, (frame, name) in enumerate(zip(shown.frames, shown.names, strict=True), 1):
        period, pitch = shown.period(name), getattr(shown.pitches, name)
        told = f"pitch {pitch:g} has {period:.1f} pixels at the middle of the range"
        factor, contrast, allowed = _seen(shown, frame / shade.clip(4), mask, pitch, period)
        if contrast < CONTRAST:
            yield f"photograph {k} shows no fringes of about {period:.1f} camera pixels; {told}"
        elif abs(factor - 1) > allowed:
            seen = f"{factor * period:.1f} camera pixels, as of pitch {factor * pitch:.0f}"
            yield f"photograph {k} shows fringes of {seen}; {told}"


def _seen(shown, picture, mask, pitch, period) -> tuple[float, float, float]:
    """Factor to a pitch whose fringes fit best, their contrast, and how far from 1 is still well.

    Rows are cut into pieces so short that depth hardly bends the fringes of the middle plane.
    """
    maps = (picture.clip(0, 3), shown.columns, mask)
    *maps, mask = maps if shown.axis else (a.T for a in maps)
    widths = mask.sum(axis=1)
    length = int(min(np.ceil(PERIODS * period), np.percentile(widths[widths > 0], 75)))
    every = np.s_[:, :: 1 + length // 16]
    *cut, lit = (sliding_window_view(a, length, 1)[every] for a in (*maps, mask))
    whole = lit.mean(axis=-1) > 0.95
    if length < max(4, 0.6 * period) or whole.sum() < 3:
        return 1.0, float(length < PERIODS * period), COARSE  # 1: the object is too narrow to tell
    I, columns = (a[whole][:: 1 + whole.sum() // PIECES] for a in cut)
    factors = np.geomspace(max(1 / 4, 2.1 / period), 4, 141)
    power = [_fitted(I, TWO_PI * columns / (factor * pitch)) for factor in factors]
    contrast = np.sqrt(2 * max(power) / I.size) / I.mean()
    return factors[np.argmax(power)], contrast, FINE if length >= PERIODS * period else COARSE


def _fitted(I, Phi) -> float:
    """Sum of squares, about its mean, of pieces (S, L) that sine and cosine of Phi explain."""
    I, c, s = (a - a.mean(axis=1, keepdims=True) for a in (I, np.cos(Phi), np.sin(Phi)))
    cc, ss, cs, a, b = (np.nansum(x, axis=1) for x in (c * c, s * s, c * s, I * c, I * s))
    return float(np.sum((a * a * ss - 2 * a * b * cs + b * b * cc) / (cc * ss - cs**2 + 1e-9)))
