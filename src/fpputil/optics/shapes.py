"""Things to measure: sphere, plane, stairs, machine parts, mesh files, and their poses.

Lengths in mm, vertices (V, 3); the camera is the world: x right, y down, z forward (Chapter 2).
"""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from fpputil import checks
from fpputil.checks import positive, seeded, whole
from fpputil.optics.meshes import check_mesh, genus, load_mesh
from fpputil.optics.parts import FAMILIES, part
from fpputil.optics.parts.stock import outline, to_mesh

__all__ = ["CENTRE", "FAMILIES", "SIZE", "genus", "load_mesh", "part", "place", "plane", "rotation",
           "rotations", "sphere", "step_block", "texture", "views"]  # fmt: skip

SIZE = 240.0
"""Diameter in mm of the ball that a placed mesh fills. At `CENTRE` every pose of it is inside the
presets' camera view (a ball of 285 mm would touch it) and measuring range (z 480 to 820 mm)."""

CENTRE = (0.0, 0.0, 650.0)
"""Where the middle of that ball lies, mm."""


def sphere(
    radius: float = 100.0, centre: ArrayLike = (0.0, 0.0, 680.0), subdivisions: int = 6
) -> trimesh.Trimesh:
    """Sphere with its vertices on the surface, facets inside it.

    Parameters
    ----------
    radius : float
        Radius in mm.
    centre : (3,) array_like
        Centre in mm.
    subdivisions : int
        Each quarters the facets of an icosahedron: 20 * 4**subdivisions faces. A facet lies
        inside the sphere by at most 0.30 * 4**-subdivisions of the radius, on average 0.18: the
        default, 81920 faces of radius 100 mm, by at most 0.0071 and on average 0.0045 mm.

    Returns
    -------
    trimesh.Trimesh
        Closed, normals outwards.

    Raises
    ------
    ValueError
        If the radius is not positive.

    Notes
    -----
    Chapters 2 and 6; the paper measures a sphere of radius 100 mm.
    """
    mesh = trimesh.creation.icosphere(
        whole("subdivisions", subdivisions, 0), positive("radius", radius, "mm")
    )
    mesh.apply_translation(_point("centre", centre))
    return mesh


def plane(z: float, half_width: float = 300.0, half_height: float | None = None) -> trimesh.Trimesh:
    """Plane at depth ``z``, facing the camera: two triangles of normal (0, 0, -1).

    Parameters
    ----------
    z : float
        Depth in mm.
    half_width, half_height : float
        Extent on either side of the optical axis in mm; the height is 3/4 of the width unless
        given. The defaults fill the presets' view up to z = 1000 mm.

    Raises
    ------
    ValueError
        If z or an extent is not positive.

    Notes
    -----
    Chapters 2 and 6.
    """
    w = positive("half_width", half_width, "mm")
    h = positive("half_height", 0.75 * w if half_height is None else half_height, "mm")
    z = positive("z", z, "mm")
    return trimesh.Trimesh(
        [(-w, -h, z), (w, -h, z), (w, h, z), (-w, h, z)], [(0, 2, 1), (0, 3, 2)], process=False
    )


def step_block(
    heights: ArrayLike = (10.0, 20.0, 40.0, 60.0, 30.0),
    width: float = 40.0,
    length: float = 120.0,
    z: float = 700.0,
) -> trimesh.Trimesh:
    """Stairs facing the camera, from left to right.

    Parameters
    ----------
    heights : (K,) array_like
        Height of each step above the back face in mm: step k is the plane z - heights[k].
    width, length : float
        Extent of one step along x, and of all along y, in mm.
    z : float
        Depth of the back face in mm.

    Returns
    -------
    trimesh.Trimesh
        Closed, normals outwards, centred on the optical axis in x and y.

    Raises
    ------
    ValueError
        If there is no step, or a height, ``width`` or ``length`` is not positive.

    Notes
    -----
    Chapter 6.
    """
    heights = np.array([positive("heights", h, "mm") for h in np.ravel(heights)])
    if len(heights) == 0:
        raise ValueError("no heights given; a step block needs at least one step")
    width, length = positive("width", width, "mm"), positive("length", length, "mm")
    x = np.repeat((np.arange(len(heights) + 1) - len(heights) / 2) * width, 2)
    stairs = outline(np.c_[x, np.r_[0, np.repeat(heights, 2), 0]]).extrude(length)
    mesh = to_mesh(stairs.rotate((-90, 0, 0)))  # x, height, y -> x, y, -z
    mesh.apply_translation((0, -length / 2, z))
    return mesh


