"""A folder of photographs and the patterns they were taken under (chapter 12)."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from fpputil.capture.patterns import NAME, Patterns, Shot
from fpputil.checks import positive
from fpputil.optics.fringes import WHITE

SUFFIXES = (".png", ".bmp", ".tif", ".tiff", ".npy")
AT_ONCE = 8
"""Photographs in memory at a time, read by two threads."""


@dataclass(frozen=True, eq=False)
class Capture:
    """Photographs in a folder, one for each pattern.

    Parameters
    ----------
    folder : Path
    patterns : Patterns
    shots : tuple of Shot
        In the order of time, all there.
    size : (height, width)
        Pixels of every photograph.
    dtype : numpy.dtype
        uint8, uint16 or float32, of every photograph.
    full : float
        Grey level at which the camera is saturated.
    """

    folder: Path
    patterns: Patterns
    shots: tuple[Shot, ...]
    size: tuple[int, int]
    dtype: np.dtype
    full: float

    @property
    def scale(self) -> float:
        """Factor that makes grey levels of 0 to 255 of the camera's own."""
        return WHITE / self.full

    def colours(self) -> np.ndarray | None:
        """Photograph in plain light as (H, W, 3) uint8 red, green, blue, if there is one."""
        found = [s for s in self.shots if s.fringe < 0 and s.step == 0]
        if not found:
            return None
        self._read(found[0])  # which says so if it differs from the others
        image = read_colours(self.folder / found[0].file) * self.scale
        return np.clip(np.rint(image), 0, 255).astype(np.uint8)

    def of(self, fringe: int) -> list[Shot]:
        """Photographs of a fringe by step."""
        return sorted(s for s in self.shots if s.fringe == fringe)

    def batches(self, shots: Sequence[Shot]) -> Iterator[tuple[list[Shot], np.ndarray]]:
        """Photographs (n, H, W) of shots, at most `AT_ONCE` at a time, as they are."""
        with ThreadPoolExecutor(2) as pool:
            for first in range(0, len(shots), AT_ONCE):
                some = list(shots[first : first + AT_ONCE])
                yield some, np.stack(list(pool.map(self._read, some)))

    def _read(self, shot: Shot) -> np.ndarray:
        image = read_photograph(self.folder / shot.file)
        if image.shape != self.size or image.dtype != self.dtype:
            raise ValueError(
                f"{self.folder / shot.file} is {_shown(image.shape, image.dtype)}, the first "
                f"photograph {_shown(self.size, self.dtype)}; all need one size and depth"
            )
        return image


def open_capture(
    folder: str | Path, patterns: Patterns | None = None, full: float | None = None
) -> Capture:
    """Find the photographs of patterns in a folder. Chapter 12.

    Parameters
    ----------
    folder : path
    patterns : Patterns, optional
        By default those of ``patterns.toml`` in the folder.
    full : float, optional
        Grey level at which the camera is saturated; by default 255 for 8 bit and for floats,
        65535 for 16 bit.

    Raises
    ------
    FileNotFoundError
        If there is no such folder, or photographs are missing; the message names them.
    ValueError
        If the first photograph cannot be read, or the patterns do not fit the folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} given; there is no such folder")
    if patterns is None:
        patterns = of_folder(folder)
    names = sorted(e.name for e in os.scandir(folder) if _photograph(e))
    shots = patterns.shots(names)
    missing = sorted({s.file for s in shots} - set(names))
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise FileNotFoundError(
            f"{', '.join(missing[:3])}{more} missing in {folder}: {len(shots) - len(missing)} of "
            f"{len(shots)} photographs found{_unread(folder)}"
        )
    first = read_photograph(folder / shots[0].file)
    depth = 65535.0 if first.dtype == np.uint16 else WHITE
    full = depth if full is None else positive("full", full, "grey levels")
    return Capture(folder, patterns, tuple(shots), first.shape, first.dtype, full)


def of_folder(folder: str | Path) -> Patterns:
    """The patterns of the pattern file in a folder; FileNotFoundError if there is none."""
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} given; there is no such folder")
    if not (folder / NAME).is_file():
        raise FileNotFoundError(
            f"no {NAME} in {folder}; copy it there, or say what was projected (--files, "
            "--pitches, --steps)"
        )
    return Patterns.load(folder / NAME)


def read_photograph(path: str | Path) -> np.ndarray:
    """One photograph as (H, W) uint8, uint16 or float32; colour becomes grey. Chapter 12.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is cut, empty, of another kind, or holds NaN.
    """
    image = _pixels(Path(path))
    if image.ndim == 3:
        image = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_BGR2GRAY)
    return np.ascontiguousarray(image)


def read_colours(path: str | Path) -> np.ndarray:
    """One photograph as (H, W, 3) red, green, blue, uint8, uint16 or float32; grey is repeated.

    Raises as `read_photograph` does.
    """
    image = _pixels(Path(path))
    return image[..., ::-1] if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)


def _pixels(path: Path) -> np.ndarray:
    """(H, W), or (H, W, 3) with blue first, checked."""
    if not path.is_file():
        raise FileNotFoundError(f"{path} given; there is no such photograph")
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{path} given; {', '.join(s[1:] for s in SUFFIXES)} files are read")
    image = _array(path) if path.suffix.lower() == ".npy" else _image(path)
    if image.ndim == 3 and image.shape[2] == 4:
        image = image[..., :3]  # without the transparency
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[..., 0]
    if (image.ndim == 3 and image.shape[2] != 3) or image.ndim not in (2, 3) or 0 in image.shape:
        raise ValueError(f"{path} has shape {image.shape}; a photograph is (H, W), or has colours")
    if not np.isfinite(image).all():
        raise ValueError(f"{path} has pixels that are NaN or infinite; photograph again")
    return image


def _image(path: Path) -> np.ndarray:
    try:
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise ValueError(f"{path} cannot be read: {error.err or 'OpenCV refuses it'}") from error
    if image is None:
        raise ValueError(f"{path} is cut, or not an image that OpenCV reads")
    return _kept(path, image)


def _array(path: Path) -> np.ndarray:
    try:
        image = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # NumPy reads the head as Python text, and any error of it may come
        raise ValueError(f"{path} is cut, or not an array of numbers ({error})") from error
    if not isinstance(image, np.ndarray) or image.ndim not in (2, 3):
        raise ValueError(f"{path} has shape {np.shape(image)}; a photograph is (H, W)")
    image = _kept(path, image)
    return image[..., [2, 1, 0]] if image.ndim == 3 and image.shape[2] in (3, 4) else image


def _kept(path: Path, image: np.ndarray) -> np.ndarray:
    """uint8 and uint16 as they are, floats as float32."""
    if image.dtype in (np.uint8, np.uint16):
        return np.array(image)
    if image.dtype.kind == "f":
        return np.array(image, np.float32)
    raise ValueError(f"{path} has dtype {image.dtype}; uint8, uint16 or floats are read")


def _unread(folder: Path) -> str:
    """A word on the photographs of a folder that are of a kind that is not read."""
    read = f"; {', '.join(s[1:] for s in SUFFIXES)} are read"
    other = [p for p in folder.iterdir() if p.suffix.lower() in (".jpg", ".jpeg")]
    if not other:
        return read
    return f"{read}, JPEG ({len(other)} files here) is not: its compression turns the phase"


def _photograph(entry) -> bool:
    return entry.is_file() and Path(entry.name).suffix.lower() in SUFFIXES


def _shown(shape, dtype) -> str:
    return f"{shape[1]} x {shape[0]} of {dtype}"
