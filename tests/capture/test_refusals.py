"""What is refused with real photographs, and in which words."""

import math
import struct
from zlib import crc32

import cv2
import numpy as np
import pytest
import tifffile

from fpputil.capture.faults.gamma import estimate_gamma, harmonic_ratio, linearise
from fpputil.capture.folder import decode_folder
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import NAME, Patterns
from fpputil.capture.photographs import open_capture, read_photograph
from fpputil.optics.fringes import fringe_set
from fpputil.optics.system import preset

PROJECTOR = (912, 1140)


def folder_of(path, pitches=(912, 114), unwrap="mf", axis="column"):
    """A folder of dark photographs with its pattern file."""
    patterns = Patterns(PROJECTOR, fringe_set(pitches, 3, axis=axis), unwrap)
    for shot in patterns.shots():
        cv2.imwrite(str(path / shot.file), np.zeros((120, 160), np.uint8))
    patterns.save(path / NAME)
    return path


def measured(path, *given, how=None, **patterns):
    return measure(open_capture(folder_of(path, *given, **patterns)), **(how or {}))


def without_photographs(path):
    for file in folder_of(path).glob("*.png"):
        file.unlink()
    return path


def into_a_full_folder(path):
    (path / "there").mkdir()
    (path / "there" / "diary.txt").touch()
    decode_folder(folder_of(path), path / "there")


def promised(path, head, sizes):
    """A file of nothing but a head, which promises 30,000 x 30,000 pixels."""
    path.write_bytes(head + struct.pack(sizes, *[30_000] * (len(sizes) - 1)) + bytes(64))
    read_photograph(path)


def wide(path):
    """A file of 900 megapixels that takes no room on the disk."""
    if path.suffix == ".png":
        chunks = (b"IHDR" + struct.pack(">IIBBBBB", 30_000, 30_000, 8, 0, 0, 0, 0), b"IEND")
        whole = (struct.pack(">I", len(c) - 4) + c + struct.pack(">I", crc32(c)) for c in chunks)
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(whole))
    elif path.suffix == ".tif":
        tifffile.memmap(path, shape=(30_000, 30_000), dtype=np.uint8).flush()
    else:
        np.lib.format.open_memmap(path, "w+", np.uint8, (30_000, 30_000)).flush()
    return path


HEAD = (
    b"\x93NUMPY\x01\0v\0"
    + repr({"descr": "<u2", "fortran_order": False, "shape": (10_000, 10_000)}).encode().ljust(117)
    + b"\n"
)
SMALL = {"system": preset("small").system}
REFUSALS = {
    "steps": (lambda _: estimate_gamma(np.zeros((4, 10))), "5 steps or more"),
    "pixels": (lambda _: estimate_gamma(np.zeros((8, 0))), "at least one pixel"),
    "no fringe": (lambda _: estimate_gamma(np.full((8, 10), 7.0)), "none takes it away"),
    "gamma": (lambda _: linearise(np.zeros(3), 0), "gamma 0 given"),
    "harmonic": (lambda _: harmonic_ratio(np.zeros((8, 3)), 4), "harmonic 4 of 8 steps"),
    "axis": (
        lambda path: measured(path, how={"axis": "row"}),
        "axis 'row' given; the patterns have column",
    ),
    "no system": (lambda path: measured(path, (304, 24), "minimum"), "no system given"),
    "other system": (
        lambda path: measured(path, (304, 24), "minimum", how=SMALL),
        "the photographs have 160 x 120",
    ),
    "a pitch twice": (lambda path: measured(path, (912, 912)), "would be several photographs"),
    "first pitch": (lambda path: measured(path, (114, 24)), "must cover the whole projector"),
    "beats": (lambda path: measured(path, (14, 15), "mw"), "of their beats"),
    "a system of another size": (
        lambda path: decode_folder(folder_of(path), system=preset("small").system),
        "a system of 320 x 240 pixels given; the photographs have 160 x 120",
    ),
    "pixels of a PNG": (
        lambda path: read_photograph(wide(path / "a.png")),
        "a.png is cut, or not an image (pixels 900000000 given; more than 268435456 are refused",
    ),
    "a chunk of a PNG that is not there": (
        lambda path: promised(path / "a.png", b"\x89PNG\r\n\x1a\n\x7f\xff\xff\xffIHDR", ">II"),
        "a.png is cut, or not an image (unpack_from requires",
    ),
    "pixels of a BMP": (
        lambda path: promised(path / "a.bmp", b"BM" + bytes(16), "<ii"),
        "pixels 900000000 given",
    ),
    "pixels of a TIFF": (
        lambda path: read_photograph(wide(path / "a.tif")),
        "pixels 900000000 given",
    ),
    "pixels of an array": (
        lambda path: read_photograph(wide(path / "a.npy")),
        "a.npy is cut, or not an array of numbers (pixels 900000000 given",
    ),
    "an array that is not there": (
        lambda path: promised(path / "a.npy", HEAD, "<q"),
        "a.npy is cut, or not an array of numbers (mmap length is greater than file size)",
    ),
    "no folder": (lambda path: open_capture(path / "none"), "there is no such folder"),
    "no patterns": (lambda path: open_capture(path), "no patterns.toml in"),
    "no photograph": (lambda path: open_capture(without_photographs(path)), "0 of 6 photographs"),
    "noise": (lambda path: measured(path, how={"noise": -1.0}), "noise -1.0 given"),
    "threshold": (lambda path: measured(path, how={"threshold": math.nan}), "threshold nan given"),
    "results there": (into_a_full_folder, "is not empty"),
    "results over the photographs": (
        lambda path: decode_folder(folder_of(path), path, force=True),
        "lies there: name another folder",
    ),
}


@pytest.mark.parametrize("call, words", REFUSALS.values(), ids=REFUSALS)
def test_what_is_refused_is_named(tmp_path, call, words):
    with pytest.raises((ValueError, FileNotFoundError)) as error:
        call(tmp_path)
    assert words in str(error.value)
