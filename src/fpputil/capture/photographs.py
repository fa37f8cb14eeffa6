"""A folder of photographs and the patterns they were taken under (chapter 12)."""

from __future__ import annotations

import io
import logging
import math
import os
import struct
import zlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import tifffile

from fpputil.capture.patterns import NAME, Patterns, Shot
from fpputil.checks import at_most, one_line, positive
from fpputil.files import write_whole
from fpputil.optics.fringes import WHITE

SUFFIXES = (".png", ".bmp", ".tif", ".tiff", ".npy")
READ = ", ".join(suffix[1:] for suffix in SUFFIXES)

# What is wrong with a file is told by an error, and only once.
logging.getLogger("tifffile").addHandler(logging.NullHandler())
cv2.setLogLevel(0)


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
        white = self.shots[0]
        if white.fringe >= 0 or white.step != 0:
            return None
        image = np.clip(np.rint(self._read(white) * self.scale), 0, 255).astype(np.uint8)
        return image if image.ndim == 3 else np.stack([image] * 3, axis=2)

    def plain(self, step: int) -> np.ndarray | None:
        """Photograph in plain light (step 0) or in none (1), (H, W), grey of 255, if there is."""
        shots = [s for s in self.shots if s.fringe < 0 and s.step == step]
        return _grey(self._read(shots[0])) * np.float32(self.scale) if shots else None

    def of(self, fringe: int) -> list[Shot]:
        """Photographs of a fringe by step."""
        return sorted(s for s in self.shots if s.fringe == fringe)

    def frames(self, fringe: int) -> np.ndarray:
        """Photographs of a fringe by step, (N, H, W), as they are; two threads read them."""
        shots = self.of(fringe)
        frames = np.empty((len(shots), *self.size), self.dtype)
        with ThreadPoolExecutor(2) as pool:
            for n, image in enumerate(pool.map(self._read, shots)):
                frames[n] = _grey(image)
        return frames

    def _read(self, shot: Shot) -> np.ndarray:
        """(H, W), or (H, W, 3), of the size and depth of the first."""
        path = self.folder / shot.file
        image = _pixels(path)
        (height, width), (h, w) = image.shape[:2], self.size
        if (height, width) != (h, w) or image.dtype != self.dtype:
            raise ValueError(
                f"{path} is {width} x {height} of {image.dtype}, the first photograph {w} x {h} of "
                f"{self.dtype}; all need one size and depth"
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
    patterns = of_folder(folder) if patterns is None else patterns
    names = sorted(os.listdir(_there(folder)))
    readable = [n for n in names if Path(n).suffix.lower() in SUFFIXES and (folder / n).is_file()]
    shots = patterns.shots(readable)
    missing = sorted({s.file for s in shots} - set(readable))
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        jpeg = sum(n.lower().endswith((".jpg", ".jpeg")) for n in names)
        lossy = f", JPEG ({jpeg} files here) is not: its compression turns the phase"
        raise FileNotFoundError(
            f"{', '.join(missing[:3])}{more} missing in {folder}: {len(shots) - len(missing)} of "
            f"{len(shots)} photographs found; {READ} are read{lossy if jpeg else ''}"
        )
    first = read_photograph(folder / shots[0].file)
    depth = 65535.0 if first.dtype == np.uint16 else WHITE
    full = depth if full is None else positive("full", full, "grey levels")
    return Capture(folder, patterns, tuple(shots), first.shape, first.dtype, full)


def of_folder(folder: str | Path) -> Patterns:
    """The patterns of the pattern file in a folder; FileNotFoundError if there is none."""
    file = _there(Path(folder)) / NAME
    if not file.is_file():
        raise FileNotFoundError(
            f"no {NAME} in {folder}; copy it there, or say what was projected (--files, "
            "--pitches, --steps)"
        )
    return Patterns.load(file)


def read_photograph(path: str | Path) -> np.ndarray:
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
    return _grey(_pixels(Path(path)))


def _grey(image: np.ndarray) -> np.ndarray:
    return cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) if image.ndim == 3 else image


def write_photograph(path: Path, image: np.ndarray) -> None:
    """Write (H, W) grey levels as `read_photograph` reads them, whole or not at all."""
    if _is_array(path):
        np.save(data := io.BytesIO(), image)
        write_whole(path, data.getvalue())
    else:
        write_whole(path, cv2.imencode(path.suffix, image)[1].tobytes())


def _is_array(path: Path) -> bool:
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{path} given; {READ} files are read")
    return path.suffix.lower() == ".npy"


def _pixels(path: Path) -> np.ndarray:
    """(H, W), or (H, W, 3) with red first, checked."""
    if not path.is_file():
        raise FileNotFoundError(f"{path} given; there is no such photograph")
    is_array = _is_array(path)
    try:
        image = _array(path) if is_array else _image(path)
    except Exception as error:  # NumPy reads the head as Python text, and any error of it may come
        kind = "an array of numbers" if is_array else "an image"
        raise ValueError(f"{path} is cut, or not {kind} ({one_line(error)})") from error
    if image.dtype.kind == "f":
        with np.errstate(over="ignore"):  # what is too large becomes infinite, and is refused
            image = image.astype(np.float32, copy=False)
    elif image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"{path} has dtype {image.dtype}; uint8, uint16 or floats are read")
    if not image.size or image.shape[2:] not in ((), (1,), (3,), (4,)) or image.ndim == 1:
        raise ValueError(f"{path} has shape {image.shape}; a photograph is (H, W), or has colours")
    if image.ndim == 3:  # OpenCV puts red last but for the transparency, which goes
        channels = [0, 1, 2] if is_array else [2, 1, 0]
        image = image[..., 0 if image.shape[2] == 1 else channels]
    if not np.isfinite(image).all():
        raise ValueError(f"{path} has pixels that are NaN or infinite; photograph again")
    return np.ascontiguousarray(image)


def _array(path: Path) -> np.ndarray:
    """A .npy file; one whose head promises more than there is cannot be mapped."""
    array = np.lib.format.open_memmap(path, mode="r")
    at_most("pixels", math.prod(array.shape[:2]), "FPP_MOST_PIXELS")
    return np.array(array, array.dtype.newbyteorder("="))


def _image(path: Path) -> np.ndarray:
    data = path.read_bytes()  # for OpenCV cannot open a file whose name is not UTF-8
    at_most("pixels", _promised(data), "FPP_MOST_PIXELS")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ValueError("OpenCV does not read it")
    return image


def _promised(data: bytes) -> int:
    """Number of pixels by the head of an image."""
    if data.startswith(b"\x89PNG"):
        _check_chunks(data)
        width, height = struct.unpack_from(">II", data, 16)
    elif data.startswith(b"BM"):
        width, height = struct.unpack_from("<HH" if data[14] == 12 else "<ii", data, 18)
    else:
        with tifffile.TiffFile(io.BytesIO(data)) as file:
            width, height = file.pages[0].imagewidth, file.pages[0].imagelength
    return abs(width * height)


def _check_chunks(data: bytes) -> None:
    """ValueError unless the chunks of a PNG are whole: OpenCV takes memory for all they promise."""
    at, kind, view = 8, b"", memoryview(data)
    while kind != b"IEND":
        length, kind = struct.unpack_from(">I4s", data, at)
        end = at + 8 + length
        if zlib.crc32(view[at + 4 : end]) != struct.unpack_from(">I", data, end)[0]:
            raise ValueError(f"the CRC at {end} is wrong")
        at = end + 4


def _there(folder: Path) -> Path:
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} given; there is no such folder")
    return folder
