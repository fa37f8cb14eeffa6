"""Depth: absolute phase to points in space (chapter 6)."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scipy.optimize import least_squares

from fpputil.checks import write_whole
from fpputil.optics.meshes import check_mesh
from fpputil.optics.system import System


def column(Phi, pitch: float):
    """Projector column of an absolute phase: i = Phi pitch / 2 pi, pixels (Eq. 5)."""
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

    Raises
    ------
    ValueError
        If the column map does not have the camera's size.
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


def _meet(planes, rays, centre) -> np.ndarray:
    """Intersect rays (..., 3) from the centre with planes (..., 4): n x + d = 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.sum(planes[..., :3] * rays, axis=-1)
        scale = -(planes[..., :3] @ centre + planes[..., 3]) / slope
    scale = np.where((scale > 0) & np.isfinite(scale), scale, np.nan)
    return centre + scale[..., None] * rays


def _meet_bent(column, rays, centre, projector, rounds: int = 50) -> np.ndarray:
    """Points of columns (P,) that lens distortion bends; NaN where no point is found.

    The row decides how far the plane of light is bent, and follows from the point.
    """
    pose = np.column_stack([projector.R, projector.t])
    row = np.full_like(column, (projector.height - 1) / 2)
    for _ in range(rounds):
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


@dataclass(frozen=True, eq=False)
class PhaseHeight:
    """A polynomial at each pixel that turns absolute phase into height. Chapter 6.

    Parameters
    ----------
    centre, scale : (H, W) arrays
        Phase is taken as ``(Phi - centre) / scale``, within -1 to 1 on the planes fitted.
    coefficients : (degree + 1, H, W) array
        Constant term first, mm.
    """

    centre: np.ndarray
    scale: np.ndarray
    coefficients: np.ndarray

    def height(self, Phi: np.ndarray) -> np.ndarray:
        """Height, (H, W), mm, of an absolute phase (H, W)."""
        if np.shape(Phi) != self.centre.shape:
            raise ValueError(f"phase of shape {np.shape(Phi)} given; {self.centre.shape} is needed")
        x = (Phi - self.centre) / self.scale
        return np.polynomial.polynomial.polyval(x, self.coefficients, tensor=False)


def fit_phase_height(Phi: np.ndarray, heights, degree: int = 1) -> PhaseHeight:
    """Fit height as a polynomial of phase at each pixel from reference planes. Chapter 6.

    Parameters
    ----------
    Phi : (P, H, W) array
        Absolute phase on each plane, radians; a pixel that is NaN on any plane stays NaN.
    heights : (P,) array
        Heights of the planes, mm.
    degree : int
        1 for the linear model, 2 or more for the polynomial one.

    Raises
    ------
    ValueError
        If there are fewer planes than coefficients.
    """
    heights, Phi = np.asarray(heights, np.float64), np.asarray(Phi, np.float64)
    if not np.isfinite(heights).all():
        raise ValueError(f"heights {heights.tolist()} given; all must be finite")
    if Phi.ndim != 3 or len(Phi) != len(heights) or len(heights) <= degree or degree < 1:
        raise ValueError(
            f"{len(heights)} heights, phases of shape {Phi.shape} and degree {degree} given; "
            "a fit needs (P, H, W) phases of P planes, P above the degree, degree 1 or more"
        )
    low, high = Phi.min(axis=0), Phi.max(axis=0)
    centre, scale = (low + high) / 2, np.where(high > low, (high - low) / 2, np.nan)
    known = np.isfinite(scale)
    x = ((Phi - centre) / scale)[:, known].T
    powers = x[..., None] ** np.arange(degree + 1)
    coefficients = np.full((degree + 1, *scale.shape), np.nan)
    coefficients[:, known] = (np.linalg.pinv(powers) @ heights).T
    return PhaseHeight(centre, scale, coefficients)


def point_cloud(points: np.ndarray, mask: np.ndarray | None = None) -> np.ndarray:
    """The finite points of (H, W, 3) inside the mask as (P, 3), mm, in row order."""
    keep = np.isfinite(points).all(axis=-1)
    keep = keep if mask is None else keep & np.asarray(mask, bool)
    if not keep.any():
        raise ValueError("no finite point inside the mask given; a cloud needs at least one")
    return points[keep]


