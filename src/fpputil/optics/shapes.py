"""Things to measure: sphere, plane, stairs, machine parts, mesh files, and their poses.

Lengths in mm, vertices (V, 3); the camera is the world: x right, y down, z forward (Chapter 2).
"""

import io
import os
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from trimesh.exchange.load import mesh_formats

from fpputil import checks
from fpputil.checks import positive, seeded, whole
from fpputil.files import read_arrays
from fpputil.optics.parts import FAMILIES as FAMILIES
from fpputil.optics.parts import part as part
from fpputil.optics.parts.stock import outline, to_mesh
from fpputil.optics.system import CENTRE, SIZE

FARTHEST = 1e10  # trimesh tells vertices apart by their coordinates in 1e-8, as whole numbers


def sphere(
    radius: float = 100.0, centre: ArrayLike = (0.0, 0.0, 680.0), subdivisions: int = 6
) -> trimesh.Trimesh:
    """Closed sphere with its vertices on the surface, facets inside it. Chapters 2 and 6.

    Radius and centre in mm. Each of `subdivisions` quarters the facets of an icosahedron, which
    makes ``20 * 4**subdivisions`` faces. They lie inside the sphere by at most 0.30, on average
    0.18, ``* 4**-subdivisions`` of the radius: the default, 100 mm, by at most 0.0071 and 0.0045.

    >>> ball = sphere(100, (0, 0, 680), subdivisions=3)
    >>> ball.faces.shape, round(ball.bounds[0, 2])
    ((1280, 3), 580)
    """
    subdivisions, radius = whole("subdivisions", subdivisions, 0), positive("radius", radius, "mm")
    mesh = trimesh.creation.icosphere(subdivisions, radius)
    mesh.apply_translation(_point("centre", centre))
    return mesh


def plane(z: float, half_width: float = 300.0, half_height: float | None = None) -> trimesh.Trimesh:
    """Plane at depth ``z`` mm, facing the camera: two triangles of normal (0, 0, -1). Chapter 2.

    Half its width and height in mm on either side of the optical axis, the height 3/4 of the width
    unless given. The defaults fill the presets' view up to z = 1000 mm.

    >>> plane(660).extents.tolist()
    [600.0, 450.0, 0.0]
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
    """Stairs, closed, facing the camera on the optical axis, from left to right. Chapter 6.

    All in mm: heights of the steps above the back face at depth `z`, so that step k is the plane
    ``z - heights[k]``; the width of one step along x, and the length of all along y.

    >>> step_block((10, 30), width=40, length=120).extents.round(6).tolist()
    [80.0, 120.0, 30.0]
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
    """Turn by degrees about the paper's y axis, then its z axis, (3, 3) in camera axes. Chapter 2.

    The paper's axes are Blender's, as in its Table 2: the y axis is the camera's x (the object
    tips over), the z axis points up, the camera's -y (the object turns as on a table).

    Examples
    --------
    >>> (rotation(90, 0) @ (0, 1, 0)).round(6).tolist()
    [0.0, 0.0, 1.0]
    """
    return Rotation.from_euler("xy", [about_y, -about_z], degrees=True).as_matrix()


def rotations() -> np.ndarray:
    """The paper's 36 poses, (36, 3, 3): six steps of 60 degrees about y and about z each."""
    steps = np.arange(0.0, 360.0, 60.0)
    return np.stack([rotation(y, z) for y in steps for z in steps])


def place(
    mesh: trimesh.Trimesh,
    size: float | None = SIZE,
    centre: ArrayLike = CENTRE,
    rotation: ArrayLike | None = None,
) -> trimesh.Trimesh:
    """A copy of a mesh, scaled, turned and moved in front of the camera. Chapter 2.

    All three act on the ball around the mesh: the smallest one that has its centre in the
    middle of the bounding box. It does not change with the pose, and neither does the scale.

    `size` is the diameter of the ball, mm, and None keeps it; `centre` is where its centre goes,
    mm; `rotation`, (3, 3), is as from `rotation` or out of `rotations`, and None keeps the pose.

    >>> ball = place(sphere(subdivisions=2), size=50, rotation=rotation(60, 120))
    >>> ball.bounds.mean(axis=0).round().tolist(), round(ball.extents.max())
    ([0.0, 0.0, 650.0], 50)
    """
    check_mesh(mesh, "mesh")
    turn = np.eye(3) if rotation is None else checks.rotation_matrix("rotation", rotation)
    offset = mesh.vertices - mesh.bounds.mean(axis=0)
    diameter = 2 * np.linalg.norm(offset, axis=1).max()
    positive("mesh diameter", diameter, "mm")
    scale = 1.0 if size is None else positive("size", size, "mm") / diameter
    vertices = scale * offset @ turn.T + _point("centre", centre)
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def views(mesh: trimesh.Trimesh) -> Iterator[trimesh.Trimesh]:
    """The mesh placed in each of the 36 poses of `rotations`."""
    return (place(mesh, rotation=turn) for turn in rotations())


