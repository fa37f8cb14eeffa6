"""Folders of photographs: every kind of file, and every way in which one can be wrong."""

import os

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fpputil.capture.files.images import read_pixels
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture, read_photograph
from fpputil.optics.fringes import Fringe

GREY = np.random.default_rng(0).integers(0, 256, (12, 16), np.uint8)
PATTERNS = Patterns((48, 32), (Fringe(48, 20),), files="{step:02}.png", white="w.png")


@pytest.fixture
def folder(tmp_path):
    for shot in PATTERNS.shots():
        cv2.imwrite(str(tmp_path / shot.file), np.full((12, 16), shot.step, np.uint8))
    PATTERNS.save(tmp_path / "patterns.toml")
    return tmp_path


KINDS = [
    (suffix, dtype)
    for suffix in ("png", "tif", "tiff", "npy", "PNG", "pgm")
    for dtype in (np.uint8, np.uint16)
]


@pytest.mark.parametrize(
    "suffix, dtype", [*KINDS, ("bmp", np.uint8), ("tif", np.float32), ("npy", np.float32)]
)
def test_every_kind_is_read_as_it_is(tmp_path, suffix, dtype):
    path, image = (
        tmp_path / f"a.{suffix}",
        (GREY * dtype(3 if dtype != np.uint8 else 1)).astype(dtype),
    )
    np.save(path, image) if suffix == "npy" else cv2.imwrite(str(path), image)
    photograph = read_photograph(path)
    assert photograph.dtype == dtype
    np.testing.assert_array_equal(photograph, image)


@pytest.mark.parametrize("dtype", [">u2", ">f4", "<f8"])
def test_an_array_in_another_order_of_bytes_is_read(tmp_path, dtype):
    np.save(tmp_path / "a.npy", (GREY * 100.0).astype(dtype))
    photograph = read_photograph(tmp_path / "a.npy")
    assert photograph.dtype == (np.uint16 if dtype == ">u2" else np.float32)
    np.testing.assert_array_equal(photograph, GREY * np.float32(100))


def test_a_name_that_is_not_utf8_is_read(tmp_path):
    path = tmp_path / os.fsdecode(b"caf\xe9.png")
    path.write_bytes(cv2.imencode(".png", GREY)[1].tobytes())
    np.testing.assert_array_equal(read_photograph(path), GREY)


@pytest.mark.parametrize("suffix", ["png", "npy"])
def test_colour_becomes_grey(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    colour = np.zeros((4, 5, 4), np.uint8)
    colour[..., 0], colour[..., 3] = 200, 255  # of RGB red; cv2 wants it last but one
    np.save(path, colour) if suffix == "npy" else cv2.imwrite(str(path), colour[..., [2, 1, 0, 3]])
    grey = read_photograph(path)
    assert grey.dtype == np.float32  # whole levels would double the noise of a dim photograph
    np.testing.assert_allclose(grey, 0.299 * 200, rtol=0.01)
    red, green = (read_photograph(path, channel) for channel in ("red", "green"))
    assert red.dtype == np.uint8 and (red == 200).all() and not green.any()


def test_what_is_wrong_with_a_file_is_named(tmp_path):
    def refused(name, said, kind=ValueError):
        with pytest.raises(kind, match=said):
            read_photograph(tmp_path / name)

    refused("none.png", "no such photograph", FileNotFoundError)
    (tmp_path / "a.gif").write_bytes(b"")
    refused("a.gif", "png, bmp, pgm, ppm, pnm, tif, tiff, npy, jpg, jpeg files are read")
    for suffix in ("png", "bmp", "tif", "npy", "pgm", "jpg"):
        path = tmp_path / f"cut.{suffix}"
        np.save(path, GREY) if suffix == "npy" else cv2.imwrite(str(path), GREY)
        path.write_bytes(path.read_bytes()[:-9])
        refused(path.name, "is cut")
        path.write_bytes(b"")
        refused(path.name, "is cut")
    for name, array, said in [
        ("nan", np.full((3, 3), np.nan), "NaN or infinite"),
        ("int", np.zeros((3, 3), np.int64), "dtype int64"),
        ("flat", np.zeros(3, np.uint8), r"shape \(3,\)"),
        ("deep", np.zeros((1, 3, 3, 7), np.uint8), r"shape \(3, 3, 7\)"),
        ("stack", np.zeros((5, 3, 7), np.uint8), "holds 5 photographs, and one is needed"),
        ("none", np.zeros((0, 3), np.uint8), r"shape \(0, 3\)"),
        ("object", np.array([[{}]], object), "is cut, or not an array of numbers"),
    ]:
        np.save(tmp_path / f"{name}.npy", array)
        refused(f"{name}.npy", said)


def test_a_folder_is_found_whole_and_read_by_steps(folder):
    capture = open_capture(folder)
    assert capture.size == (12, 16) and capture.dtype == np.uint8 and capture.full == 255
    assert (capture.colours() == 0).all() and capture.colours().shape == (12, 16, 3)
    frames = capture.frames(0)
    assert frames.dtype == np.uint8
    np.testing.assert_array_equal(frames, np.arange(20)[:, None, None] * np.ones((12, 16)))


def test_missing_and_differing_photographs_are_named(folder):
    (folder / "07.png").unlink()
    with pytest.raises(FileNotFoundError, match=r"07.png missing in .*: 20 of 21 photographs"):
        open_capture(folder)
    cv2.imwrite(str(folder / "07.png"), np.zeros((9, 9), np.uint8))
    capture = open_capture(folder)
    with pytest.raises(ValueError, match="07.png is 9 x 9 of uint8, the first photograph 16 x 12"):
        capture.frames(0)


@pytest.mark.slow
@settings(max_examples=1500, deadline=None)
@given(st.sampled_from(["png", "bmp", "tif", "npy", "pgm", "jpg"]), st.data())
def test_any_bytes_are_read_or_refused(tmp_path_factory, suffix, data):
    path = tmp_path_factory.getbasetemp() / f"fuzz.{suffix}"
    np.save(path, GREY) if suffix == "npy" else cv2.imwrite(str(path), GREY)
    content = bytearray(path.read_bytes())
    for at, value in data.draw(st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255)))):
        content[at % len(content)] = value
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    try:
        assert read_photograph(path).ndim == 2
    except ValueError as error:
        assert str(path) in str(error)


def test_a_segment_of_a_jpeg_that_tells_no_size_is_passed_over(tmp_path):
    """Conditions of arithmetic coding, whose marker lies among those of sizes: 61441 x 61456."""
    image = np.linspace(0, 255, 48 * 64).reshape(48, 64).astype(np.uint8)
    data = cv2.imencode(".jpg", image)[1].tobytes()
    start = data.index(b"\xff\xda")
    segment = bytes([0xFF, 0xCC, 0, 8, 0x00, 0xF0, 0x01, 0xF0, 0x10, 0x05])
    (tmp_path / "a.jpg").write_bytes(data)
    (tmp_path / "b.jpg").write_bytes(data[:start] + segment + data[start:])
    one, other = (read_pixels(tmp_path / name) for name in ("a.jpg", "b.jpg"))
    assert one.shape == (48, 64) and np.array_equal(one, other)
