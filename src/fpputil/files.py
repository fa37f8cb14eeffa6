"""Files and folders that are written whole or not at all."""

from __future__ import annotations

import io
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np


def write_whole(path: str | os.PathLike, data: bytes) -> None:
    """Write a file whole or not at all: nothing half-written stays, whatever fails."""
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path} given; its folder {path.parent} does not exist")
    # Two machines that share a folder may have equal process numbers.
    partial = path.with_name(f"{path.name}.{os.getpid()}-{secrets.token_hex(4)}.part")
    try:
        with partial.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())  # or a power cut could leave an empty file of this name
        os.replace(partial, path)
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}, writing {path}") from error
    finally:
        partial.unlink(missing_ok=True)


def write_arrays(path: str | os.PathLike, arrays: dict[str, np.ndarray], compress=True) -> None:
    """Write arrays as NPZ, whole or not at all; without compression many times faster."""
    file = io.BytesIO()
    (np.savez_compressed if compress else np.savez)(file, **arrays)
    write_whole(path, file.getvalue())


@contextmanager
def folder_whole(path: str | os.PathLike, force: bool = False) -> Iterator[Path]:
    """A folder to fill, which takes its name only when all is in it.

    Parameters
    ----------
    path : path
        New, or empty.
    force : bool
        Take the place of a folder that is not empty.

    Yields
    ------
    Path
        Where to write; gone if anything fails, with what was at `path` left as it was.

    Raises
    ------
    ValueError
        If there is something at `path` and no force, or it is no folder.
    """
    path = Path(path)
    room = path.absolute().parent
    if not room.is_dir():
        raise FileNotFoundError(f"{path} given; its folder {room} does not exist")
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise ValueError(f"{path} is no folder; a new one is needed")
    if not force and path.exists() and any(path.iterdir()):
        raise ValueError(f"{path} is not empty; name another folder, or use --force")
    partial = room / f"{path.name}.{os.getpid()}-{secrets.token_hex(4)}.part"
    try:
        partial.mkdir()
        yield partial
        old = partial.with_suffix(".old")
        if path.exists():
            os.replace(path, old)
        os.replace(partial, path)
        shutil.rmtree(old, ignore_errors=True)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
