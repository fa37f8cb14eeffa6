"""Meshes from files, and what their topology says (Chapter 2)."""

import re
from pathlib import Path

import numpy as np
import trimesh
from trimesh.exchange.load import mesh_formats


def genus(mesh: trimesh.Trimesh) -> int:
    """Genus of a closed surface, the number of through holes, from the Euler characteristic.

    ``chi = V - E + F = 2 (parts - genus)``, the genera of the connected parts summed.

    Raises
    ------
    ValueError
        If the surface is open or has no faces.

    Notes
    -----
    Chapter 2.
    """
    check_mesh(mesh, "mesh")
    if not mesh.is_watertight:
        raise ValueError("an open mesh given; the genus needs every edge to have two faces")
    return int(mesh.body_count - mesh.euler_number // 2)


def load_mesh(path: str | Path) -> trimesh.Trimesh:
    """Read a mesh file as one mesh, in its own coordinates and units.

    Parameters
    ----------
    path : str or Path
        A local file of any mesh format trimesh reads: STL, OBJ, PLY, OFF, GLB, glTF. A scene
        becomes one mesh, each of its parts in its place.

    Returns
    -------
    trimesh.Trimesh
        Equal vertices merged; colours and textures dropped.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the format is unknown, the file cannot be read or holds less than its header
        promises, has no faces, or has vertices that are not finite. An OBJ file promises
        nothing: cut off between two lines, it reads as a smaller mesh.

    Notes
    -----
    Chapter 2. `place` brings the mesh into view.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not a file; a mesh file is needed")
    suffix = path.suffix[1:].lower()
    if suffix not in mesh_formats():
        known = ", ".join(sorted(mesh_formats()))
        raise ValueError(f"{path} ends in {suffix!r}; the mesh formats read here are {known}")
    try:
        read = trimesh.load_scene(str(path), process=False).to_mesh()
    except Exception as error:  # each format's reader fails in its own way
        found = f"{type(error).__name__}: {error}"
        raise ValueError(f"{path} cannot be read ({found}); a whole file is needed") from error
    promised = _promised_faces(path, suffix)
    if len(read.faces) < promised:
        raise ValueError(
            f"{path} holds {len(read.faces)} of the {promised} faces that its header promises; "
            "a whole file is needed"
        )
    check_mesh(read, str(path))
    mesh = trimesh.Trimesh(read.vertices, read.faces, process=False)
    mesh.merge_vertices()
    return mesh


def _promised_faces(path: Path, suffix: str) -> int:
    """Faces that the header of a PLY or OFF file announces; 0 where a format announces none."""
    with path.open("rb") as file:
        head = file.read(65536)
    if suffix == "ply":
        found = re.search(rb"element\s+face\s+(\d+)", head)
    elif suffix == "off":
        found = re.match(rb"\s*\w*OFF\s+\d+\s+(\d+)", re.sub(rb"#.*", b"", head))
    else:
        found = None
    return int(found[1]) if found else 0


def check_mesh(mesh: trimesh.Trimesh, name: str) -> None:
    """Raise ValueError, in the mesh's ``name``, unless it has faces and finite vertices."""
    if len(mesh.faces) == 0:
        raise ValueError(f"{name} has no faces; a mesh needs at least one triangle")
    bad = int((~np.isfinite(mesh.vertices)).any(axis=1).sum())
    if bad:
        raise ValueError(
            f"{name} has {bad} NaN or infinite vertices of {len(mesh.vertices)}; all must be finite"
        )
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise ValueError(
            f"{name} has faces on vertices {mesh.faces.min()} to {mesh.faces.max()}; "
            f"there are vertices 0 to {len(mesh.vertices) - 1}"
        )
