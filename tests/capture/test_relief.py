"""One pitch alone, and a shape without a calibration: what is left, against what was put there."""

import json

import cv2
import numpy as np
import pytest
import trimesh

from fpputil.capture.faults.diagnosis import diagnose
from fpputil.capture.folder import board_pose, decode_folder
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.relief import largest_part, remove_ground
from fpputil.cli import main
from fpputil.optics.fringes import Fringe, fringe_set
from fpputil.optics.system import preset
from fpputil.optics.view import View

TINY = preset("tiny").system
PITCH = 20
ONE = Patterns((), (Fringe(PITCH, 3),), "spatial", files="{step}.png")
v, u = np.indices((120, 160)).astype(float)
WALL = 300 + 1.9 * u + 0.2 * v + 2e-3 * (u - 80) ** 2  # columns seen on a plane, in perspective
BUMP = 25 * np.exp(-((u - 90) ** 2 + (v - 60) ** 2) / 500)  # an object in front of it
RADIANS = 2 * np.pi / PITCH


def seen(column, mask=None):
    mask = np.ones(column.shape, bool) if mask is None else mask
    return View(np.where(mask, column, np.nan), 0 * u, mask * 0.8, 0 * u + 1, mask)


def photographed(folder, column, patterns=ONE, mask=None, seed=0):
    folder.mkdir()
    view = seen(column, mask)
    for shot in patterns.shots():
        fringe = patterns.fringes[shot.fringe]
        frame = view.frames(fringe, steps=[shot.step], noise=1.0, seed=seed + shot.step)[0]
        cv2.imwrite(str(folder / shot.file), frame)
    patterns.save(folder / "patterns.toml")
    return folder


def test_three_photographs_of_one_pitch_give_the_phase_but_for_whole_turns(tmp_path):
    mask = (u < 60) | (u > 75)  # two parts
    capture = open_capture(photographed(tmp_path / "shots", WALL + BUMP, mask=mask))
    result = measure(capture)
    findings = diagnose(result, capture)
    assert "in each of 2 connected part(s)" in findings[0].message
    assert "relative" in [f.code for f in findings] and not any(f.severe for f in findings)
    turns = (result.Phi - (WALL + BUMP) * RADIANS) / (2 * np.pi)
    for part in (u < 60, u > 75):
        off = turns[part & result.mask] - np.round(np.median(turns[part & result.mask]))
        assert np.abs(off).max() < 0.02
    assert result.mask[mask].mean() > 0.99
    wrapped = (result.wrapped[0] - (WALL + BUMP) * RADIANS)[mask] / (2 * np.pi)
    assert np.abs(wrapped - np.round(wrapped)).max() < 0.02


@pytest.mark.parametrize("unwrap", ["spatial", "mf"])
def test_the_difference_to_a_plane_is_that_of_the_object(tmp_path, unwrap):
    patterns = ONE
    if unwrap == "mf":
        patterns = Patterns((912, 1140), fringe_set((912, 114, PITCH), 4))
    shots = photographed(tmp_path / "shots", WALL + BUMP, patterns)
    known = u >= 8  # of the plane
    plane = photographed(tmp_path / "plane", WALL, patterns, mask=known, seed=9)
    decoded = decode_folder(shots, reference=plane, report=False)
    with np.load(decoded.out / "decoded.npz") as found:
        off = (found["column_difference"] - BUMP * RADIANS) / (2 * np.pi)
    if unwrap == "spatial":
        off -= np.round(np.nanmedian(off))
    assert np.isnan(off[~known]).all() and np.isfinite(off[known]).mean() > 0.98
    assert np.nanmax(np.abs(off)) < 0.03


def test_a_ground_is_that_on_which_most_pixels_lie():
    perspective = 40 + 0.3 * u - 0.1 * v + 1e-4 * u * v + 2e-6 * (u - 60) ** 3
    off = remove_ground(perspective + np.where(BUMP > 1, BUMP, 0), 3)
    assert np.abs(off - np.where(BUMP > 1, BUMP, 0)).max() < 0.01
    step = np.where(u < 72, 20.0, 0)  # on nearly half of the pixels
    assert np.abs(remove_ground(30 + 0.3 * u - 0.1 * v + step, 1) - step).max() < 1e-6
    hole = np.where((u > 20) & (u < 40), np.nan, perspective)
    assert np.isnan(remove_ground(hole, 3)[:, 21:40]).all()
    parts = largest_part(hole)
    assert np.isnan(parts[:, :40]).all() and np.isfinite(parts[:, 40:]).all()
    with pytest.raises(ValueError, match="7 pixels with a phase given"):
        remove_ground(np.where((v == 3) & (u < 7), 1, np.nan), 1)


