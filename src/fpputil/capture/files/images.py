"""One photograph out of a file of any kind that cameras write (chapter 12)."""

from __future__ import annotations

import io
import logging
import math
import re
import struct
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import tifffile

from fpputil.checks import at_most, one_line
from fpputil.optics.fringes import WHITE

LOSSY = (".jpg", ".jpeg")
STACKS = (".tif", ".tiff", ".npy")  # of which one file may hold many photographs
SUFFIXES = (".png", ".bmp", ".pgm", ".ppm", ".pnm", *STACKS, *LOSSY)
READ = ", ".join(suffix[1:] for suffix in SUFFIXES)
CHANNELS = ("grey", "red", "green", "blue")
LUMA = np.array([4899, 9617, 1868]) / 2**14  # of red, green, blue, as OpenCV's; the sum is 1
DEPTHS = (8, 10, 12, 14, 16)  # bits that cameras have
OVERSHOOT = 1.1  # of floats above full scale, by sharpening or by a change of the lens

# What is wrong with a file is told by an error, and only once.
logging.getLogger("tifffile").addHandler(logging.NullHandler())
getattr(cv2.utils, "logging", cv2).setLogLevel(0)  # where OpenCV 4.14 has it, and 4.11


class Levels(NamedTuple):
    """Grey levels of photographs: the greatest, that of saturation, and in words how it is known.

    `said` is empty where the kind of file tells the saturation: 8 bits, or all 16.
    """

    most: float
    full: float
    said: str


def levels_of(images: Iterable[np.ndarray]) -> Levels:
    """At which grey level photographs are saturated, by the greatest level in them. Chapter 12.

    A camera of 10, 12 or 14 bits writes files of 16, with its bits low or high in them; floats
    reach to 1, or to as many levels as integers do.

    Examples
    --------
    >>> image = np.array([[0, 17, 3800]], np.uint16)
    >>> levels_of([image]).full, levels_of([16 * image]).full, levels_of([image / 4095]).full
    (4095.0, 65520.0, 1.0)
    """
    most, bits = 0.0, 0
    for image in images:
        if image.dtype == np.uint8:
            return Levels(WHITE, WHITE, "")
        most = max(most, float(image.max()))
        if image.dtype == np.uint16:
            bits |= int(np.bitwise_or.reduce(image, axis=None))
            if bits & 1 and most >= 1 << 14:
                return Levels(most, 65535.0, "")
    if most <= 0:  # black tells nothing
        return Levels(most, WHITE, "")
    if bits == 0:
        return _of_floats(most)
    low, depth = (bits & -bits).bit_length() - 1, next(d for d in DEPTHS if most < 1 << d)
    if depth < 16:
        return Levels(most, 2.0**depth - 1, f"{depth} bit in files of 16 bit")
    high = next((d for d in DEPTHS if d >= 16 - low), 16)  # bits of which the lowest are zero
    said = f"{high} bit, high in files of 16 bit" if high < 16 else ""
    return Levels(most, 65536.0 - 2 ** (16 - high), said)


def _of_floats(most: float) -> Levels:
    if most <= 1.5:  # of 255 levels it would be black
        return Levels(most, 1.0, "floats from 0 to 1")
    depth = next((d for d in DEPTHS if most < OVERSHOOT * 2**d), 16)
    return Levels(most, 2.0**depth - 1, f"floats of {depth} bit" if depth > 8 else "")


def pages_of(path: Path) -> int:
    """Number of photographs in a file, by its head; 1 if it holds no stack."""
    if path.suffix.lower() not in STACKS:
        return 1
    try:
        if path.suffix.lower() == ".npy":
            array = np.lib.format.open_memmap(path, mode="r")
            return len(array) if _is_stack(array) else 1
        with tifffile.TiffFile(path) as file:  # a smaller page is a preview
            return sum(page.shape == file.pages[0].shape for page in file.pages)
    except Exception:  # reading it will say what is wrong
        return 1


def read_pixels(path: Path, page: int | None = None) -> np.ndarray:
    """A photograph of a file as (H, W), or (H, W, 3) with red first, checked.

    Without a page it is the only one.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is cut, empty, of another kind, without such a page, or holds NaN.
    """
    if not path.is_file():
        raise FileNotFoundError(f"{path} given; there is no such photograph")
    is_array = of_kind(path) == ".npy"
    if page is None and (number := pages_of(path)) != 1:
        raise ValueError(f"{path} given; it holds {number} photographs, and one is needed")
    page = page or 0
    try:
        image = _array(path, page) if is_array else _image(path, page)
    except Exception as error:  # NumPy reads the head as Python text, and any error of it may come
        kind = "an array of numbers" if is_array else "an image"
        raise ValueError(f"{path} is cut, or not {kind} ({one_line(error)})") from error
    if image.dtype.kind == "f":
        with np.errstate(over="ignore"):  # what is too large becomes infinite, and is refused
            image = image.astype(np.float32, copy=False)
    elif image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"{path} has dtype {image.dtype}; uint8, uint16 or floats are read")
    if not image.size or image.shape[2:] not in ((), (1,), (3,), (4,)) or image.ndim == 1:
        raise ValueError(
            f"{path} has shape {image.shape}; a photograph is (H, W), or has colours, and a stack "
            "is (N, H, W)"
        )
    if image.ndim == 3:  # OpenCV puts red last but for the transparency, which goes
        channels = [0, 1, 2] if is_array else [2, 1, 0]
        image = image[..., 0 if image.shape[2] == 1 else channels]
    if not np.isfinite(image).all():
        raise ValueError(f"{path} has pixels that are NaN or infinite; photograph again")
    return np.ascontiguousarray(image)


