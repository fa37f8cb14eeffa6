"""Files and folders that are written whole or not at all, and never over a person's own."""

from __future__ import annotations

import ctypes
import errno
import hashlib
import io
import json
import os
import re
import secrets
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from fpputil.checks import one_line, parse_json, text

MARK = ".fpputil.json"
"""In a folder of results: the command that wrote it, and the SHA-256 of each file."""

PARTIAL = "*.*-????????.part"  # what `write_whole` leaves behind if its process is killed
LEFT = re.compile(r"\.\d+-[0-9a-f]{8}\.(part|old)")  # behind a name: its writer was killed


def write_whole(path: str | os.PathLike, data: bytes) -> None:
    """Write a file whole or not at all: nothing half-written stays, whatever fails."""
    path = Path(path)
    with _partial(path) as partial:
        try:
            with partial.open("xb") as file:
                file.write(data)
                _sync(file)
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


def read_arrays(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """All arrays of an NPZ file; ValueError with its path if it is cut or no such file."""
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as arrays:
            return dict(arrays)
    except FileNotFoundError:
        raise
    except Exception as error:  # ZIP, its compression and NumPy's heads have errors of their own
        raise ValueError(f"{path} is cut or no file of arrays ({one_line(error)})") from error


@contextmanager
def folder_whole(
    path: str | os.PathLike, by: str, force: bool = False, inputs: Sequence[str | os.PathLike] = ()
) -> Iterator[Path]:
    """A folder of results to fill, which takes its name only when all is in it.

    Parameters
    ----------
    path : path
        New, or empty.
    by : str
        The command that writes it.
    force : bool
        Take the place of results that the same command wrote and nobody has changed since.
    inputs : sequence of path
        What the results are made from; they may not lie at `path`.

    Yields
    ------
    Path
        Where to write; gone if anything fails, with what was at `path` left as it was.

    Raises
    ------
    ValueError
        If `path` is no folder, is or holds an input or the current directory, or holds something
        that may not be replaced, before or after the work.
    """
    path = Path(path)
    with _partial(path.absolute()) as partial:
        _check_place(path, by, force, inputs)
        try:
            partial.mkdir()
            yield partial
            _mark(partial, by)
            try:
                os.rename(partial, path)  # which takes the place of an empty folder alone
            except OSError as error:
                if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                    raise
                _check_place(path, by, force, inputs)
                _exchange(partial, path)
                try:  # once more, for somebody may have written there until now
                    _check_contents(partial, path, by)
                except ValueError:
                    _exchange(partial, path)
                    raise
        finally:
            shutil.rmtree(partial, ignore_errors=True)


def _check_place(path: Path, by: str, force: bool, inputs) -> None:
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise ValueError(f"{path} is no folder; a new one is needed")
    for kept in (*map(Path, inputs), Path.cwd()):
        if kept.resolve().is_relative_to(path.resolve()):
            name = "the current directory" if kept == Path.cwd() else kept
            raise ValueError(
                f"{path} given for the results; {name} lies there: name another folder"
            )
    if path.exists() and any(path.iterdir()):
        if not force:
            raise ValueError(f"{path} is not empty; name another folder, or use --force")
        _check_contents(path, path, by)


def _check_contents(folder: Path, name: Path, by: str) -> None:
    """ValueError that calls the folder `name` if it holds more than results of the command."""
    writer, foreign = _contents(folder)
    own = f"`{by} --force` replaces its own results alone: name another folder"
    if foreign:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise ValueError(f"{name} holds {foreign[0]}{more}, not as `{by}` wrote it; {own}")
    if writer not in ("", by):
        raise ValueError(f"{name} holds results of `{writer}`; {own}")


def _contents(folder: Path) -> tuple[str, list[str]]:
    """Who filled a folder, "" if nobody is known, and the files that are not as it left them."""
    try:
        mark = parse_json((folder / MARK).read_bytes(), {"by": text, "files": {...: text}})
    except (OSError, ValueError):
        mark = {"by": "", "files": {}}
    by, wrote = mark["by"], mark["files"]
    files = (f for f in sorted(folder.rglob("*")) if f.is_symlink() or not f.is_dir())
    names = {f.relative_to(folder).as_posix(): f for f in files if f != folder / MARK}
    return by, [n for n, f in names.items() if n not in wrote or wrote[n] != _digest(f)]


def _digest(file: Path) -> str:
    """SHA-256 of a file; "" of a link or a pipe."""
    plain = file.is_file() and not file.is_symlink()
    return hashlib.sha256(file.read_bytes()).hexdigest() if plain else ""


def _mark(folder: Path, by: str) -> None:
    """Sync all files of a folder to the disk, and say in it who wrote them."""
    files = [f for f in sorted(folder.rglob("*")) if f.is_file()]
    for file in files:
        with file.open("rb") as opened:
            _sync(opened)
    wrote = {f.relative_to(folder).as_posix(): _digest(f) for f in files}
    write_whole(folder / MARK, json.dumps({"by": by, "files": wrote}, indent=1).encode())


def _sync(file) -> None:
    file.flush()
    os.fsync(file.fileno())  # or a power cut could leave an empty file of this name


@contextmanager
def _partial(path: Path) -> Iterator[Path]:
    """Name to write under beside `path`, where what killed writers left of it is removed.

    A writer shares a lock of the folder as long as it lives: who has it alone has no living
    neighbour. Where the system cannot open or lock a folder, what is left stays.
    """
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path} given; its folder {path.parent} does not exist")
    try:
        import fcntl

        room = os.open(path.parent, os.O_RDONLY)
    except (ImportError, OSError):  # of Windows
        yield _name(path, "part")
        return
    try:
        with suppress(OSError):
            fcntl.flock(room, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _clear(path)
        with suppress(OSError):
            fcntl.flock(room, fcntl.LOCK_SH)
        yield _name(path, "part")
        with suppress(OSError):
            os.fsync(room)
    finally:
        os.close(room)


def _name(path: Path, suffix: str) -> Path:
    # Two machines that share a folder may have equal process numbers.
    return path.with_name(f"{path.name}.{os.getpid()}-{secrets.token_hex(4)}.{suffix}")


def _clear(path: Path) -> None:
    """Put back results whose writer was killed between two renames; remove what else is left."""
    names = (n for n in os.listdir(path.parent) if n.startswith(path.name))
    for name in sorted(n for n in names if LEFT.fullmatch(n[len(path.name) :])):
        left = path.with_name(name)
        if left.suffix == ".old" and not path.exists():
            os.rename(left, path)
        elif not left.is_dir():
            left.unlink()
        elif not (left / MARK).exists() or not _contents(left)[1]:
            shutil.rmtree(left)


def _exchange(a: Path, b: Path) -> None:
    """Let two folders take each other's name: in one step where the system can."""
    if _exchanged(a, b):
        return
    old = _name(b, "old")
    os.rename(b, old)
    try:
        os.rename(a, b)
    except BaseException:
        os.rename(old, b)
        raise
    os.rename(old, a)


def _exchanged(a: Path, b: Path) -> bool:
    names, swap = (os.fsencode(a), os.fsencode(b)), 2
    try:
        libc = ctypes.CDLL(None)
        if sys.platform == "darwin":
            return libc.renamex_np(*names, swap) == 0
        here = -100  # names are relative to the current directory
        return libc.renameat2(here, names[0], here, names[1], swap) == 0
    except (AttributeError, TypeError):  # another system
        return False
