"""A folder of photographs and the patterns they were taken under (chapter 12)."""

from __future__ import annotations

import io
import os
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import tifffile

from fpputil.capture.files.images import (
    CHANNELS,
    READ,
    SUFFIXES,
    Levels,
    grey,
    levels_of,
    of_kind,
    pages_of,
    read_pixels,
)
from fpputil.capture.files.names import Shot, composed
from fpputil.capture.patterns import NAME, Patterns
from fpputil.checks import positive
from fpputil.files import write_whole
from fpputil.optics.fringes import WHITE

FOREIGN = ("__MACOSX", "-decoded")  # folders that others put beside photographs, by their end


@dataclass(frozen=True, eq=False)
class Capture:
    """Photographs in a folder, one for each pattern.

    Parameters
    ----------
    folder : Path
    patterns : Patterns
    shots : tuple of Shot
        In the order of time, all there.
    size, dtype
        Of every photograph: (height, width), pixels; uint8, uint16 or float32.
    full : float
        Grey level at which the camera is saturated.
    channel : {"grey", "red", "green", "blue"}
        Of photographs in colour.
    levels : Levels
        What the photographs themselves tell of `full`.
    colourful : bool
        Whether the photographs have colours.
    paths : dict of str to Path
        Where the files of the shots are: a name on the disk may be spelt in other bytes.
    """

    folder: Path
    patterns: Patterns
    shots: tuple[Shot, ...]
    size: tuple[int, int]
    dtype: np.dtype
    full: float
    channel: str = "grey"
    levels: Levels = Levels(WHITE, WHITE, "")
    colourful: bool = False
    paths: dict[str, Path] = field(default_factory=dict)

    @property
    def scale(self) -> float:
        """Factor that makes grey levels of 0 to 255 of the camera's own."""
        return WHITE / self.full

    def colours(self) -> np.ndarray | None:
        """Photograph in plain light as (H, W, 3) uint8 red, green, blue, if there is one."""
        white = self.shots[0]
        if white.fringe >= 0 or white.step != 0:
            return None
        image = np.clip(np.rint(self._read(white) * self.scale), 0, 255).astype(np.uint8)
        return image if image.ndim == 3 else np.stack([image] * 3, axis=2)

    def plain(self, step: int) -> np.ndarray | None:
        """Photograph in plain light (step 0) or in none (1), (H, W), grey of 255, if there is."""
        shots = [s for s in self.shots if s.fringe < 0 and s.step == step]
        if not shots:
            return None
        return grey(self._read(shots[0]), self.channel) * np.float32(self.scale)

    def of(self, fringe: int) -> list[Shot]:
        """Photographs of a fringe by step."""
        return sorted(s for s in self.shots if s.fringe == fringe)

    def frames(self, fringe: int) -> np.ndarray:
        """Photographs of a fringe by step, (N, H, W), as they are; two threads read them."""
        shots = self.of(fringe)
        mixed = self.colourful and self.channel == "grey"  # whose levels are not whole
        frames = np.empty((len(shots), *self.size), np.float32 if mixed else self.dtype)
        with ThreadPoolExecutor(2) as pool:
            for n, image in enumerate(pool.map(self._read, shots)):
                frames[n] = grey(image, self.channel)
        return frames

    def photographs(self, fringe: int) -> list[np.ndarray]:
        """Photographs of a fringe by step with their colours, (H, W) or (H, W, 3)."""
        return [self._read(shot) for shot in self.of(fringe)]

    def _read(self, shot: Shot) -> np.ndarray:
        """(H, W), or (H, W, 3), of the size and depth of the first."""
        path = self.paths[shot.file]
        image = read_pixels(path, shot.page)
        (height, width), (h, w) = image.shape[:2], self.size
        if (height, width) != (h, w) or image.dtype != self.dtype:
            raise ValueError(
                f"{path} is {width} x {height} of {image.dtype}, the first photograph {w} x {h} of "
                f"{self.dtype}; all need one size and depth"
            )
        return image


