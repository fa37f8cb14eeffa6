"""Absolute phase and depth from photographs of one's own, and what is odd about them (ch. 8)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.ndimage import grey_closing, grey_opening

from fpputil.decoding.geometric_constraint import phase_range
from fpputil.decoding.phase import THRESHOLD
from fpputil.decoding.triangulation import column, depth_of, triangulate
from fpputil.decoding.unwrap import TWO_PI
from fpputil.learning.evaluation import moved, predict_batch
from fpputil.learning.uncertainty import Uncertainty, doubt_of
from fpputil.learning.weights import Trained, check_rig
from fpputil.networks.geometry import Geometry
from fpputil.optics.fringes import WHITE
from fpputil.optics.system import Pitches, System

ALIKE = 0.97  # correlation of photographs of one pitch
LONG = 0.02  # share of pixels


@dataclass(frozen=True, eq=False)
class CheckedPhotographs:
    """What a prediction starts from; `check_photographs` makes it.

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
        """Those that the network was trained for."""
        return Pitches(**self.metadata["pitches"])

    @property
    def axis(self) -> int:
        """Along which the columns change most: 1, the rows of the camera, or 0."""
        return int(np.argmax([np.nanmedian(np.abs(g)) for g in np.gradient(self.columns)]))

    @property
    def period(self) -> float:
        """Camera pixels of a period of the high pitch, the median of the plane."""
        slopes = np.abs(np.gradient(self.columns, axis=self.axis))
        return float(self.pitches.high / np.nanmedian(slopes))

    @cached_property
    def fringes_seen(self) -> np.ndarray:
        """Where there are fringes, (H, W) bool: a guess, as one photograph has no modulation.

        Half the height from troughs to crests around a pixel must exceed `THRESHOLD`. Crests come
        from closing the brightest photograph of each pixel, over 1.25 high periods, troughs from
        opening the high ones. So light without fringes does not count, shadows and gaps narrower
        than that do, and the rim of an object is uncertain by as much. The amplitude that a
        network predicts does not serve: it never learned what to answer where there are none.
        """
        high = [k for k, name in enumerate(self.names) if name == "high"]
        size = [1, 1]
        size[self.axis] = 2 * int(0.625 * self.period) + 1
        crests = grey_closing(self.frames.max(axis=0), size=size)
        troughs = grey_opening(self.frames[high].min(axis=0), size=size)
        return (crests - troughs) / 2 > THRESHOLD


@dataclass(frozen=True, eq=False)
class DepthPrediction:
    """Maps (H, W) in float32, NaN outside the mask of `CheckedPhotographs.fringes_seen`.

    Phases in radians (phi_r is NaN if the method has none), the projector column in pixels, the
    depth in mm. Of the errors of Phi, radians, and of the depth, mm, 95 % stay below Phi_error and
    depth_error, a wrong order included (NaN if no `Uncertainty` is given). The points (H, W, 3),
    mm, are NaN outside the measuring range, too.
    """

    phi_h: np.ndarray
    phi_r: np.ndarray
    Phi: np.ndarray
    column: np.ndarray
    depth: np.ndarray
    Phi_error: np.ndarray
    depth_error: np.ndarray
    points: np.ndarray
    mask: np.ndarray


def expected_photographs(trained: Trained) -> list[str]:
    """The photographs that a network wants, in order and in words.

    >>> from fpputil.networks import SFNetMethod
    >>> made_for = {"camera": [120, 160], "extremes": [0, 251]}
    >>> made_for["pitches"] = {"high": 24, "mid": 114, "zmin": 304, "unit": 912}
    >>> expected_photographs(Trained(SFNetMethod(), None, made_for))
    ['pitch 24 (high), step 0 of 15', 'pitch 304 (zmin), step 0 of 15']
    """
    check_rig(trained)
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
    if sizes[0] != (size := f"{camera.width} x {camera.height}"):
        raise ValueError(f"photographs of {sizes[0]} pixels given; the system's camera has {size}")
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
    photographs = CheckedPhotographs(frames, names, trained.metadata, system, columns)
    if not photographs.fringes_seen.any():
        raise ValueError(f"no fringes seen; a modulation above {THRESHOLD:g} grey levels is needed")
    return photographs


