"""Depth: absolute phase to points in space (chapter 6)."""

from typing import NamedTuple

import numpy as np

from fpputil.optics.pinhole import Pinhole
from fpputil.optics.system import System

AT_ONCE = 2**16  # pixels, so that what is computed of them stays in the cache
STEPS, SETTLED = 20, 1e-3  # of Newton at most; projector pixels, of which the square is left


class Intersection(NamedTuple):
    """Where the camera's rays meet the light of the projector.

    Parameters
    ----------
    points : (H, W, 3) array
        World coordinates, mm; NaN where there is none.
    sigma : (H, W) array
        Standard deviation of the depth along the camera's axis, mm.
    miss : (H, W) array
        Distance between the point as the projector sees it and the column and row that were
        decoded, projector pixels. A column or a row alone is met exactly: NaN.
    inside : (H, W) bool array
        True where the point lies in the projector's picture.
    """

    points: np.ndarray
    sigma: np.ndarray
    miss: np.ndarray
    inside: np.ndarray


def column(Phi, pitch: float):
    """Projector column of an absolute phase: i = Phi pitch / 2 pi, pixels (paper, Eq. 5).

    >>> column(np.array([0.0, 2 * np.pi]), 24)
    array([ 0., 24.])
    """
    return Phi * (pitch / (2 * np.pi))


def triangulate(column, system: System, row=None) -> np.ndarray:
    """Points where camera rays meet the planes of light of projector columns or rows. Chapter 6.

    Parameters
    ----------
    column : (H, W) array or None
        Projector column seen by each camera pixel, pixels; NaN outside the mask. None if the
        fringes are horizontal.
    system : System
        Camera and projector; lens distortion of both is honoured.
    row : (H, W) array, optional
        Projector row, of horizontal fringes. With both, a pixel gets the point of `intersect`.

    Returns
    -------
    (H, W, 3) float64 array
        World coordinates, mm; NaN where nothing is known, where ray and plane are parallel, where
        they meet behind the camera, or where a lens distorts too much to follow.

    Examples
    --------
    >>> from fpputil.optics import preset
    >>> system = preset("tiny").system
    >>> points = triangulate(system.columns_at(650.0), system)
    >>> points.shape, round(float(depth_of(points, system)[60, 80]), 6)
    ((120, 160, 3), 650.0)
    """
    return intersect(column, row, system).points


def intersect(column, row, system: System, sigma=(1.0, 1.0)) -> Intersection:
    """Points on the camera's rays whose images in the projector fit column and row best. Chapter 6.

    A column makes a plane of light, a row another. Which of them cuts a ray sharply is a matter of
    where the projector stands: beside the camera it is the column's, above it the row's. Where
    both are known the point is the least-squares one along the ray, each weighted by its own
    uncertainty, so that the sharp one counts and the other one tests (`Intersection.miss`).

    Parameters
    ----------
    column, row : (H, W) array or None
        Of the projector, pixels; NaN where unknown.
    system : System
    sigma : two (H, W) arrays or numbers
        Standard deviations of columns and rows, pixels.

    Raises
    ------
    ValueError
        If a shape is not the camera's.

    Examples
    --------
    >>> from fpputil.optics import preset
    >>> tiny = preset("tiny").system
    >>> lit = tiny.projector.project(tiny.points_at(650.0))
    >>> result = intersect(lit[..., 0], lit[..., 1], tiny, (0.02, 0.02))
    >>> round(float(result.sigma[60, 80]), 3), bool(result.miss.max() < 1e-9)
    (0.088, True)
    """
    camera = system.camera
    light, noise = _images("column", column, camera), _images("sigma", sigma[0], camera)
    rows, noises = _images("row", row, camera), _images("sigma", sigma[1], camera)
    shape = camera.height, camera.width
    result = Intersection(
        np.full((*shape, 3), np.nan),
        *np.full((2, *shape), np.nan, np.float32),
        np.zeros(shape, bool),
    )
    flat = [a.reshape(-1, *a.shape[2:]) for a in result]
    known = np.flatnonzero(np.isfinite(light) | np.isfinite(rows))
    for here in np.split(known, range(AT_ONCE, len(known), AT_ONCE)):
        v, u = np.divmod(here, camera.width)
        place = np.unravel_index(here, shape)
        coordinates = np.stack([light[place], rows[place]], dtype=np.float64)
        sigmas = np.stack([noise[place], noises[place]], dtype=np.float64)
        parts = _intersect(np.stack([u, v], -1), coordinates, sigmas, system)
        for whole, part in zip(flat, parts, strict=True):
            whole[here] = part
    return result