def open_capture(
    folder: str | Path,
    patterns: Patterns | None = None,
    full: float | None = None,
    channel: str = "grey",
) -> Capture:
    """Find the photographs of patterns in a folder. Chapter 12.

    Hidden files, and folders that other programs made, are passed over.

    Parameters
    ----------
    folder : path
    patterns : Patterns, optional
        By default those of ``patterns.toml`` in the folder.
    full : float, optional
        Grey level at which the camera is saturated; by default 255 for 8 bit, else as
        `levels_of` the photographs tells.
    channel : {"grey", "red", "green", "blue"}
        Which one of photographs in colour.

    Raises
    ------
    FileNotFoundError
        If there is no such folder, or photographs are missing; the message names them.
    ValueError
        If the first photograph cannot be read, or the patterns do not fit the folder.
    """
    folder = Path(folder)
    if channel not in CHANNELS:
        raise ValueError(f"channel {channel!r} given; one of {', '.join(CHANNELS)} is needed")
    patterns = of_folder(folder) if patterns is None else patterns
    readable = _readable(_there(folder), patterns.in_folders)
    pages = {name: pages_of(path) for name, path in readable.items()}
    shots = tuple(patterns.shots([name for name in pages for _ in range(pages[name])]))
    _check_there(folder, shots, pages)
    paths = {shot.file: readable[composed(shot.file)] for shot in shots}
    shot = next(shot for shot in shots if shot.fringe >= 0)
    first = read_pixels(paths[shot.file], shot.page)
    of_first = {"size": first.shape[:2], "dtype": first.dtype, "colourful": first.ndim == 3}
    capture = Capture(folder, patterns, shots, **of_first, full=WHITE, channel=channel, paths=paths)
    if full is not None:
        return replace(capture, full=positive("full", full, "grey levels"))
    levels = levels_of(capture._read(shot) for shot in shots)
    return replace(capture, full=levels.full, levels=levels)


def is_foreign(name: str) -> bool:
    """Whether a file or folder is no photograph and no pose, by its name: hidden, or a program's.

    >>> [is_foreign(name) for name in ("._a.png", "__MACOSX", "pose-00-decoded", "pose-00")]
    [True, True, True, False]
    """
    return name.startswith(".") or name.endswith(FOREIGN)


def _readable(folder: Path, in_folders: bool) -> dict[str, Path]:
    """Files of photographs in a folder, or in those inside it, too, by their `composed` names."""
    files = {}
    for room, rooms, names in os.walk(folder):
        rooms[:] = sorted(name for name in rooms if in_folders and not is_foreign(name))
        for name in sorted(names):
            if Path(name).suffix.lower() in SUFFIXES and not name.startswith("."):
                path = Path(room, name)
                files[composed(path.relative_to(folder).as_posix())] = path
    return files


def _check_there(folder: Path, shots: tuple[Shot, ...], pages: dict[str, int]) -> None:
    """FileNotFoundError that names missing photographs; ValueError, stacks of another number."""
    names = Counter(composed(shot.file) for shot in shots)
    missing = sorted(set(names) - set(pages))
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        number, others = sum(names[name] for name in pages), sorted(set(pages) - set(names))
        hint = f"; {len(others)} others are there, as {min(others, default='')}: name them (files)"
        raise FileNotFoundError(
            f"{', '.join(missing[:3])}{more} missing in {folder}: {number} of {len(shots)} "
            f"photographs found{hint if others else ''}; {READ} are read"
        )
    for file, needed in names.items():
        if pages[file] != needed:
            raise ValueError(
                f"{folder / file} holds {pages[file]} photographs; the patterns need {needed} "
                "of it, one after the other"
            )


def of_folder(folder: str | Path) -> Patterns:
    """The patterns of the pattern file in a folder; FileNotFoundError if there is none."""
    file = _there(Path(folder)) / NAME
    if not file.is_file():
        raise FileNotFoundError(
            f"no {NAME} in {folder}; copy it there, or say what was projected (--files, "
            "--pitches, --steps)"
        )
    return Patterns.load(file)


def read_photograph(path: str | Path, channel: str = "grey") -> np.ndarray:
    """One photograph as (H, W) uint8, uint16 or float32; colour becomes grey. Chapter 12.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is cut, empty, of another kind, or holds NaN.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/a.npy", np.full((2, 3), 7, np.uint16))
    ...     read_photograph(f"{folder}/a.npy").tolist()
    [[7, 7, 7], [7, 7, 7]]
    """
    return grey(read_pixels(Path(path)), channel)


def write_photograph(path: Path, image: np.ndarray) -> None:
    """Write (H, W) grey levels, or a stack (N, H, W) as TIFF or NPY, whole or not at all."""
    data = io.BytesIO()
    if of_kind(path) == ".npy":
        np.save(data, image)
    elif image.ndim == 3:
        tifffile.imwrite(data, image, photometric="minisblack")
    else:
        data.write(cv2.imencode(path.suffix, image)[1].tobytes())
    write_whole(path, data.getvalue())


def _there(folder: Path) -> Path:
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} given; there is no such folder")
    return folder