def surface(points: np.ndarray, max_edge: float = np.inf) -> trimesh.Trimesh:
    """Triangles between neighbouring pixels of (H, W, 3) points. Chapter 6.

    Parameters
    ----------
    points : (H, W, 3) array
        mm; NaN pixels are left out.
    max_edge : float
        Triangles with a longer edge, mm, are dropped: they bridge a step in depth.
    """
    h, w = points.shape[:2]
    pixel = np.arange(h * w).reshape(h, w)
    a, b, c, d = pixel[:-1, :-1], pixel[:-1, 1:], pixel[1:, :-1], pixel[1:, 1:]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, c, b), (b, c, d))])
    vertices = points.reshape(-1, 3)
    corners = vertices[faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    faces = faces[(edges <= max_edge).all(axis=1)]  # NaN compares false
    if len(faces) == 0:
        raise ValueError(
            f"no triangle with edges up to {max_edge} mm between finite points; "
            "a surface needs neighbouring points"
        )
    used, faces = np.unique(faces, return_inverse=True)
    return trimesh.Trimesh(vertices[used], faces.reshape(-1, 3), process=False)


def save_ply(path: str | os.PathLike, geometry, colours: np.ndarray | None = None) -> None:
    """Write points (P, 3) or a mesh, mm, as binary PLY, whole or not at all.

    Parameters
    ----------
    path : path
        Ends in ``.ply``.
    geometry : (P, 3) array or trimesh.Trimesh
        Coordinates in mm.
    colours : (P, 3) uint8 array, optional
        Of the points.
    """
    path = Path(path)
    if path.suffix != ".ply":
        raise ValueError(f"{path.name} given; a point cloud file ends in .ply")
    if isinstance(geometry, trimesh.Trimesh):
        check_mesh(geometry, "mesh")
        if colours is not None:
            raise ValueError("colours with a mesh given; they belong to points (P, 3)")
    else:
        points = _finite_points(geometry, 1)
        colours = None if colours is None else np.asarray(colours)
        if colours is not None and (colours.shape != points.shape or colours.dtype != np.uint8):
            raise ValueError(
                f"colours of shape {colours.shape} and dtype {colours.dtype} given; "
                f"{points.shape} points take as many uint8 colours"
            )
        geometry = trimesh.PointCloud(points, colours)
    write_whole(path, geometry.export(file_type="ply"))


@dataclass(frozen=True, eq=False)
class Sphere:
    """A fitted sphere: centre (3,), radius and RMS distance of the points from it, mm."""

    centre: np.ndarray
    radius: float
    rms: float


def fit_sphere(points: np.ndarray) -> Sphere:
    """Least-squares sphere through points (P, 3), mm, by distance. Chapter 6.

    Raises
    ------
    ValueError
        If there are fewer than 4 points, or they lie in a plane.
    """
    points = _finite_points(points, 4)
    middle = points.mean(axis=0)
    local = points - middle
    A = np.column_stack([2 * local, np.ones(len(local))])
    solution, _, rank, _ = np.linalg.lstsq(A, np.sum(local**2, axis=1), rcond=1e-9)
    if rank < 4:
        raise ValueError(f"{len(points)} points in a plane given; a sphere needs 4 that are not")
    start = np.append(solution[:3], np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 0)))
    fit = least_squares(lambda p: np.linalg.norm(local - p[:3], axis=1) - p[3], start)
    return Sphere(fit.x[:3] + middle, float(fit.x[3]), float(np.sqrt(np.mean(fit.fun**2))))


@dataclass(frozen=True, eq=False)
class Plane:
    """A fitted plane: unit normal (3,), distance from the origin and RMS residual, mm."""

    normal: np.ndarray
    distance: float
    rms: float


def fit_plane(points: np.ndarray) -> Plane:
    """Least-squares plane ``normal . x = distance`` through points (P, 3), mm. Chapter 6."""
    points = _finite_points(points, 3)
    middle = points.mean(axis=0)
    _, values, axes = np.linalg.svd(points - middle, full_matrices=False)
    if values[1] <= 1e-9 * max(values[0], 1e-300):
        raise ValueError(f"{len(points)} points on a line given; a plane needs 3 that are not")
    normal = axes[2] * (1 if axes[2] @ middle >= 0 else -1)
    residual = (points - middle) @ normal
    return Plane(normal, float(normal @ middle), float(np.sqrt(np.mean(residual**2))))


def _finite_points(points, least):
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < least:
        raise ValueError(f"points of shape {points.shape} given; (P, 3) is needed, P >= {least}")
    if not np.isfinite(points).all():
        raise ValueError("points with NaN given; take those inside the mask")
    return points
