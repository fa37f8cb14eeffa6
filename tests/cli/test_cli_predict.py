"""`fpp predict`, as a user types it: what it writes and warns of, and what it leaves behind."""

import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from fpputil.cli import main, predict
from fpputil.optics.fringes import Fringe

DATA = Path(__file__).parents[2] / "data"
WEIGHTS = str(DATA / "weights/sfnet-tiny.safetensors")
NAMES = [".fpputil.json", "points.ply", "predicted.npz", "predicted.png"]


pytestmark = pytest.mark.usefixtures("quick")


@pytest.fixture(scope="module")
def frames(sphere_view):
    shots = [sphere_view.frames(Fringe(p, 15), steps=[0])[0] for p in (24, 114)]
    return dict(zip(("high", "low"), shots, strict=True))


@pytest.fixture
def shot(frames, tmp_path, monkeypatch):
    """Photographs in the working directory."""
    monkeypatch.chdir(tmp_path)
    for name, frame in frames.items():
        cv2.imwrite(f"{name}.png", frame)
    return tmp_path


def call(*photographs, out="out", more=(), system="tiny"):
    options = ["--weights", WEIGHTS, "--system", system, "--out", out, "--precision", "float32"]
    return main(["predict", *photographs, *options, *more])


def left(folder):
    return sorted(p.name for p in folder.iterdir() if p.suffix != ".png")


def test_depth_points_and_numbers(shot, frames, sphere_view, tiny, capsys):
    assert call("high.png", "low.png", more=["--json"]) == 0
    said = capsys.readouterr()
    about = json.loads(said.out)
    (warning,) = about["warnings"]
    assert "is longer than a period of pitch 114" in warning and said.err == f"warning: {warning}\n"
    assert about["out"] == "out"
    assert sorted(p.name for p in (shot / "out").iterdir()) == NAMES and left(shot) == ["out"]
    with np.load("out/predicted.npz") as found:
        maps = {"Phi", "column", "depth", "phi_h", "phi_r", "Phi_error", "depth_error"}
        assert set(found) == maps | {"mask"}
        mask, depth = found["mask"], found["depth"]
        assert all(found[k].dtype == np.float32 for k in found if k != "mask")
        assert np.isnan(found["Phi"][~mask]).all() and about["mask"] == mask.sum()
    at = np.where(sphere_view.mask, sphere_view.depth, 650)
    counts = mask & sphere_view.mask & (tiny.system.columns_per_mm(at) > 0.1)
    assert np.median(np.abs(depth - sphere_view.depth)[counts]) < 0.3
    cloud = trimesh.load("out/points.ply")
    inside = mask & (depth >= 480) & (depth <= 820)
    assert len(cloud.vertices) == about["points"] == inside.sum()
    np.testing.assert_allclose(cloud.vertices[:, 2], depth[inside], rtol=1e-6)
    np.testing.assert_array_equal(cloud.colors[:, 0], frames["high"][inside])
    assert about["depth_mm"]["least"] == pytest.approx(580, abs=3)


def test_how_far_off_a_point_may_be_is_told_and_limited(shot, sphere_view, tiny, capsys):
    assert call("high.png", "low.png", more=["--json"]) == 0
    everything = json.loads(capsys.readouterr().out)["points"]
    with np.load("out/predicted.npz") as found:
        told, off = found["depth_error"], np.abs(found["depth"] - sphere_view.depth)
        seen = found["mask"] & sphere_view.mask
    assert np.mean((off <= told)[seen]) > 0.9 and 0.05 < np.median(told[seen]) < 5
    cloud = trimesh.load("out/points.ply", process=False)
    errors = cloud.metadata["_ply_raw"]["vertex"]["data"]["error"]
    limit = float(np.quantile(errors, 0.8))
    assert call("high.png", "low.png", out="fewer", more=["--most", str(limit), "--json"]) == 0
    fewer = json.loads(capsys.readouterr().out)["points"]
    assert fewer == (errors <= np.float32(limit)).sum() and 0.75 < fewer / everything < 0.85
    assert call("high.png", "low.png", out="none", more=["--most", "1e-6"]) != 0
    said = capsys.readouterr().err
    assert "no point is known to 1e-06 mm; the best is to" in said and not (shot / "none").exists()