def predict(
    trained: Trained,
    photographs: CheckedPhotographs,
    device="cpu",
    precision="auto",
    told: Uncertainty | None = None,
) -> DepthPrediction:
    """Phases, depth and points; ValueError if none is in the measuring range. Chapter 8.

    How large errors may be is `told` by the two phases of each pixel.
    """
    system, mask = photographs.system, photographs.fringes_seen
    trained, device, precision = moved(trained, device, precision)
    pitches, (low, high) = photographs.pitches, photographs.metadata["extremes"]
    geometry = Geometry.of(system, pitches, (low, high)).to(device)
    frames = (photographs.frames - low) / (high - low)
    (phases,) = predict_batch(trained, frames[None], geometry, precision)
    maps = (phases.phi_h, np.nan if phases.phi_r is None else phases.phi_r, phases.Phi)
    phi_h, phi_r, Phi = (np.where(mask, phase, np.nan) for phase in maps)
    points = triangulate(i := column(Phi, pitches.high), system)
    depth = depth_of(points, system)
    inside = (depth >= system.z_min) & (depth <= system.z_max)
    if not inside.any():
        raise ValueError(
            f"none of {mask.sum()} pixels has a depth of {system.z_min:g} to {system.z_max:g} mm; "
            "photographs, network and system must belong together"
        )
    points[~inside] = np.nan
    Phi_error = depth_error = np.full(mask.shape, np.nan)
    if told is not None:
        _, errors = told(doubt_of(trained, phases, mask))
        Phi_error = np.where(mask, errors, np.nan)
        with np.errstate(divide="ignore"):
            depth_error = column(Phi_error, pitches.high) / system.columns_per_mm(depth)
    maps = (phi_h, phi_r, Phi, i, depth, Phi_error, depth_error)
    maps = (a.astype(np.float32) for a in maps)
    return DepthPrediction(*maps, points, mask)


def wrong_photographs(photographs: CheckedPhotographs) -> list[str]:
    """Why these cannot be the photographs that the network wants, in sentences; mostly none."""
    return list(dict.fromkeys(_odd_pitches(photographs, photographs.fringes_seen)))


def warnings(photographs: CheckedPhotographs) -> list[str]:
    """What is unlike the photographs of the training, in sentences."""
    mask = photographs.fringes_seen
    odd = (_odd_levels, _long_range)
    sentences = [sentence for each in odd for sentence in each(photographs, mask)]
    return list(dict.fromkeys([*_odd_size(photographs), *sentences]))


def _odd_size(photographs) -> Iterator[str]:
    (height, width), (rows, columns) = photographs.columns.shape, photographs.metadata["camera"]
    if (height, width) != (rows, columns):
        yield (
            f"photographs of {width} x {height} pixels; the network was trained with {columns} x "
            f"{rows}. A period has {photographs.period:.1f} pixels; in the same field of view it "
            f"had {photographs.period * columns / width:.1f}"
        )


def _odd_levels(photographs, mask) -> Iterator[str]:
    low, high = photographs.metadata["extremes"]
    span, bright = high - low, np.percentile(photographs.frames[:, mask], 99)
    if not 0.4 <= (bright - low) / span <= 1.2:
        kind = "over" if bright > high else "under"
        yield f"{kind}-exposed: crests reach {bright:.0f}, in training up to {high:g}"
    for k, frame in enumerate(photographs.frames, 1):
        top, dark = min(frame[mask].max(), WHITE), np.percentile(frame, 2)
        if (share := np.mean(frame[mask] >= top - 0.5)) > 0.05:
            yield f"photograph {k}: {share:.0%} of the lit pixels are saturated at {top:.0f}"
        if dark > low + 0.05 * span:
            yield (
                f"photograph {k}: dark is grey level {dark:.0f}, in training {low:g}; keep other "
                "light out, or subtract a photograph without the projector's"
            )


def _long_range(photographs, mask) -> Iterator[str]:
    """Where the longer of several pitches cannot tell its own order within the measuring range."""
    system = photographs.system
    pitches = {getattr(photographs.pitches, name) for name in photographs.names}
    pitch = max(pitches)
    if len(pitches) == 1 or pitch >= system.projector.width:
        return
    low, high = phase_range(system, pitch)
    if (share := np.mean((high - low >= TWO_PI)[mask])) > LONG:
        yield (
            f"the measuring range of {system.z_min:g} to {system.z_max:g} mm is longer than a "
            f"period of pitch {pitch:g} at {share:.0%} of the pixels with fringes: points may be a "
            "period off there; give a system with a shorter range, if your object needs no more"
        )


def _odd_pitches(photographs, mask) -> Iterator[str]:
    """Photographs that show the same fringes, or the finer where the coarser belong."""
    axis, names, pitches = photographs.axis, photographs.names, photographs.pitches
    pairs = np.delete(mask, 0, axis) & np.delete(mask, -1, axis)
    # Steps from pixel to pixel over contrast: the finer the fringes, the greater.
    fineness = [
        np.abs(np.diff(frame, axis=axis))[pairs].sum() / max(frame[mask].std(), 1e-6)
        for frame in photographs.frames
    ]
    for j, k in combinations(range(len(names)), 2):
        first, second = getattr(pitches, names[j]), getattr(pitches, names[k])
        alike = np.corrcoef(photographs.frames[j][mask], photographs.frames[k][mask])[0, 1]
        if first != second and alike > ALIKE:
            yield f"photographs {j + 1} and {k + 1} show the same fringes; two pitches are needed"
        elif (second - first) * (fineness[j] - fineness[k]) < 0:
            yield f"photographs swapped: pitch {second:g} comes before {first:g}"