def texture(seed: int) -> Callable[[np.ndarray], np.ndarray]:
    """Smooth albedo all through space, like veins in marble, drawn from a seed. Chapter 2.

    It takes points (P, 3) in mm, gives their albedo (P,), within 0.3 to 0.95, and can be pickled.

    Examples
    --------
    >>> albedo = texture(seed=3)
    >>> albedo(np.zeros((2, 3))).shape
    (2,)
    """
    rng = seeded(seed)
    directions = rng.normal(size=(6, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    waves = 2 * np.pi * directions / rng.uniform(60.0, 250.0, (6, 1))
    phases = rng.uniform(0, 2 * np.pi, 6)
    low, high = rng.uniform(0.3, 0.6), rng.uniform(0.7, 0.95)
    return partial(_albedo, waves=waves, phases=phases, low=low, high=high)


def genus(mesh: trimesh.Trimesh) -> int:
    """Genus of a closed surface, the number of through holes, from the Euler characteristic.

    ``chi = V - E + F = 2 (parts - genus)``, the genera of the connected parts summed; the surface
    must be closed. Chapter 2.

    Examples
    --------
    >>> genus(sphere(subdivisions=1)), genus(part(1, "nut"))
    (0, 1)
    """
    check_mesh(mesh, "mesh")
    if not mesh.is_watertight:
        raise ValueError("an open mesh given; the genus needs every edge to have two faces")
    return int(mesh.body_count - mesh.euler_number // 2)


def formats() -> list[str]:
    """Endings of the files `load_mesh` reads, sorted, without the dot."""
    return sorted((mesh_formats() | {"npz"}) - {"xyz"})  # xyz holds points alone


def load_mesh(path: str | os.PathLike) -> trimesh.Trimesh:
    """Read a mesh file as one mesh, in its own coordinates and units. Chapter 2.

    A local file of any mesh format trimesh reads: STL, OBJ, PLY, OFF, GLB, glTF, a scene as one
    mesh; or NPZ with ``vertices`` (V, 3) and ``facets`` (F, 3), as Thingi10K stores its models.
    Equal vertices are merged, faces that they leave without area dropped; colours are not read.

    A file that is cut, has no faces, or a vertex that is not finite, is refused. But an OBJ file
    promises nothing: cut off between two lines, it reads as a smaller mesh.

    >>> path = getfixture("tmp_path") / "ball.ply"
    >>> _ = sphere(subdivisions=2).export(path)
    >>> load_mesh(path).faces.shape
    (320, 3)
    """
    path = Path(path)
    suffix = path.suffix[1:].lower()
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not a file; a mesh file is needed")
    if suffix not in formats():
        known = ", ".join(formats())
        raise ValueError(f"{path} ends in {suffix!r}; the mesh formats read here are {known}")
    try:
        mesh = _npz_mesh(path) if suffix == "npz" else _trimesh(path, suffix)
        promised = _promised_faces(path, suffix)
    except Exception as error:  # each format's reader fails in its own way
        reason = f"{type(error).__name__}: {checks.one_line(error)}"
        raise ValueError(f"{path} cannot be read ({reason}); a whole file is needed") from error
    if len(mesh.faces) < promised:
        raise ValueError(
            f"{path} holds {len(mesh.faces)} of the {promised} faces that its header promises; "
            "a whole file is needed"
        )
    check_mesh(mesh, str(path))
    if (far := np.abs(mesh.vertices).max()) > FARTHEST:
        raise ValueError(f"{path} has a coordinate of {far:g}; up to {FARTHEST:g} are told apart")
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices()
    corners = np.sort(mesh.faces, axis=1)  # slivers lose a corner in the file's float32
    distinct = (np.diff(corners, axis=1) > 0).all(axis=1)
    if distinct.any():
        mesh.update_faces(distinct)
    return mesh


def check_mesh(mesh: trimesh.Trimesh, name: str) -> None:
    """Raise ValueError, in the mesh's ``name``, unless it has faces and finite vertices."""
    if len(mesh.faces) == 0:
        raise ValueError(f"{name} has no faces; a mesh needs at least one triangle")
    if bad := int((~np.isfinite(mesh.vertices)).any(axis=1).sum()):
        raise ValueError(
            f"{name} has {bad} NaN or infinite vertices of {len(mesh.vertices)}; all must be finite"
        )
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise ValueError(
            f"{name} has faces on vertices {mesh.faces.min()} to {mesh.faces.max()}; "
            f"there are vertices 0 to {len(mesh.vertices) - 1}"
        )


def _trimesh(path: Path, suffix: str) -> trimesh.Trimesh:
    try:
        str(path).encode()
    except UnicodeEncodeError:  # trimesh opens no such name
        file = io.BytesIO(path.read_bytes())
        return trimesh.load_scene(file, suffix, process=False).to_mesh()
    return trimesh.load_scene(path, process=False).to_mesh()  # which finds files beside it


def _npz_mesh(path: Path) -> trimesh.Trimesh:
    stored = read_arrays(path)
    vertices, facets = stored["vertices"], stored["facets"]
    if vertices.shape[1:] != (3,) or facets.shape[1:] != (3,) or facets.dtype.kind not in "iu":
        raise ValueError(
            f"vertices {vertices.shape} and facets {facets.shape} of {facets.dtype}; "
            "(V, 3) and (F, 3) of whole numbers are needed"
        )
    return trimesh.Trimesh(vertices.astype(float), facets.astype(np.int64), process=False)


def _promised_faces(path: Path, suffix: str) -> int:
    """Faces, polygons counted once, that the header of a PLY or OFF file promises; else 0."""
    with path.open("rb") as file:
        head = re.sub(rb"#.*", b"", file.read(65536))
    counts = {"off": rb"\A\s*\w*OFF\s+\d+\s+(\d+)", "ply": rb"element\s+face\s+(\d+)"}
    promise = re.search(counts[suffix], head) if suffix in counts else None
    return int(promise[1]) if promise else 0


def _albedo(points, waves, phases, low, high) -> np.ndarray:
    veins = np.sin(0.5 * np.sin(np.asarray(points) @ waves.T + phases).sum(axis=-1))
    return low + (high - low) * (1 + veins) / 2


def _point(name: str, value: ArrayLike) -> np.ndarray:
    point = np.asarray(value, float)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise ValueError(f"{name} {value} given; three finite coordinates x, y, z in mm are needed")
    return point
