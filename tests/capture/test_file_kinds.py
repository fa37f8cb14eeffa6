"""Captures in every kind of file that cameras and programs write: one sphere, one result."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import tifffile

from fpputil.capture.faults.diagnosis import of_files
from fpputil.capture.files.images import levels_of, read_pixels
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.virtual import photograph, photograph_into
from fpputil.cli import main
from fpputil.optics.fringes import fringe_set

PATTERNS = Patterns((912, 1140), fringe_set((912, 114, 24), 8))
RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def frames(sphere_view, tiny):
    """Photographs in the order of time."""
    return [frame for _, frame in photograph(sphere_view, PATTERNS, tiny.system, noise=1.0)]


@pytest.fixture(scope="module")
def columns(frames, tmp_path_factory):
    """Columns of PNG files of 8 bits."""
    folder = tmp_path_factory.mktemp("png")
    return columns_of(write(folder, frames, "png"), PATTERNS)


def write(folder, frames, suffix, patterns=PATTERNS):
    """Photographs one by one, with their pattern file."""
    named = replace(patterns, files="{axis}-{pitch}-{step:02}." + suffix)
    named.save(folder / "patterns.toml")
    for shot, frame in zip(named.shots(), frames, strict=True):
        path = folder / shot.file
        np.save(path, frame) if suffix == "npy" else cv2.imwrite(str(path), frame)
    return folder


def columns_of(folder, patterns=None):
    return measure(open_capture(folder, patterns)).coordinate


def agree(columns, others, most=0.02, least=0.98):
    """Whether most pixels are known to both, and the median difference is small, pixels."""
    both = np.isfinite(columns) & np.isfinite(others)
    assert both.sum() > least * np.isfinite(columns).sum()
    assert np.median(np.abs(columns - others)[both]) < most


def in_levels(most, dtype=np.uint16, shift=0):
    """Photographs of 8 bits as a camera of other levels writes them."""

    def change(frame):
        levels = frame * (most / 255) + RNG.uniform(-0.5, 0.5, frame.shape) * most / 255
        levels = np.rint(levels.clip(0, most)) if dtype == np.uint16 else levels.clip(0, most)
        return (levels.astype(dtype) << shift) if shift else levels.astype(dtype)

    return change


@pytest.mark.parametrize(
    "suffix, change, full, said",
    [
        ("png", in_levels(1023), 1023, "10 bit in files of 16 bit"),
        ("tif", in_levels(4095), 4095, "12 bit in files of 16 bit"),
        ("npy", in_levels(16383), 16383, "14 bit in files of 16 bit"),
        ("tif", in_levels(4095, shift=4), 65520, "12 bit, high in files of 16 bit"),
        ("png", in_levels(65535), 65535, ""),
        ("tif", in_levels(1.0, np.float32), 1, "floats from 0 to 1"),
        ("npy", in_levels(255.0, np.float64), 255, ""),
        ("npy", in_levels(4095.0, np.float32), 4095, "floats of 12 bit"),
    ],
)
def test_levels_are_recognised_and_said(tmp_path, frames, columns, suffix, change, full, said):
    folder = write(tmp_path, [change(frame) for frame in frames], suffix)
    capture = open_capture(folder)
    assert capture.full == full and capture.levels.said == said
    assert [f.code for f in of_files(capture)] == (["levels"] if said else [])
    assert all(said in f.message and not f.severe for f in of_files(capture))
    agree(columns, measure(capture).coordinate)
    assert open_capture(folder, full=full + 1).levels.said == ""  # who was told does not guess


def test_a_dim_capture_of_all_bits_is_not_taken_for_fewer():
    dim = RNG.integers(0, 20_000, (20, 20)).astype(np.uint16) | 1
    assert levels_of([dim // 2**14, dim]).full == 65535
    assert levels_of([np.zeros((3, 3), np.uint16)]) == (0, 255, "")
    sharpened = np.array([[-3.0, 262.0]])
    assert levels_of([sharpened]) == (262, 255, "") and levels_of([4 * sharpened]).full == 1023


STACKS = {
    "tif": lambda path, frames: tifffile.imwrite(path, np.stack(frames), photometric="minisblack"),
    "npy": lambda path, frames: np.save(path, np.stack(frames)),
    "TIF": lambda path, frames: tifffile.imwrite(
        path, [cv2.merge([f] * 3) for f in frames], photometric="rgb", compression="zlib"
    ),
    "tiff": lambda path, frames: path.write_bytes(cv2.imencodemulti(".tiff", frames)[1].tobytes()),
}


@pytest.mark.parametrize("files", ["*.{}", "all.{}"])
@pytest.mark.parametrize("suffix", STACKS)
def test_a_stack_holds_all_photographs(tmp_path, frames, columns, suffix, files):
    STACKS[suffix](tmp_path / f"all.{suffix}", frames)
    patterns = replace(PATTERNS, files=files.format(suffix))
    np.testing.assert_array_equal(columns_of(tmp_path, patterns), columns)


@pytest.mark.parametrize("compression", [None, "zlib"])
def test_colours_of_a_stack_are_not_exchanged(tmp_path, compression):
    red = np.zeros((2, 9, 8, 3), np.uint8)
    red[1, ..., 0] = 200
    tifffile.imwrite(tmp_path / "a.tif", red, photometric="rgb", compression=compression)
    assert read_pixels(tmp_path / "a.tif", 1)[0, 0].tolist() == [200, 0, 0]
    (tmp_path / "a.tif").write_bytes((tmp_path / "a.tif").read_bytes()[:-50])
    with pytest.raises(ValueError, match="is cut"):
        read_pixels(tmp_path / "a.tif", 1)


def test_a_stack_for_each_pitch_and_the_plain_ones_first(tmp_path, frames, columns):
    parts = [frames[:8], frames[8:16], frames[16:]]
    for name, part in zip("abc", parts, strict=True):
        np.save(tmp_path / f"{name}.npy", np.stack(part))
    split = replace(PATTERNS, files=("a.npy", "b.npy", "c.npy"))
    np.testing.assert_array_equal(columns_of(tmp_path, split), columns)
    white = np.full_like(frames[0], 255)
    np.save(tmp_path / "all.npy", np.stack([white, 0 * white, *frames]))
    whole = replace(PATTERNS, files="all.npy", white="all.npy", black="all.npy")
    assert (open_capture(tmp_path, whole).colours() == 255).all()
    np.testing.assert_array_equal(columns_of(tmp_path, whole), columns)


@pytest.mark.parametrize("number", [23, 25])
def test_a_stack_of_another_number_is_named(tmp_path, frames, number):
    np.save(tmp_path / "all.npy", np.stack((frames * 2)[:number]))
    with pytest.raises(ValueError, match=f"holds {number} photographs; the patterns need 24"):
        open_capture(tmp_path, replace(PATTERNS, files="all.npy"))
    with pytest.raises(ValueError, match=f"{number} files match"):
        open_capture(tmp_path, replace(PATTERNS, files="*.npy"))


def test_a_stack_is_rendered_where_the_patterns_name_one(tmp_path, sphere_view, tiny, columns):
    photograph_into(
        tmp_path / "n", sphere_view, replace(PATTERNS, files="a.tif"), tiny.system, noise=1
    )
    assert sorted(p.name for p in (tmp_path / "n").iterdir()) == ["a.tif", "patterns.toml"]
    np.testing.assert_array_equal(columns_of(tmp_path / "n"), columns)


def test_a_preview_beside_the_photograph_is_no_page(tmp_path):
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        file.write(np.full((12, 16), 9, np.uint8))
        file.write(np.zeros((3, 4), np.uint8))
    assert (read_pixels(tmp_path / "a.tif") == 9).all()


@pytest.mark.parametrize("suffix", ["pgm", "pnm"])
def test_grey_maps_are_read(tmp_path, frames, columns, suffix):
    write(tmp_path, [cv2.merge([f] * 3) if suffix == "ppm" else f for f in frames], suffix)
    np.testing.assert_array_equal(columns_of(tmp_path), columns)


def test_an_ascii_grey_map_of_12_bits_is_read(tmp_path):
    (tmp_path / "a.pgm").write_bytes(b"P2\n# camera\n3 1\n4095\n0 50 4000\n")
    assert read_pixels(tmp_path / "a.pgm").tolist() == [[0, 50, 4000]]
    (tmp_path / "a.pgm").write_bytes(b"P5 20000 20000 255 ")
    with pytest.raises(ValueError, match="pixels 400000000 given; more than"):
        read_pixels(tmp_path / "a.pgm")


@pytest.mark.parametrize("steps, gain, most", [(12, 1.0, 0.02), (3, 0.25, 0.05)])
def test_jpeg_costs_noise_and_hardly_turns_the_phase(
    tmp_path, paper_sphere_view, paper, steps, gain, most
):
    patterns = Patterns((912, 1140), fringe_set((912, 114, 18), steps), files="{number:02}.png")
    photograph_into(tmp_path, paper_sphere_view, patterns, paper.system, gain=gain)
    exact = measure(open_capture(tmp_path))
    for shot in patterns.shots():
        frame = cv2.imread(str(tmp_path / shot.file), cv2.IMREAD_UNCHANGED)
        jpeg = cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, 90])[1]
        (tmp_path / shot.file).with_suffix(".jpg").write_bytes(jpeg.tobytes())
    capture = open_capture(tmp_path, replace(patterns, files="*.jpg"))
    (finding,) = of_files(capture)
    assert (finding.code, finding.severe) == ("jpeg", False)
    assert finding.message.startswith(f"{3 * steps} photographs are JPEG files")
    lossy = measure(capture)
    off = (lossy.Phi - exact.Phi)[lossy.mask & exact.mask]
    assert 0.001 < np.sqrt(np.mean(off**2)) < most and abs(np.mean(off)) < 0.002


def in_colour(frame, levels):
    """A photograph as a colour camera would see it, blue first as OpenCV writes it."""
    colours = [np.rint(frame * level).astype(np.uint8) for level in levels]
    return np.stack(colours[::-1], axis=-1)


def test_one_channel_of_a_colour_camera_sees_red_light(tmp_path, frames, columns):
    red = [in_colour(frame, (1.0, 0.05, 0.02)) for frame in frames]
    write(tmp_path, red, "png")
    (finding,) = of_files(open_capture(tmp_path))
    assert finding.message == "the light is red: grey keeps 33% of that channel's level"
    assert finding.remedy == "give --channel red"
    capture = open_capture(tmp_path, channel="red")
    assert list(of_files(capture)) == [] and capture.frames(0).dtype == np.uint8
    np.testing.assert_array_equal(measure(capture).coordinate, columns)
    assert main(["decode", str(tmp_path), "--channel", "red", "--no-report"]) == 0
    with pytest.raises(ValueError, match="channel 'infrared' given; one of grey, red, green, blue"):
        open_capture(tmp_path, channel="infrared")


def test_grey_of_colours_is_not_rounded(tmp_path, frames):
    dim = [in_colour(frame, (0.14, 0.12, 0.09)) for frame in frames]
    write(tmp_path, dim, "png")
    grey = open_capture(tmp_path).frames(2)
    rounded = np.stack([cv2.cvtColor(f, cv2.COLOR_BGR2GRAY) for f in dim[16:]])
    assert grey.dtype == np.float32 and np.abs(grey - rounded).max() < 0.7
    exact = np.stack([np.rint(np.stack(frames[16:]) * k) for k in (0.14, 0.12, 0.09)])
    np.testing.assert_allclose(grey, np.tensordot((0.299, 0.587, 0.114), exact, 1), atol=0.01)


def test_a_saturated_channel_is_told_though_grey_is_not_saturated(tmp_path, frames):
    bright = [in_colour(frame, (1, 0.7, 0.7)) for frame in frames]
    for image in bright:
        image[..., 2] = np.minimum(image[..., 2] * 1.6, 255)
    write(tmp_path, bright, "png")
    codes = [f.code for f in of_files(open_capture(tmp_path))]
    assert codes == ["overflow"]


def test_a_bayer_mosaic_is_read_as_it_is(tmp_path, frames, columns):
    """A pixel's filter scales all its photographs alike, and the phase does not mind."""
    mosaic = np.ones(frames[0].shape)
    mosaic[::2, ::2], mosaic[1::2, 1::2] = 0.6, 0.45
    write(tmp_path, [np.rint(frame * mosaic).astype(np.uint8) for frame in frames], "png")
    agree(columns, columns_of(tmp_path), 0.1, least=0.97)  # the dark rim is lost
