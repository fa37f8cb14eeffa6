"""Mesh files below a folder, each content once, in an order that does not change."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from fpputil.checks import whole
from fpputil.optics.shapes import formats


def mesh_files(root: Path) -> tuple[list[str], list[str]]:
    """Mesh files in a folder and in the folders below it.

    Returns
    -------
    paths : list of str
        Relative to the root, with forward slashes, sorted.
    notes : list of str
        What was left out and why: links, which may lead anywhere or in circles, names that are
        not UTF-8, folders that may not be read.
    """
    paths, notes, known = [], [], set(formats())

    def closed(error: OSError) -> None:
        notes.append(_left_out(os.path.relpath(error.filename, root), str(error.strerror)))

    for parent, folders, files in os.walk(root, onerror=closed):
        meshes = [name for name in files if Path(name).suffix[1:].lower() in known]
        for path in (Path(parent, name) for name in folders + meshes):
            below = path.relative_to(root).as_posix()
            if path.is_symlink():
                notes.append(_left_out(below, "a link"))
            elif path.is_file() and not _is_text(below):
                notes.append(_left_out(below, "its name is not UTF-8"))
            elif path.is_file():
                paths.append(below)
    return sorted(paths), sorted(notes)


def different(
    root: Path, paths: Iterable[str], number: int | None, notes: Iterable[str] = ()
) -> tuple[dict[str, str], tuple[str, ...]]:
    """The first files whose bytes differ, with the SHA-256 of each.

    Parameters
    ----------
    root : Path
        Folder of the files.
    paths : iterable of str
        Relative to the root, in the order wanted.
    number : int, optional
        How many; None takes all.
    notes : iterable of str
        What was left out before.

    Returns
    -------
    digests : dict
        Path: digest, in hexadecimal.
    notes : tuple of str
        With the files left out here: those with the bytes of an earlier one, and those that
        cannot be read.

    Raises
    ------
    ValueError
        If there are none, or fewer than ``number``.
    """
    wanted = None if number is None else whole("number", number, 1)
    earlier, notes = {}, list(notes)
    for path in paths:
        if len(earlier) == wanted:
            break
        try:
            found = digest(root / path)
        except OSError as error:
            notes.append(_left_out(path, str(error.strerror)))
            continue
        if earlier.setdefault(found, path) != path:
            notes.append(_left_out(path, f"the same bytes as {earlier[found]}"))
    _check_enough(root, len(earlier), number, notes)
    return {path: found for found, path in earlier.items()}, tuple(notes)


def digest(path: Path) -> str:
    """SHA-256 of the bytes of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _check_enough(root: Path, found: int, number: int | None, notes: list[str]) -> None:
    but = f" ({len(notes)} not taken; {notes[0]})" if notes else ""
    if found == 0:
        raise ValueError(f"{root} holds no mesh files{but}; {', '.join(formats())} are read")
    if number is not None and found < number:
        raise ValueError(f"number {number} given; {root} holds {found} different models{but}")


def _is_text(name: str) -> bool:
    return name.encode(errors="replace").decode() == name


def _left_out(path: str, why: str) -> str:
    return f"{path} left out: {why}".encode(errors="backslashreplace").decode()