def points_of(Phi, pitch: float, system: System, mask=None) -> np.ndarray:
    """Points of an absolute phase within the measuring range (paper, Eq. 5). Chapter 6.

    Parameters
    ----------
    Phi : (H, W) array
        Absolute phase of vertical fringes, radians, of the camera's size.
    pitch : float
        Projector pixels.
    system : System
    mask : (H, W) bool array, optional
        Pixels that count; by default all whose phase is not NaN.

    Returns
    -------
    (H, W, 3) float64 array
        World coordinates, mm; NaN outside the mask and the measuring range.

    Examples
    --------
    >>> from fpputil.optics import preset
    >>> tiny = preset("tiny")
    >>> Phi = 2 * np.pi * tiny.system.columns_at(650.0) / 24  # a plane, at pitch 24
    >>> points = points_of(Phi, 24, tiny.system)
    >>> points.shape, round(float(points[60, 80, 2]), 6)
    ((120, 160, 3), 650.0)
    """
    Phi = np.where(True if mask is None else mask, Phi, np.nan).astype(np.float64)
    points = triangulate(column(Phi, pitch), system)
    points[~in_range(depth_of(points, system), system)] = np.nan
    return points


def in_range(depth: np.ndarray, system: System) -> np.ndarray:
    """True where a depth, mm, lies within the measuring range; NaN does not."""
    with np.errstate(invalid="ignore"):
        return (depth >= system.z_min) & (depth <= system.z_max)


def _images(name, values, camera: Pinhole) -> np.ndarray:
    """An (H, W) view of numbers for each pixel; of a single one, or NaN of None."""
    shape = camera.height, camera.width
    values = np.asarray(np.nan if values is None else values)
    if values.shape not in ((), shape):
        raise ValueError(
            f"{name}s of shape {values.shape} given; the camera has {shape} pixels (H, W)"
        )
    return np.broadcast_to(values, shape)


def _intersect(pixels, light, sigma, system) -> tuple[np.ndarray, ...]:
    """`Intersection` of P pixels, (P, 2), that see light of columns and rows, (2, P)."""
    camera, projector = system.camera, system.projector
    rays = camera.rays(pixels)
    # On a ray the projector sees x = A z + B, z the depth: a column or row c is a z + b = 0.
    A, B, K = projector.R @ rays.T, projector.R @ camera.centre + projector.t, projector.K[:2]
    weight = np.where(np.isfinite(light), 1 / np.square(sigma), 0)
    light = np.nan_to_num(light)
    a, b = K @ A - light * A[2], (K @ B)[:, None] - light * B[2]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        z = -_sum(weight * a, b) / _sum(weight * a, a)
        if projector.distortion.any():
            z = _bend(z, A, B, light, weight, projector)
        z = np.where((z > 0) & np.isfinite(z), z, np.nan)
        lit, rate = _image(A, B, z, projector)
        sigma = np.float32(1 / np.sqrt(_sum(weight * rate, rate)))
    points = camera.centre + z[:, None] * rays
    known = np.isfinite(z)
    miss = np.where(known & (weight > 0).all(axis=0), np.hypot(*(lit - light)), np.nan)
    return points, np.where(known, sigma, np.nan), miss, known & projector.inside(lit.T)


def _bend(z, A, B, light, weight, projector) -> np.ndarray:
    """Depths (P,) of an ideal projector made those of its lens, by the method of Gauss and Newton.

    NaN where that does not settle, or so far off the axis that the lens folds the light back.
    """
    z, left = z.copy(), np.flatnonzero(np.isfinite(z))
    for _ in range(STEPS):
        lit, rate = _image(A[:, left], B, z[left], projector)
        w = weight[:, left]
        change = _sum(w * rate, rate)
        step = _sum(w * rate, lit - light[:, left]) / change
        z[left] -= step
        left = left[~(step * step * change < SETTLED**2 * np.maximum(*w))]
        if not left.size:
            break
    z[left] = np.nan
    x = A * z + B[:, None]
    far = np.flatnonzero(np.hypot(*x[:2]) > _reach(projector) * x[2])
    world = (x[:, far].T - projector.t) @ projector.R
    z[far[np.isnan(projector.project(world)).any(axis=1)]] = np.nan
    return z


def _image(A, B, z, projector):
    """Projector pixels (2, P) of the points A z + B, and how they move with z, pixels a mm."""
    x = A * z + B[:, None]
    xy = x[:2] / x[2]
    rate = (A[:2] - xy * A[2]) / x[2]
    lit = projector.pixels(xy.T).T
    if not projector.distortion.any():
        return lit, projector.K[:2, :2] @ rate
    near = 1e-6 * z
    return lit, (projector.pixels((xy + near * rate).T).T - lit) / near


def _sum(a, b):
    """Of the products over columns and rows, (P,), of (2, P)."""
    return np.einsum("kp,kp->p", a, b)


def _reach(projector: Pinhole) -> float:
    """How far off the axis, as x / z, the light of a projector comes: in its corners."""
    corners = [(u, v) for u in (0, projector.width - 1) for v in (0, projector.height - 1)]
    local = projector.rays(corners) @ projector.R.T
    return float(np.nan_to_num(np.hypot(*local[:, :2].T)).min())


def depth_of(points: np.ndarray, system: System) -> np.ndarray:
    """Depth along the camera's axis, (H, W), mm, of world points (H, W, 3)."""
    return points @ system.camera.R[2] + system.camera.t[2]
