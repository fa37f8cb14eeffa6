"""Where the models of a dataset come from: parts from seeds, a folder of meshes, Thingi10K."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import count, islice
from pathlib import Path

import trimesh

from fpputil.checks import whole
from fpputil.optics.parts import FAMILIES, family_of, part
from fpputil.optics.shapes import formats, load_mesh

HELD_OUT = ("camshaft", "fan", "lattice")
"""Families of parts that only the held-out split has."""

MAX_BYTES = 150_000_000
"""Size of the largest file that is loaded: 7 bytes of memory for each of a text STL file."""

MAX_FACES, MAX_VERTICES = 1_000_000, 1_500_000
"""Of the largest model that is used: its binary STL file, placed, with its tree, takes 0.84 GB."""


@dataclass(frozen=True)
class Model:
    """One solid a dataset is made from, known without being loaded.

    Parameters
    ----------
    name : str
        Unique within a dataset: ``part-00012``, ``gears/wheel.stl``, ``thingi10k-34783``.
    family, seed
        Of a part, one of `fpputil.optics.parts.FAMILIES`; empty and -1 for a file.
    path, sha256 : str
        File below its root folder, with forward slashes, and digest of its bytes (of glTF without
        the arrays in files of their own); empty for a part.
    """

    name: str
    family: str
    seed: int
    path: str
    sha256: str


def parts(
    number: int, families: Iterable[str] | str | None = None, first: int = 0
) -> tuple[Model, ...]:
    """Machine parts, their seeds counting up from `first`. Chapter 7.

    Parameters
    ----------
    number : int
    families : iterable of str, optional
        Seeds that draw another family are passed over; None takes all.

    Examples
    --------
    >>> [model.name for model in parts(2, "nut", first=10)]
    ['part-00063', 'part-00068']
    """
    number, first = whole("number", number, 1), whole("first", first, 0)
    families = FAMILIES if families is None else families
    wanted = {families} if isinstance(families, str) else set(families)
    if not wanted or wanted - set(FAMILIES):
        needed = f"one or more of {', '.join(FAMILIES)} are needed"
        raise ValueError(f"families {sorted(wanted, key=str)} given; {needed}")
    drawn = ((seed, family_of(seed)) for seed in count(first))
    kept = islice(((seed, family) for seed, family in drawn if family in wanted), number)
    return tuple(Model(f"part-{seed:05d}", family, seed, "", "") for seed, family in kept)


def seeded_models(
    number: int = 500, held_out: int | None = None, seed: int = 0
) -> tuple[tuple[Model, ...], tuple[Model, ...]]:
    """Parts for `generate`: common families, and those of `HELD_OUT` for a split of their own.

    Parameters
    ----------
    number : int
        Parts of the common families.
    held_out : int, optional
        Parts of the families held out; None takes a tenth of ``number``.

    Examples
    --------
    >>> models, held_out = seeded_models(20)
    >>> len(models), [model.family for model in held_out]
    (20, ['fan', 'fan'])
    """
    tenth = whole("models", number, 1) // 10
    held_out = tenth if held_out is None else whole("held_out", held_out, 0)
    first = 1_000_000 * whole("seed", seed, 0)
    common = parts(number, [family for family in FAMILIES if family not in HELD_OUT], first)
    return common, parts(held_out, HELD_OUT, first) if held_out else ()


def mesh_folder(
    root: str | os.PathLike, number: int | None = None
) -> tuple[tuple[Model, ...], tuple[str, ...]]:
    """Mesh files in a folder and in the folders below it, in the order of their paths. Chapter 7.

    A file with the bytes of an earlier one is left out: in training and test both, it would
    make the test easier. So are links, which may lead anywhere. No file is loaded yet.

    Parameters
    ----------
    root : path
    number : int, optional
        The first so many; None takes all. It is an error if there are fewer.

    Returns
    -------
    models : tuple of Model
    notes : tuple of str
        What was left out and why, a line each.

    Examples
    --------
    >>> models, notes = mesh_folder("meshes")  # doctest: +SKIP
    """
    root = Path(root)
    if not root.is_dir():
        raise NotADirectoryError(f"{root} given; a folder of mesh files is needed")
    files = [f for f in root.rglob("*") if f.is_symlink() or f.is_file()]
    paths = [f.relative_to(root).as_posix() for f in files if f.suffix[1:].lower() in formats()]
    return _different(root, {path: path for path in sorted(paths)}, number)


def thingi10k(
    number: int | None = None, cache: str | os.PathLike | None = None, download: bool = False
) -> tuple[Path, tuple[Model, ...], tuple[str, ...]]:
    """Thingi10K, ten thousand models people made for 3D printers, in the order of their numbers.

    Closed or not, all are taken: the camera sees surfaces alone. Chapter 7.

    Parameters
    ----------
    number : int, optional
        The first so many; None takes all.
    cache : path, optional
        The ``cache_dir`` of the package ``thingi10k``, which keeps and finds the files.
    download : bool
        Let the package download, some gigabytes, what its cache lacks. Without it the package is
        loaded off line, and stays so as long as the process lives.

    Returns
    -------
    root : Path
        Folder of the files.
    models, notes
        As of `mesh_folder`.

    Raises
    ------
    RuntimeError
        If the cache lacks something and ``download`` is False, or the download fails.

    Examples
    --------
    >>> root, models, notes = thingi10k(500, download=True)  # doctest: +SKIP
    """
    if not download:
        os.environ["HF_HUB_OFFLINE"] = "1"  # read by the package's libraries as they load
    try:
        import thingi10k as package
    except ImportError as error:
        raise ImportError(
            f"the package thingi10k does not load ({error}); pip install 'fpputil[thingi10k]'"
        ) from error
    try:
        package.init(variant="npz", cache_dir=None if cache is None else str(cache))
    except RuntimeError as error:
        how = "(--download), with a connection to huggingface.co and room for some gigabytes"
        why = " ".join(str(error).split())
        raise RuntimeError(f"Thingi10K is not there ({why}); ask for the download {how}") from error
    files = {entry["file_id"]: Path(entry["file_path"]) for entry in package.dataset()}
    root = next(iter(files.values())).parent
    names = {files[k].relative_to(root).as_posix(): f"thingi10k-{k}" for k in sorted(files)}
    return root, *_different(root, names, number)


def _different(
    root: Path, names: dict[str, str], number: int | None
) -> tuple[tuple[Model, ...], tuple[str, ...]]:
    """The first files whose bytes differ, as models of these names, and notes on the others."""
    least = 1 if number is None else whole("number", number, 1)
    models: dict[str, Model] = {}
    notes = []
    for path, name in names.items():
        if len(models) == number:
            break
        try:
            sha256 = None if (root / path).is_symlink() else _digest(root / path)
        except OSError as error:
            notes.append(f"{path} left out: {error.strerror}")
            continue
        if sha256 and sha256 not in models:
            models[sha256] = Model(name, "", -1, path, sha256)
        else:
            why = f"the same bytes as {models[sha256].path}" if sha256 else "a link"
            notes.append(f"{path} left out: {why}")
    if len(models) < least:
        but = f" ({len(notes)} left out; {notes[0]})" if notes else ""
        needed = f"{least} or more are needed; {', '.join(formats())} are read"
        raise ValueError(f"{root} holds {len(models)} different mesh files{but}, {needed}")
    return tuple(models.values()), tuple(notes)


def load_model(
    model: Model, root: str | os.PathLike | None = None
) -> tuple[trimesh.Trimesh, tuple[str, ...]]:
    """The mesh of a model, as it is: neither scaled nor moved. Chapter 7.

    Parameters
    ----------
    model : Model
    root : path, optional
        The folder a file was listed from; a part needs none.

    Returns
    -------
    mesh : trimesh.Trimesh
    notes : tuple of str
        What is unusual about it: ``"not watertight"``.

    Raises
    ------
    FileNotFoundError, ValueError
        If the model is to be passed over: its file is gone, cut, larger than `MAX_BYTES` or
        not as it was listed; or the mesh is larger than `MAX_FACES` or `MAX_VERTICES`, or none.

    Examples
    --------
    >>> mesh, notes = load_model(parts(1, "nut")[0])
    >>> mesh.is_watertight, notes
    (True, ())
    """
    if not model.path:
        return part(model.seed, model.family), ()
    if root is None:
        raise ValueError(f"{model.name} is a file; the folder it was listed from is needed")
    path = Path(root, model.path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} is gone; it was there when its folder was listed")
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise ValueError(f"{path} has {size / 1e6:.0f} MB; at most {MAX_BYTES / 1e6:.0f} MB fit")
    if _digest(path) != model.sha256:
        raise ValueError(f"{path} has changed since it was listed; list its folder anew")
    mesh = load_mesh(path)
    for what, most in (("faces", MAX_FACES), ("vertices", MAX_VERTICES)):
        if (number := len(getattr(mesh, what))) > most:
            raise ValueError(f"{path} has {number:,} {what}; at most {most:,} fit into memory")
    if not mesh.extents.any():
        raise ValueError(f"{path} has all its vertices in one point; a mesh needs an extent")
    return mesh, () if mesh.is_watertight else ("not watertight",)


def _digest(path: Path) -> str:
    """SHA-256 of the bytes of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