def test_a_first_evening_ends_with_a_shape(tmp_path, capsys):
    """Photographs of one pitch; no system, no size of the projector, not even the pitch."""
    shots = photographed(tmp_path / "shots", WALL + BUMP)
    (shots / "patterns.toml").unlink()
    words = ["decode", str(shots), "--files", "*.png", "--steps", "3", "--unwrap", "spatial"]
    out = tmp_path / "out"
    assert main([*words, "--relief", "cubic", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "known but for a multiple of 2 pi" in said.err and "heights in radians" in said.out
    with np.load(out / "decoded.npz") as found:
        relief = found["column_relief"]
        assert "column_coordinate" not in found and "column_Phi" in found
    assert np.nanmax(np.abs(relief - BUMP * RADIANS)) < 0.5
    picture = cv2.imread(str(out / "column_relief.png"))
    assert picture.shape == (120, 160, 3) and np.ptp(picture) > 100
    mesh = trimesh.load(out / "column_relief.ply")
    top = mesh.vertices[mesh.vertices[:, 2].argmax()]
    assert np.hypot(top[0] - 90, -top[1] - 60) < 4 and len(mesh.faces) > 30_000
    summary = json.loads((out / "summary.json").read_text())
    assert summary["decoded"] and "points" not in summary
    assert (out / "report.html").is_file()
    assert main([*words, "--out", str(tmp_path / "bare")]) == 0
    assert "--relief cubic makes a picture and a mesh" in capsys.readouterr().out


def test_the_pattern_file_needs_no_size(tmp_path):
    ONE.save(tmp_path / "p.toml")
    assert Patterns.load(tmp_path / "p.toml") == ONE
    (tmp_path / "q.toml").write_text('unwrap = "spatial"\n[[fringes]]\npitch = 20\nsteps = 3\n')
    assert Patterns.load(tmp_path / "q.toml").projector == ()
    assert main(["patterns", str(tmp_path / "p"), "--unwrap", "spatial", "--steps", "3"]) == 0
    assert Patterns.load(tmp_path / "p" / "patterns.toml").projector == (912, 1140)


@pytest.mark.parametrize(
    "refused, said",
    [
        (lambda path: ONE.picture(ONE.shots()[0]), "a picture needs its size"),
        (lambda path: Patterns((), (Fringe(9, 3),)), "unwrap 'mf' needs its size"),
        (
            lambda path: measure(open_capture(photographed(
                path / "s", WALL, Patterns((), fringe_set((20, 30), 3), "spatial")))),
            "2 pitches along the columns given; spatial unwrapping takes one",
        ),
        (
            lambda path: decode_folder(photographed(path / "s", WALL), system=TINY),
            "unwrapped in space gives no points",
        ),
        (
            lambda path: board_pose(photographed(path / "s", WALL, Patterns(
                (), (Fringe(9, 3), Fringe(9, 3, "row")), "spatial"))),
            "a calibration needs absolute columns",
        ),
        (
            lambda path: decode_folder(photographed(path / "s", WALL), relief="sphere"),
            "relief 'sphere' given; one of plane, cubic",
        ),
        (
            lambda path: decode_folder(
                photographed(path / "s", WALL), reference=photographed(path / "r", WALL),
                patterns=Patterns((), (Fringe(PITCH, 4),), "spatial", files="{step}.png")),
            "3.png missing",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(tmp_path, refused, said):
    with pytest.raises((ValueError, FileNotFoundError)) as error:
        refused(tmp_path)
    assert said in str(error.value)


def test_a_plane_photographed_by_another_camera_is_refused(tmp_path):
    shots, plane = photographed(tmp_path / "s", WALL), photographed(tmp_path / "r", WALL)
    for file in plane.glob("*.png"):
        cv2.imwrite(str(file), cv2.imread(str(file), 0)[:100])
    with pytest.raises(ValueError, match="the camera must stay the same"):
        decode_folder(shots, reference=plane)


def test_what_is_wrong_with_the_plane_is_told_and_stops(tmp_path):
    patterns = Patterns((912, 1140), fringe_set((912, 114, PITCH), 8))
    shots = photographed(tmp_path / "shots", WALL + BUMP, patterns)
    plane = photographed(tmp_path / "plane", WALL, patterns, seed=9)
    one, other = (plane / f"column-114-{n:02}.png" for n in (1, 2))
    one.write_bytes(other.read_bytes())
    decoded = decode_folder(shots, reference=plane, report=False)
    (wrong,) = (f for f in decoded.findings if f.severe)
    assert wrong.code == "frame" and wrong.message.startswith(f"in {plane}, column-114-01.png")
    assert not decoded.summary["decoded"] and not (decoded.out / "decoded.npz").exists()
    accepted = decode_folder(shots, reference=plane, report=False, accept=True, force=True)
    assert (accepted.out / "decoded.npz").exists()
