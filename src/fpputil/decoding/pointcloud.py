"""Clouds of points: surface, file, fitted sphere and plane (chapter 6)."""

import os
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import trimesh
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from fpputil.checks import positive, whole
from fpputil.files import write_whole
from fpputil.optics.shapes import check_mesh

NEIGHBOURS = 16  # of a point, whose mean distance tells whether it is lone


def point_cloud(points: np.ndarray, mask: np.ndarray | None = None) -> np.ndarray:
    """The finite points of (H, W, 3) inside the mask as (P, 3), mm, in row order.

    >>> points = np.ones((4, 5, 3))
    >>> points[0, 0] = np.nan
    >>> point_cloud(points).shape
    (19, 3)
    """
    keep = np.isfinite(points).all(axis=-1)
    keep = keep if mask is None else keep & np.asarray(mask, bool)
    if not keep.any():
        raise ValueError("no finite point inside the mask given; a cloud needs at least one")
    return points[keep]


def clean_points(
    points: np.ndarray,
    sigma: np.ndarray | None = None,
    *,
    max_sigma: float | None = None,
    lone: float | None = None,
    min_area: int = 1,
) -> tuple[np.ndarray, dict[str, int]]:
    """Points without those that are uncertain, lone, or in specks. Chapter 12.

    Parameters
    ----------
    points : (H, W, 3) array
        mm; NaN where there is none.
    sigma : (H, W) array, optional
        Standard deviation of each depth, mm.
    max_sigma : float, optional
        Most of it that a point may have, mm.
    lone : float, optional
        Take away points whose mean distance to their 16 nearest neighbours is more than so many
        standard deviations above the mean of all (Rusu et al. 2008, as in PCL and Open3D).
    min_area : int
        Least pixels of a connected part of the picture.

    Returns
    -------
    (H, W, 3) array, dict of str to int
        The points, NaN where they were taken away; how many for each reason.

    Raises
    ------
    ValueError
        If a limit is no positive number, or `max_sigma` comes without `sigma`.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(12.0), np.arange(9.0))
    >>> points = np.stack([x, y, 600 + 0 * x], -1)
    >>> points[2, 3, 2] = 650
    >>> points[:, 9], points[:6, 10:] = np.nan, np.nan
    >>> clean_points(points, lone=3, min_area=20)[1]
    {'lone': 1, 'in specks': 6}
    """
    points, removed = points.copy(), {}

    def take(fault, why):
        fault &= np.isfinite(points).all(axis=-1)
        points[fault], removed[why] = np.nan, int(fault.sum())

    if max_sigma is not None:
        limit = positive("max_sigma", max_sigma, "mm")
        if sigma is None:
            raise ValueError(f"max_sigma {max_sigma} without sigma given; it is a limit of that")
        take(~(sigma <= limit), "uncertain")
    if lone is not None:
        take(_lone(points, positive("lone", lone, "standard deviations")), "lone")
    if whole("min_area", min_area, 0) > 1:
        take(_specks(np.isfinite(points).all(axis=-1), min_area), "in specks")
    return points, removed


def _lone(points, ratio) -> np.ndarray:
    """Where the mean distance to the nearest points is far above that of all, (H, W) bool."""
    lone, there = np.zeros(points.shape[:2], bool), np.isfinite(points).all(axis=-1)
    cloud = points[there]
    if len(cloud) > NEIGHBOURS:
        distances, _ = cKDTree(cloud).query(cloud, k=NEIGHBOURS + 1)
        mean = distances[:, 1:].mean(axis=1)
        lone[there] = mean > mean.mean() + ratio * mean.std()
    return lone


def _specks(mask, least) -> np.ndarray:
    """Parts of a mask of fewer pixels than `least`, (H, W) bool; corners connect, too."""
    _, parts, about, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    return mask & (about[:, cv2.CC_STAT_AREA] < least)[parts]


