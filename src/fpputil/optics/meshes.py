"""Meshes from files, and what their topology says (Chapter 2)."""

import json
import math
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
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


def formats() -> list[str]:
    """Endings of the files `load_mesh` reads, sorted, without the dot."""
    return sorted((mesh_formats() | {"npz"}) - {"xyz"})  # xyz holds points alone


def load_mesh(path: str | Path) -> trimesh.Trimesh:
    """Read a mesh file as one mesh, in its own coordinates and units.

    Parameters
    ----------
    path : str or Path
        A local file of any mesh format trimesh reads: STL, OBJ, PLY, OFF, GLB, glTF; or NPZ with
        arrays ``vertices`` (V, 3) and ``facets`` (F, 3), as Thingi10K stores its models. A scene
        becomes one mesh, each of its parts in its place.

    Returns
    -------
    trimesh.Trimesh
        Equal vertices merged, faces that they leave without area dropped; no colours, no textures.

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
    path, suffix = _mesh_file(path)
    with _readable(path):
        read = _npz_mesh(path) if suffix == "npz" else _trimesh_mesh(path)
        promised = _COUNTS[suffix](path)[1] if suffix in ("ply", "off") else 0
    if len(read.faces) < promised:
        raise ValueError(
            f"{path} holds {len(read.faces)} of the {promised} faces that its header promises; "
            "a whole file is needed"
        )
    check_mesh(read, str(path))
    mesh = trimesh.Trimesh(read.vertices, read.faces, process=False)
    mesh.merge_vertices()
    corners = np.sort(mesh.faces, axis=1)  # slivers lose a corner in the file's float32
    whole = (np.diff(corners, axis=1) > 0).all(axis=1)
    if whole.any():
        mesh.update_faces(whole)
    return mesh


def counts(path: str | Path) -> tuple[int, int]:
    """Vertices and faces in a mesh file, found without loading it.

    Parameters
    ----------
    path : str or Path
        As for `load_mesh`.

    Returns
    -------
    vertices, faces : int
        As a header gives them, which counts a polygon of a PLY or OFF file once; lines counted
        where there is none (OBJ, text STL). STL has no vertices but the corners of its faces:
        0. Both are 0 for formats beyond those that `load_mesh` names.

    Raises
    ------
    FileNotFoundError, ValueError
        As from `load_mesh`, as far as the header tells.
    """
    path, suffix = _mesh_file(path)
    with _readable(path):
        return _COUNTS[suffix](path) if suffix in _COUNTS else (0, 0)


def _mesh_file(path: str | Path) -> tuple[Path, str]:
    path = Path(path)
    suffix = path.suffix[1:].lower()
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not a file; a mesh file is needed")
    if suffix not in formats():
        known = ", ".join(formats())
        raise ValueError(f"{path} ends in {suffix!r}; the mesh formats read here are {known}")
    return path, suffix


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # each format's reader fails in its own way
        found = f"{type(error).__name__}: {error}"
        raise ValueError(f"{path} cannot be read ({found}); a whole file is needed") from error


def _trimesh_mesh(path: Path) -> trimesh.Trimesh:
    return trimesh.load_scene(str(path), process=False).to_mesh()


def _npz_mesh(path: Path) -> trimesh.Trimesh:
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        vertices, facets = stored["vertices"], stored["facets"]
    if vertices.shape[1:] != (3,) or facets.shape[1:] != (3,) or facets.dtype.kind not in "iu":
        raise ValueError(
            f"vertices {vertices.shape} and facets {facets.shape} of {facets.dtype}; "
            "(V, 3) and (F, 3) of whole numbers are needed"
        )
    return trimesh.Trimesh(vertices.astype(float), facets.astype(np.int64), process=False)


def _npz_counts(path: Path) -> tuple[int, int]:
    with zipfile.ZipFile(path) as archive:
        return _npz_rows(archive, "vertices"), _npz_rows(archive, "facets")


def _npz_rows(archive: zipfile.ZipFile, name: str) -> int:
    npy = np.lib.format
    headers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    with archive.open(f"{name}.npy") as file:
        shape, _, _ = headers[npy.read_magic(file)](file)
    return math.prod(shape) // 3


def _ply_counts(path: Path) -> tuple[int, int]:
    head = _head(path)
    found = (re.search(rb"element\s+%s\s+(\d+)" % name, head) for name in (b"vertex", b"face"))
    vertices, faces = (int(match[1]) if match else 0 for match in found)
    return vertices, faces


def _off_counts(path: Path) -> tuple[int, int]:
    found = re.match(rb"\s*\w*OFF\s+(\d+)\s+(\d+)", re.sub(rb"#.*", b"", _head(path)))
    return (int(found[1]), int(found[2])) if found else (0, 0)


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(65536)


def _stl_counts(path: Path) -> tuple[int, int]:
    faces = int.from_bytes(_head(path)[80:84], "little")
    if path.stat().st_size == 84 + 50 * faces:
        return 0, faces
    corners, end = 0, b""
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            block = end + block.lower()
            corners += block.count(b"vertex")
            end = block[-5:]  # one letter short of the word, so that none counts twice
    return 0, corners // 3


def _obj_counts(path: Path) -> tuple[int, int]:
    vertices = faces = 0
    with path.open("rb") as file:
        while line := file.readline(65536):  # no text at all may be one line of any length
            if line[:2] == b"v ":
                vertices += 1
            elif line[:2] == b"f ":
                faces += max(len(line.split()) - 3, 0)
    return vertices, faces


def _gltf_counts(path: Path) -> tuple[int, int]:
    tree = _gltf_tree(path)
    sizes = [item["count"] for item in tree.get("accessors", [])]
    vertices = faces = 0
    for node in tree.get("nodes", []):
        shapes = tree["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []
        for shape in shapes:
            points = sizes[shape["attributes"]["POSITION"]]
            corners = sizes[shape["indices"]] if "indices" in shape else points
            vertices += points
            faces += corners // 3 if shape.get("mode", 4) == 4 else corners
    return vertices, faces


def _gltf_tree(path: Path) -> dict:
    with path.open("rb") as file:
        if path.suffix.lower() == ".gltf":
            return json.load(file)
        length = int.from_bytes(file.read(20)[12:16], "little")
        return json.loads(file.read(min(length, path.stat().st_size)))


_COUNTS = {
    "glb": _gltf_counts,
    "gltf": _gltf_counts,
    "npz": _npz_counts,
    "obj": _obj_counts,
    "off": _off_counts,
    "ply": _ply_counts,
    "stl": _stl_counts,
    "stl_ascii": _stl_counts,
}


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
