"""Depth: absolute phase to points in space (chapter 6)."""

import numpy as np

from fpputil.optics.system import System


def column(Phi, pitch: float):
    """Projector column of an absolute phase: i = Phi pitch / 2 pi, pixels (Eq. 5).

    >>> column(np.array([0.0, 2 * np.pi]), 24)
    array([ 0., 24.])
    """
    return Phi * (pitch / (2 * np.pi))


def triangulate(column: np.ndarray, system: System) -> np.ndarray:
    """Points where camera rays meet the planes of light of projector columns. Chapter 6.

    Parameters
    ----------
    column : (H, W) array
        Projector column seen by each camera pixel, pixels; NaN outside the mask. Rows, from
        horizontal fringes, are not triangulated here.
    system : System
        Camera and projector; lens distortion of both is honoured.

    Returns
    -------
    (H, W, 3) float64 array
        World coordinates, mm; NaN where the column is NaN, where ray and plane are parallel,
        where they meet behind the camera, or where a lens distorts too much to follow.

    Examples
    --------
    >>> from fpputil.optics import preset
    >>> system = preset("tiny").system
    >>> points = triangulate(system.columns_at(650.0), system)
    >>> points.shape, round(float(depth_of(points, system)[60, 80]), 6)
    ((120, 160, 3), 650.0)
    """
    camera, projector = system.camera, system.projector
    column = np.asarray(column, np.float64)
    if column.shape != (camera.height, camera.width):
        raise ValueError(
            f"columns of shape {column.shape} given; the camera has "
            f"{(camera.height, camera.width)} pixels (H, W)"
        )
    rays = camera.rays()
    if not projector.distortion.any():
        planes = projector.P[0] - column[..., None] * projector.P[2]
        return _meet(planes, rays, camera.centre)
    points = np.full(rays.shape, np.nan)
    known = np.isfinite(column)
    points[known] = _meet_bent(column[known], rays[known], camera.centre, projector)
    return points


def points_of(Phi, pitch: float, system: System, mask=None) -> np.ndarray:
    """Points of an absolute phase within the measuring range (Eq. 5). Chapter 6.

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
    z = depth_of(points, system)
    with np.errstate(invalid="ignore"):
        points[~((z >= system.z_min) & (z <= system.z_max))] = np.nan
    return points


def _meet(planes, rays, centre) -> np.ndarray:
    """Intersect rays (..., 3) from the centre with planes (..., 4): n x + d = 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.sum(planes[..., :3] * rays, axis=-1)
        scale = -(planes[..., :3] @ centre + planes[..., 3]) / slope
    scale = np.where((scale > 0) & np.isfinite(scale), scale, np.nan)
    return centre + scale[..., None] * rays


def _meet_bent(column, rays, centre, projector) -> np.ndarray:
    """Points of columns (P,) that lens distortion bends; NaN where no point is found.

    The row decides how far the plane of light is bent, and follows from the point.
    """
    pose = np.column_stack([projector.R, projector.t])
    row = np.full_like(column, (projector.height - 1) / 2)
    for _ in range(50):
        local = projector.rays(np.stack([column, row], -1)) @ projector.R.T
        points = _meet(pose[0] - local[..., :1] * pose[2], rays, centre)
        moved = projector.project(points)
        settled = np.abs(moved[:, 1] - row) < 1e-7
        row = moved[:, 1]
        if settled[np.isfinite(row)].all():
            break
    return np.where(settled[:, None], points, np.nan)


def depth_of(points: np.ndarray, system: System) -> np.ndarray:
    """Depth along the camera's axis, (H, W), mm, of world points (H, W, 3)."""
    return points @ system.camera.R[2] + system.camera.t[2]