def rotation(about_y: float, about_z: float) -> np.ndarray:
    """Turn about the paper's y axis, then its z axis, as a (3, 3) matrix in camera axes.

    The paper's axes are Blender's, as in its Table 2: the y axis is the camera's x (the object
    tips over), the z axis points up, the camera's -y (the object turns as on a table).

    Parameters
    ----------
    about_y, about_z : float
        Angles in degrees.

    Notes
    -----
    Chapter 2.
    """
    return Rotation.from_euler("xy", [about_y, -about_z], degrees=True).as_matrix()


def rotations() -> np.ndarray:
    """The paper's 36 poses, (36, 3, 3): six steps of 60 degrees about y and about z each.

    Notes
    -----
    Chapter 2.
    """
    steps = np.arange(0.0, 360.0, 60.0)
    return np.stack([rotation(y, z) for y in steps for z in steps])


def place(
    mesh: trimesh.Trimesh,
    size: float | None = SIZE,
    centre: ArrayLike = CENTRE,
    rotation: ArrayLike | None = None,
) -> trimesh.Trimesh:
    """Copy of a mesh, scaled, turned and moved in front of the camera.

    All three act on the ball around the mesh: the smallest one that has its centre in the
    middle of the bounding box. It does not change with the pose, and neither does the scale.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Left as it is.
    size : float, optional
        Diameter of the ball in mm; None keeps the scale.
    centre : (3,) array_like
        Where the centre of the ball goes, mm.
    rotation : (3, 3) array_like, optional
        Rotation matrix, as from `rotation` or out of `rotations`; None keeps the pose.

    Raises
    ------
    ValueError
        If the mesh has no faces or vertices that are not finite, ``size`` is not positive, or
        ``rotation`` is not a rotation.

    Notes
    -----
    Chapter 2.
    """
    check_mesh(mesh, "mesh")
    turn = np.eye(3) if rotation is None else checks.rotation("rotation", rotation)
    offset = mesh.vertices - mesh.bounds.mean(axis=0)
    diameter = 2 * np.linalg.norm(offset, axis=1).max()
    positive("mesh diameter", diameter, "mm")
    scale = 1.0 if size is None else positive("size", size, "mm") / diameter
    vertices = scale * offset @ turn.T + _point("centre", centre)
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def views(
    mesh: trimesh.Trimesh, size: float | None = SIZE, centre: ArrayLike = CENTRE
) -> Iterator[trimesh.Trimesh]:
    """The mesh placed in each of the 36 poses of `rotations`; arguments as for `place`."""
    return (place(mesh, size, centre, turn) for turn in rotations())


def texture(seed: int) -> Callable[[np.ndarray], np.ndarray]:
    """Smooth albedo all through space, like veins in marble, drawn from a seed.

    Returns
    -------
    callable
        Takes points (P, 3) in mm, gives their albedo (P,), within 0.3 to 0.95. It can be
        pickled, so it may cross to another process.

    Notes
    -----
    Chapter 2.
    """
    rng = seeded(seed)
    directions = rng.normal(size=(6, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    waves = 2 * np.pi * directions / rng.uniform(60.0, 250.0, (6, 1))
    phases = rng.uniform(0, 2 * np.pi, 6)
    low, high = rng.uniform(0.3, 0.6), rng.uniform(0.7, 0.95)
    return partial(_albedo, waves=waves, phases=phases, low=low, high=high)


def _albedo(points, waves, phases, low, high) -> np.ndarray:
    veins = np.sin(0.5 * np.sin(np.asarray(points) @ waves.T + phases).sum(axis=-1))
    return low + (high - low) * (1 + veins) / 2


def _point(name: str, value: ArrayLike) -> np.ndarray:
    point = np.asarray(value, float)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise ValueError(f"{name} {value} given; three finite coordinates x, y, z in mm are needed")
    return point