def of_kind(path: Path) -> str:
    """Suffix of a photograph; ValueError if no such file is read."""
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{path} given; {READ} files are read")
    return path.suffix.lower()


def grey(image: np.ndarray, channel: str = "grey") -> np.ndarray:
    """(H, W) of a photograph, in which colours become float32, not rounded to whole levels.

    >>> grey(np.array([[(200, 0, 0)]], np.uint8)).round(3), grey(np.ones((2, 2, 3)), "red").shape
    (array([[59.802]], dtype=float32), (2, 2))
    """
    if image.ndim == 2:
        return image
    if channel == "grey":  # exactly, so that white stays white
        exact = LUMA.astype(np.float32) if image.dtype == np.uint8 else LUMA
        return (image @ exact).astype(np.float32, copy=False)
    return np.ascontiguousarray(image[..., CHANNELS.index(channel) - 1])


def _is_stack(array) -> bool:
    return array.ndim == 4 or (array.ndim == 3 and array.shape[2] not in (1, 3, 4))


def _array(path: Path, page: int) -> np.ndarray:
    """A .npy file; one whose head promises more than there is cannot be mapped."""
    array = np.lib.format.open_memmap(path, mode="r")
    if _is_stack(array):
        array = array[page]
    elif page:
        raise ValueError(f"photograph {page + 1} of an array of one")
    at_most("pixels", math.prod(array.shape[:2]), "FPP_MOST_PIXELS")
    return np.array(array, array.dtype.newbyteorder("="))


def _image(path: Path, page: int) -> np.ndarray:
    """Of any other file, with its colours as OpenCV orders them."""
    stacked = _of_stack(path, page) if path.suffix.lower() in STACKS else None
    if stacked is not None:
        return stacked
    data = path.read_bytes()  # for OpenCV cannot open a file whose name is not UTF-8
    at_most("pixels", _promised(data, page), "FPP_MOST_PIXELS")
    buffer = np.frombuffer(data, np.uint8)
    if page:
        _, pages = cv2.imdecodemulti(buffer, cv2.IMREAD_UNCHANGED, range=(page, page + 1))
        image = pages[0] if pages else None
    else:
        image = cv2.imdecode(buffer, cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ValueError("OpenCV does not read it")
    return image


def _of_stack(path: Path, page: int) -> np.ndarray | None:
    """A page of many in a TIFF file, without reading the others; None of one that is packed."""
    with tifffile.TiffFile(path) as file:
        head = file.pages[page]
        if len(file.pages) == 1 or head.compression != tifffile.COMPRESSION.NONE:
            return None
        at_most("pixels", head.imagewidth * head.imagelength, "FPP_MOST_PIXELS")
        image = head.asarray()
    return image[..., [2, 1, 0]] if image.ndim == 3 and image.shape[2] > 2 else image


def _promised(data: bytes, page: int) -> int:
    """Number of pixels by the head of an image."""
    if data.startswith(b"\x89PNG"):
        _check_chunks(data)
        width, height = struct.unpack_from(">II", data, 16)
    elif data.startswith(b"BM"):
        width, height = struct.unpack_from("<HH" if data[14] == 12 else "<ii", data, 18)
    elif data.startswith(b"\xff\xd8"):
        width, height = _size_of_jpeg(data)
    elif head := re.match(rb"P[2356](?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)\s", data):
        width, height = map(int, head.groups())
    else:
        with tifffile.TiffFile(io.BytesIO(data)) as file:
            width, height = file.pages[page].imagewidth, file.pages[page].imagelength
    return abs(width * height)


def _size_of_jpeg(data: bytes) -> tuple[int, int]:
    """Width and height; ValueError if the end is not there, for OpenCV would fill in grey."""
    at, size = 2, None
    while (marker := data[at + 1]) != 0xDA:  # the picture itself
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, at + 5)
            size = width, height
        at += 2 + struct.unpack_from(">H", data, at + 2)[0]
    if size is None or b"\xff\xd9" not in data[at:]:
        raise ValueError("its end is missing")
    return size


def _check_chunks(data: bytes) -> None:
    """ValueError unless the chunks of a PNG are whole: OpenCV takes memory for all they promise."""
    at, kind, view = 8, b"", memoryview(data)
    while kind != b"IEND":
        length, kind = struct.unpack_from(">I4s", data, at)
        end = at + 8 + length
        if zlib.crc32(view[at + 4 : end]) != struct.unpack_from(">I", data, end)[0]:
            raise ValueError(f"the CRC at {end} is wrong")
        at = end + 4