def surface(
    points: np.ndarray, max_edge: float = np.inf, colours: np.ndarray | None = None
) -> trimesh.Trimesh:
    """Triangles between neighbouring pixels of (H, W, 3) points. Chapter 6.

    Parameters
    ----------
    points : (H, W, 3) array
        mm; NaN pixels are left out.
    max_edge : float
        Triangles with a longer edge, mm, are dropped: they bridge a step in depth.
    colours : (H, W, 3) uint8 array, optional
        Of the points.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(3.0), np.arange(4.0))
    >>> len(surface(np.stack([x, y, 600 + 0 * x], -1)).faces)
    12
    """
    h, w = points.shape[:2]
    pixel = np.arange(h * w).reshape(h, w)
    a, b, c, d = pixel[:-1, :-1], pixel[:-1, 1:], pixel[1:, :-1], pixel[1:, 1:]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, c, b), (b, c, d))])
    vertices = points.reshape(-1, 3)
    faces = faces[np.isfinite(vertices).all(axis=1)[faces].all(axis=1)]
    corners = vertices[faces]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    faces = faces[(edges <= max_edge).all(axis=1)]
    if len(faces) == 0:
        raise ValueError(
            f"no triangle with edges up to {max_edge} mm between finite points; "
            "a surface needs neighbouring points"
        )
    used, faces = np.unique(faces, return_inverse=True)
    colours = None if colours is None else colours.reshape(-1, 3)[used]
    faces = faces.reshape(-1, 3)
    return trimesh.Trimesh(vertices[used], faces, vertex_colors=colours, process=False)


def typical_edge(points: np.ndarray) -> float:
    """Median distance of points (H, W, 3) that are neighbours in a row or a column, mm.

    >>> x, y = np.meshgrid(np.arange(3.0), np.arange(4.0))
    >>> typical_edge(np.stack([x, y, 600 + 0 * x], -1))
    1.0
    """
    steps = [np.linalg.norm(np.diff(points, axis=k), axis=-1).ravel() for k in (0, 1)]
    return float(np.nanmedian(np.concatenate(steps)))


def save_ply(
    path: str | os.PathLike, geometry, colours: np.ndarray | None = None, values: dict | None = None
) -> None:
    """Write points (P, 3) or a mesh with its normals, mm, as binary PLY, whole or not at all.

    `colours`, (P, 3) uint8, are those of the points; `values` by name, (P,) each, stand beside
    them as properties of their own.

    >>> path = getfixture("tmp_path") / "cloud.ply"
    >>> save_ply(path, np.eye(3))
    >>> trimesh.load(path).vertices.shape
    (3, 3)
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
        geometry.vertex_attributes = {k: np.float32(v) for k, v in (values or {}).items()}
    normals = {"vertex_normal": True} if isinstance(geometry, trimesh.Trimesh) else {}
    write_whole(path, geometry.export(file_type="ply", **normals))


@dataclass(frozen=True, eq=False)
class Sphere:
    """A fitted sphere: centre (3,), radius and RMS distance of the points from it, mm."""

    centre: np.ndarray
    radius: float
    rms: float


def fit_sphere(points: np.ndarray) -> Sphere:
    """Least-squares sphere through points (P, 3), mm, by distance. Chapter 6.

    Fewer than 4 points, or points in a plane, are refused. (`trimesh.nsphere.fit_nsphere`
    minimises squared radii, not distances.)

    >>> directions = np.random.default_rng(0).normal(size=(100, 3))
    >>> points = 100 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    >>> sphere = fit_sphere(points + (0, 0, 660))
    >>> round(sphere.radius, 6), sphere.centre.round(6) + 0
    (100.0, array([  0.,   0., 660.]))
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
    """Least-squares plane ``normal . x = distance`` through points (P, 3), mm. Chapter 6.

    >>> x, y = np.meshgrid(np.arange(5.0), np.arange(4.0))
    >>> plane = fit_plane(np.stack([x, y, 600 + 0 * x], -1).reshape(-1, 3))
    >>> plane.normal.round(6) + 0, round(plane.distance, 6)
    (array([0., 0., 1.]), 600.0)
    """
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