def test_every_file_format_gives_the_same(shot, frames, capsys):
    high, low = frames.values()
    cv2.imwrite("high.tif", high.astype(np.uint16) * 257)
    cv2.imwrite("low.bmp", np.repeat(low[..., None], 3, axis=2))
    np.save("high.npy", high.astype(float))
    for k, pair in enumerate((("high.png", "low.png"), ("high.tif", "low.bmp"), ("high.npy",
                              "low.bmp"))):  # fmt: skip
        assert call(*pair, out=f"out{k}") == 0
    depths = [np.load(f"out{k}/predicted.npz")["depth"] for k in range(3)]
    np.testing.assert_array_equal(depths[0], depths[1])
    np.testing.assert_array_equal(depths[0], depths[2])
    said = capsys.readouterr().out
    assert "points" in said and "written to out0: predicted.npz" in said


def test_twelve_bits_and_floats_to_one_are_recognised_and_said(shot, frames, capsys):
    for name, frame in frames.items():
        levels = np.rint(frame * (4095 / 255)).astype(np.uint16)
        cv2.imwrite(f"{name}.tif", levels | 1)
        np.save(f"{name}.npy", frame / np.float32(255))
    assert call("high.png", "low.png", out="out0") == 0
    capsys.readouterr()
    known = {"tif": "12 bit in files of 16 bit", "npy": "floats from 0 to 1"}
    exact = np.load("out0/predicted.npz")["depth"]
    for suffix, said in known.items():
        assert call(f"high.{suffix}", f"low.{suffix}", out=suffix) == 0
        assert f"photographs taken for {said}" in capsys.readouterr().err
        off = np.load(f"{suffix}/predicted.npz")["depth"] - exact
        assert np.nanmedian(np.abs(off)) < 0.2 and np.isfinite(off).sum() > 0.9 * 4000
    assert call("high.tif", "low.tif", out="full", more=["--full", "4095"]) == 0
    assert "photographs taken for" not in capsys.readouterr().err


def test_swapped_photographs_are_measured_only_if_accepted(shot, capsys):
    assert call("low.png", "high.png") == 1
    said = capsys.readouterr().err
    assert "fpp: photographs swapped: pitch 114 comes before 24; --accept measures" in said
    assert left(shot) == []
    assert call("low.png", "high.png", more=["--json", "--accept"]) == 0
    said = capsys.readouterr()
    about = json.loads(said.out)
    assert about["warnings"][0] == "photographs swapped: pitch 114 comes before 24"
    assert "of the pixels with fringes have no depth of 480 to 820 mm" in about["warnings"][-1]
    assert said.err == "".join(f"warning: {w}\n" for w in about["warnings"])
    assert about["points"] < 0.5 * about["mask"]


@pytest.mark.parametrize("share", [0.2, 0.6])
def test_points_outside_the_range_are_told_and_from_half_on_an_error(
    shot, sphere_view, tiny, share, capsys
):
    z_max = float(np.nanquantile(sphere_view.depth, 1 - share))
    replace(tiny.system, z_max=z_max).save("short.json")
    assert call("high.png", "low.png", system="short.json") == (share > 0.5)
    said = capsys.readouterr().err
    told = float(re.search(r"(\d+)% of the pixels with fringes have no depth", said)[1]) / 100
    assert told == pytest.approx(share, abs=0.06)
    assert Path("out").exists() == (share < 0.5)
    assert call("high.png", "low.png", system="short.json", out="two", more=["--accept"]) == 0


