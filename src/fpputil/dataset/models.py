"""Where the models of a dataset come from: parts from seeds, a folder of meshes, Thingi10K."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import count, islice
from pathlib import Path

import trimesh

from fpputil.checks import whole
from fpputil.dataset import thingi
from fpputil.dataset.listing import different, digest, mesh_files
from fpputil.optics.parts import FAMILIES, family_of, part
from fpputil.optics.shapes import load_mesh

MAX_FACES = 1_000_000
"""Faces of the largest model that is loaded, which keeps a process that reads it, places it and
builds its tree below 1.25 GB: a binary STL file of that many takes 0.84 GB, of two million 1.56."""

MAX_VERTICES = 1_500_000
"""Vertices of the largest model, three times those of a closed surface of `MAX_FACES`."""

MAX_BYTES = 150_000_000
"""Size of the largest file. Text needs this limit: a text STL file takes 7 bytes of memory for
each of its own, 1.06 GB for 145 MB and 500,000 faces."""


@dataclass(frozen=True)
class Model:
    """One solid a dataset is made from, known without being loaded.

    Parameters
    ----------
    name : str
        Unique within a dataset: ``part-00012``, ``gears/wheel.stl``, ``thingi10k-34783``.
    family : str
        Family of a part, one of `fpputil.optics.parts.FAMILIES`; empty for a file.
    seed : int
        Seed of a part; -1 for a file.
    path : str
        File below its root folder, with forward slashes; empty for a part.
    sha256 : str
        Digest of the bytes of the file, in hexadecimal; empty for a part. A glTF file keeps its
        arrays in files of their own, which are not counted in.
    """

    name: str
    family: str
    seed: int
    path: str
    sha256: str


def parts(
    number: int, families: Iterable[str] | str | None = None, first: int = 0
) -> tuple[Model, ...]:
    """Machine parts, their seeds counting up.

    Parameters
    ----------
    number : int
        How many, 1 or more.
    families : iterable of str, optional
        Seeds that draw another family are passed over; None takes all.
    first : int
        Seed to begin with.

    Raises
    ------
    ValueError
        If a family is unknown or none is given, or ``number`` or ``first`` is out of range.
    """
    number, first = whole("number", number, 1), whole("first", first, 0)
    wanted = _families(families)
    drawn = ((seed, family_of(seed)) for seed in count(first))
    kept = ((seed, family) for seed, family in drawn if family in wanted)
    return tuple(
        Model(f"part-{seed:05d}", family, seed, "", "") for seed, family in islice(kept, number)
    )


def _families(names: Iterable[str] | str | None) -> set[str]:
    if names is None:
        return set(FAMILIES)
    wanted = {names} if isinstance(names, str) else set(names)
    unknown = sorted(wanted - set(FAMILIES), key=str)
    if unknown or not wanted:
        given = f"family {unknown[0]!r}" if unknown else "no family"
        raise ValueError(f"{given} given; the families are {', '.join(FAMILIES)}")
    return wanted


def mesh_folder(
    root: str | os.PathLike, number: int | None = None
) -> tuple[tuple[Model, ...], tuple[str, ...]]:
    """Mesh files in a folder and in the folders below it, in the order of their paths.

    A file with the bytes of an earlier one is left out: in training and test both, it would
    make the test easier. So are links, which may lead anywhere or in circles, and names that
    are not text. The files are not loaded: whether each holds a mesh is for `load` to find.

    Parameters
    ----------
    root : path
        The folder.
    number : int, optional
        The first so many; None takes all.

    Returns
    -------
    models : tuple of Model
    notes : tuple of str
        What was left out and why, a line each.

    Raises
    ------
    FileNotFoundError, NotADirectoryError
        If there is no such folder.
    ValueError
        If it has no mesh files, or fewer different ones than ``number``.
    """
    root = Path(root)
    if not root.exists():
        raise FileNotFoundError(f"{root} does not exist; a folder of mesh files is needed")
    if not root.is_dir():
        raise NotADirectoryError(f"{root} is a file; the folder that holds it is needed")
    paths, notes = mesh_files(root)
    digests, notes = different(root, paths, number, notes)
    return tuple(Model(path, "", -1, path, sha) for path, sha in digests.items()), notes


def thingi10k(
    number: int | None = None, cache: str | os.PathLike | None = None, download: bool = False
) -> tuple[Path, tuple[Model, ...], tuple[str, ...]]:
    """Thingi10K, ten thousand models people made for 3D printers, in the order of their numbers.

    Closed or not, all are taken: the camera sees surfaces alone, and the list follows from the
    files, the same with and without the package ``thingi10k``. Only downloading needs that.

    Parameters
    ----------
    number : int, optional
        The first so many; None takes all.
    cache : path, optional
        The ``cache_dir`` of the package, which keeps its NPZ files or, taken if there are none
        of those, the raw files below it; None is the package's own default.
    download : bool
        Download the NPZ files into the cache if it holds neither.

    Returns
    -------
    root : Path
        Folder of the files.
    models : tuple of Model
    notes : tuple of str
        What was left out and why, a line each.

    Raises
    ------
    FileNotFoundError
        If the cache does not hold all of it and ``download`` is False.
    ImportError, RuntimeError
        If the package is needed and not installed; if the download fails.
    ValueError
        If ``number`` is more than there are.
    """
    root = thingi.found(thingi.default_cache() if cache is None else Path(cache), download)
    ids = thingi.ids(root)
    digests, notes = different(root, ids, number)
    models = (Model(f"thingi10k-{ids[path]}", "", -1, path, sha) for path, sha in digests.items())
    return root, tuple(models), notes


def load_model(
    model: Model, root: str | os.PathLike | None = None
) -> tuple[trimesh.Trimesh, tuple[str, ...]]:
    """The mesh of a model, as it is: neither scaled nor moved.

    Parameters
    ----------
    model : Model
        Out of a list above.
    root : path, optional
        The folder a file was listed from; a part needs none.

    Returns
    -------
    mesh : trimesh.Trimesh
    notes : tuple of str
        What is unusual about it: ``"not watertight"``.

    Raises
    ------
    FileNotFoundError
        If the file is gone.
    ValueError
        If the model is to be passed over: its file cannot be read, has changed since it was
        listed, lies outside the root, is larger than `MAX_BYTES` or has more than `MAX_FACES`
        faces or `MAX_VERTICES` vertices; or the mesh has no faces, vertices that are not
        finite, or all of them in one point.
    """
    if not model.path:
        return part(model.seed, model.family), ()
    path = _below(root, model)
    _check_size(path)
    _check_unchanged(path, model)
    mesh = load_mesh(path)
    _check_counts(path, len(mesh.vertices), len(mesh.faces))
    if not mesh.extents.any():
        raise ValueError(f"{path} has all its vertices in one point; a mesh needs an extent")
    return mesh, () if mesh.is_watertight else ("not watertight",)


def _below(root: str | os.PathLike | None, model: Model) -> Path:
    if root is None:
        raise ValueError(f"{model.name} is a file; the folder it was listed from is needed")
    path = Path(root, model.path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} is gone; it was there when its folder was listed")
    if not path.resolve().is_relative_to(Path(root).resolve()):
        raise ValueError(f"{model.path} given; a file below {root} is needed")
    return path


def _check_size(path: Path) -> None:
    """Refuse what would not fit into memory, without loading it."""
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise ValueError(f"{path} has {size / 1e6:.0f} MB; at most {MAX_BYTES / 1e6:.0f} MB fit")


def _check_unchanged(path: Path, model: Model) -> None:
    try:
        now = digest(path)
    except OSError as error:
        raise ValueError(f"{path} cannot be read ({error.strerror})") from error
    if now != model.sha256:
        raise ValueError(f"{path} has changed since it was listed; list its folder anew")


def _check_counts(path: Path, vertices: int, faces: int) -> None:
    limits = ("faces", faces, MAX_FACES), ("vertices", vertices, MAX_VERTICES)
    for what, found, most in limits:
        if found > most:
            raise ValueError(f"{path} has {found:,} {what}; at most {most:,} fit into memory")
