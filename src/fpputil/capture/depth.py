"""Points of the fringes along both axes, and what tells that a system is another rig's (ch. 12)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fpputil.capture.faults.findings import Finding, finding_of
from fpputil.capture.measurement import Measurement
from fpputil.decoding.triangulation import Intersection, depth_of, in_range, intersect
from fpputil.decoding.unwrap import TWO_PI
from fpputil.optics.system import System

SHARE, MOST = 0.05, 0.5  # of the pixels in the mask: told from the one on, an error from the other
APART, TOO_FAR = 0.5, 0.9  # projector pixels, likewise; steps the other way shift by one
NOISE = 2.0  # times the standard deviation of columns or rows: less may be chance
DIFFERENT = 2.0  # projector pixels between column and row, beyond which a point is dropped
VAGUE, BLIND = 0.005, 0.02  # median uncertainty of the depth, of the measuring range, likewise
BLUNT = 3.0  # times as many pixels a millimetre by the other axis
FEW = 2000  # points, about, at which a system is asked


def locate(measurements: Sequence[Measurement], system: System) -> Intersection:
    """Points of all pixels in a mask, by columns, rows, or both, as `intersect` weighs them.

    Those outside the measuring range are there, too. Chapter 12.
    """
    by = {m.axis: m for m in measurements}
    columns, sigmas = zip(*(_pixels(by.get(axis)) for axis in ("column", "row")), strict=True)
    return intersect(*columns, system, sigmas)


def _pixels(m: Measurement | None):
    """Coordinates and their standard deviations, projector pixels; None if there are none."""
    if m is None:
        return None, None
    scale = m.pitch / TWO_PI
    return m.Phi.astype(np.float64) * scale, m.sigma * np.float32(scale)


def trusted(located: Intersection, system: System) -> np.ndarray:
    """True, (H, W), for points in the measuring range in which column and row do not differ."""
    with np.errstate(invalid="ignore"):
        differ = located.miss > DIFFERENT
    return in_range(depth_of(located.points, system), system) & ~differ


def diagnose_points(
    located: Intersection, measurements: Sequence[Measurement], system: System
) -> Iterator[Finding]:
    """What speaks against the points, or against the system that they come of. Chapter 12."""
    measurements = [m for m in measurements if m.mask.any()]
    mask = np.any([m.mask for m in measurements], axis=0)
    if not mask.any():
        return
    z, reach = depth_of(located.points[mask], system), (system.z_min, system.z_max)
    within = in_range(z, system)
    share, span = 1 - within.mean(), f"{reach[0]:g} to {reach[1]:g} mm"
    if share >= SHARE:
        with np.errstate(invalid="ignore"):
            near, far = (z < reach[0]).mean(), (z > reach[1]).mean()
        yield finding_of("range", share >= MOST, share=share, span=span, near=near, far=far)
    share = (within & ~located.inside[mask]).sum() / max(within.sum(), 1)
    if share >= SHARE:
        yield finding_of("beam", share >= MOST, share=share)
    miss = located.miss[mask][np.isfinite(located.miss[mask])]
    noise = max(float(np.median(m.sigma[m.mask])) * m.pitch / TWO_PI for m in measurements)
    if miss.size and (apart := float(np.median(miss))) >= max(APART, NOISE * noise):
        yield finding_of("apart", apart >= max(TOO_FAR, NOISE * noise), apart=apart)
    if not within.any():
        return
    sigma, span = float(np.median(located.sigma[mask][within])), reach[1] - reach[0]
    if sigma >= VAGUE * span:
        yield finding_of("vague", sigma >= BLIND * span, sigma=sigma)
    rates = dict(zip(("column", "row"), _rates(located.points[mask][within], system), strict=True))
    axis, other = sorted(rates, key=lambda axis: axis != measurements[0].axis)
    if len(measurements) == 1 and rates[other] > BLUNT * rates[axis]:
        yield finding_of("blunt", True, axis=axis, other=other, times=rates[other] / rates[axis])


def _rates(points, system) -> np.ndarray:
    """Median changes of column and row with the depth at points (P, 3), pixels a mm, (2,)."""
    points = points[:: max(1, len(points) // FEW)]
    way = (points - system.camera.centre) / depth_of(points, system)[:, None]
    ends = system.projector.project(np.stack([points - way / 2, points + way / 2]))
    return np.nanmedian(np.abs(ends[1] - ends[0]), axis=0)