@pytest.mark.parametrize(
    "photographs, options, said",
    [
        (["high.png"], {}, "1 photographs given; 2 are needed: 1. pitch 24 (high), step 0 of 15"),
        (["high.png", "none.png"], {}, "none.png given; there is no such photograph"),
        (["high.png", "cut.png"], {}, "cut.png is cut"),
        (["high.png", "text.tif"], {}, "text.tif is cut, or not an image"),
        (["high.png", "pickle.npy"], {}, "pickle.npy is cut, or not an array of numbers"),
        (["high.png", "nan.npy"], {}, "nan.npy has pixels that are NaN or infinite"),
        (["high.png", "black.png"], {}, "photograph 2 is black"),
        (["high.png", "half.png"], {}, "photographs of 160 x 120, 80 x 120 pixels given"),
        (["high.png", "low.png"], {"system": "small"}, "the system's camera has 320 x 240"),
        (["high.png", "low.png"], {"system": "huge"}, "'huge' given; the presets are"),
        (["high.png", "low.png"], {"out": "nowhere/out"}, "nowhere does not exist"),
        (["high.png", "low.png"], {"out": "high.png"}, "high.png is no folder"),
        (["high.png", "low.png"], {"more": ["--device", "tpu"]}, "device 'tpu' given"),
        (["high.png", "low.png"], {"more": ["--precision", "x"]}, "precision 'x' given"),
        (["high.png", "low.png"], {"more": ["--weights", "w.safetensors"]}, "no such file of"),
    ],
)
def test_errors_are_one_line_and_leave_nothing(photographs, options, said, shot, frames, capfd):
    Path("cut.png").write_bytes(Path("high.png").read_bytes()[:3000])
    Path("text.tif").write_text("no picture", encoding="utf-8")
    np.save("pickle.npy", np.array([{}], object), allow_pickle=True)
    np.save("nan.npy", np.where(frames["low"] > 90, np.nan, 30.0))
    cv2.imwrite("black.png", 0 * frames["low"])
    cv2.imwrite("half.png", frames["low"][:, :80])
    before = left(shot)
    assert call(*photographs, **options) == 1
    last = capfd.readouterr().err.splitlines()[-1]  # OpenCV may have its own say before
    assert last.startswith("fpp: ") and said in last
    assert left(shot) == before


def test_a_folder_is_replaced_by_force_alone(shot, capsys):
    assert call("high.png", "low.png") == 0
    before = Path("out").stat().st_ino
    assert call("high.png", "low.png") == 1
    assert "out is not empty" in capsys.readouterr().err and Path("out").stat().st_ino == before
    assert call("high.png", "low.png", more=["--force"]) == 0
    assert Path("out").stat().st_ino != before and left(shot) == ["out"]
    Path("out/diary.txt").write_text("mine", encoding="utf-8")
    assert call("high.png", "low.png", more=["--force"]) == 1
    assert "out holds diary.txt, not as `fpp predict` wrote it" in capsys.readouterr().err
    assert Path("out/diary.txt").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    "stop, code", [(KeyboardInterrupt(), 130), (OSError(28, "No space left on device"), 1)]
)
@pytest.mark.parametrize("earlier", [True, False])
def test_nothing_partial_stays(stop, code, earlier, shot, capsys, monkeypatch):
    if earlier:
        assert call("high.png", "low.png") == 0
    before = {p.name: p.read_bytes() for p in shot.glob("out/*")}

    def fails(*_):
        raise stop

    monkeypatch.setattr(predict, "_picture", fails)  # the last of three files
    assert call("high.png", "low.png", more=["--force"]) == code
    assert "nothing was written" in capsys.readouterr().err
    assert {p.name: p.read_bytes() for p in shot.glob("out/*")} == before
    assert left(shot) == (["out"] if earlier else [])


def test_the_picture_is_a_picture(sphere_view, frames):
    nothing = np.where(sphere_view.mask, sphere_view.depth, np.nan)
    found = type("Found", (), {"Phi": nothing, "depth": nothing, "points": nothing[..., None]})
    with pytest.MonkeyPatch.context() as patched:
        saved = []
        patched.setattr(Figure, "savefig", lambda self, file, **_: saved.append(self))
        predict._picture(np.stack([*frames.values()]), found)
    titles = [ax.get_title() for ax in saved[0].axes if ax.get_title()]
    assert titles[:2] == ["photograph 1", "photograph 2"] and len(titles) == 4
