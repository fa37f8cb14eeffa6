"""`fpp system`: what it prints against the geometry, what it writes, and its exit codes."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from fpputil.cli import main
from fpputil.cli.system import describe, draw
from fpputil.optics.pinhole import Pinhole, camera_matrix
from fpputil.optics.system import System, preset


def about(capsys, *call):
    assert main(["system", "show", *call, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("name, width", [("tiny", 160), ("small", 320), ("paper", 640)])
def test_presets_are_those_of_the_design(name, width, capsys):
    found = about(capsys, name)
    assert found["camera"]["size_px"] == [width, width * 3 // 4]
    assert found["camera"]["focal_px"] == pytest.approx([12 / 7.2 * width] * 2)
    assert found["projector"]["principal_point_px"] == [455.5, 569.5]
    pose = found["projector_from_camera"]
    assert pose["position_mm"] == pytest.approx([45, 0, 150], abs=1e-9)
    assert pose["baseline_mm"] == pytest.approx(np.hypot(45, 150))
    angles = [pose[k] for k in ("yaw_deg", "pitch_deg", "roll_deg")]
    assert angles == pytest.approx([-5, 0, 0], abs=1e-9)  # turned in: to the left
    assert found["axes_nearest"] == pytest.approx({"depth_mm": 664.35, "gap_mm": 0}, abs=0.01)
    assert found["measuring_range_mm"] == [480, 820]
    assert found["field_of_view_mm"]["480"] == pytest.approx([480 * 0.6, 480 * 0.45])
    slope = found["columns_per_mm"]
    assert slope["depth_mm"] == 650 and slope["centre"] == pytest.approx(0.22, abs=0.01)
    assert slope["top left"] == pytest.approx(0.425, abs=0.01) and slope["top right"] < 0.01
    assert 0.15 < slope["share_of_too_few"] < 0.25


def turned(R, centre, **changes):
    camera = Pinhole(160, 120, camera_matrix(266, 160, 120))
    projector = Pinhole(912, 1140, camera_matrix(1277, 912, 1140), R, -R @ np.array(centre))
    return replace(System(camera, projector, 480.0, 820.0), **changes)


@pytest.mark.parametrize(
    "axis, name, ahead",
    [(1, "yaw_deg", (1, 0)), (0, "pitch_deg", (0, -1)), (2, "roll_deg", (0, 0))],
)
def test_each_turn_has_its_name_and_sign(axis, name, ahead):
    """Seen from the camera: yaw to the right, pitch up, roll clockwise (x right, y down)."""
    from scipy.spatial.transform import Rotation

    to_camera = Rotation.from_rotvec(np.eye(3)[axis] * np.radians(10)).as_matrix()
    pose = describe(turned(to_camera.T, (50.0, 0, 0)))["projector_from_camera"]
    for key in ("yaw_deg", "pitch_deg", "roll_deg"):
        assert pose[key] == pytest.approx(10 * (key == name), abs=1e-9)
    np.testing.assert_array_equal(np.sign(np.round(to_camera[:2, 2], 9)), ahead)
    assert axis != 2 or to_camera[1, 0] > 0  # its x axis turns down: clockwise


def test_the_camera_need_not_be_the_world():
    """All but the world is as before if both are moved together."""
    from scipy.spatial.transform import Rotation

    system = preset("tiny").system
    R, t = Rotation.from_euler("xyz", (20, -30, 70), degrees=True).as_matrix(), (10.0, -70.0, 5.0)
    moved = [
        replace(p, R=p.R @ R.T, t=p.t - p.R @ R.T @ t) for p in (system.camera, system.projector)
    ]
    before, after = describe(system), describe(System(*moved, system.z_min, system.z_max))
    for key in ("projector_from_camera", "axes_nearest", "columns_per_mm", "field_of_view_mm"):
        for name, value in before[key].items():
            np.testing.assert_allclose(after[key][name], value, atol=1e-6, err_msg=name)


def test_parallel_and_skew_axes(tmp_path, capsys):
    file = tmp_path / "parallel.json"
    turned(np.eye(3), (30.0, 40.0, 0)).save(file)
    assert about(capsys, str(file))["axes_nearest"] == {"depth_mm": None, "gap_mm": 50.0}
    assert main(["system", "show", str(file)]) == 0
    assert "optical axes nearest             nowhere, parallel" in capsys.readouterr().out
    skew = preset("tiny").system.projector.R
    near = describe(turned(skew, (45.0, 12.0, 150.0)))["axes_nearest"]
    assert near == pytest.approx({"depth_mm": 664.35, "gap_mm": 12}, abs=0.01)


def test_what_is_printed_is_what_json_says(capsys):
    assert main(["system", "show", "tiny"]) == 0
    said = capsys.readouterr().out
    for line in ("camera, pixels +160 x 120", "45 right, 0 down, 150 mm forward", "-5 right",
                 "664.4 mm from the camera", "480 to 820", "288.0 x 216.0 mm",
                 r"centre +0\.2266", r"below 0\.1 +21\.2%", "distortion +none"):  # fmt: skip
        assert re.search(line, said), line


@pytest.mark.parametrize("kind", ["json", "yml", "yaml"])
def test_convert_there_and_back(kind, tmp_path, capsys):
    first, second = tmp_path / f"a.{kind}", tmp_path / "b.json"
    assert main(["system", "convert", "tiny", str(first)]) == 0
    assert main(["system", "convert", str(first), str(second)]) == 0
    assert "is in " in capsys.readouterr().out
    assert about(capsys, str(second)) == about(capsys, "tiny")


@pytest.mark.parametrize(
    "verb, file, said",
    [("convert", "there.json", "there.json given; it is there already, --force replaces it"),
     ("draw", "there.png", "there.png given; it is there already"),
     ("convert", "new.txt", "new.txt given; a system file ends in"),
     ("draw", "new.pdf", "new.pdf given; a picture ends in .png"),
     ("convert", "nowhere/a.json", "nowhere does not exist")],
)  # fmt: skip
def test_files_that_cannot_be_written(verb, file, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("there.json", "there.png"):
        (tmp_path / name).write_text("mine")
    assert main(["system", verb, "tiny", file]) == 1
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {
        "there.json": "mine",
        "there.png": "mine",
    }
    assert "already" not in said or main(["system", verb, "tiny", file, "--force"]) == 0


@pytest.mark.parametrize("name", ["huge", "nowhere.json", "cut.yml"])
def test_systems_that_are_none(name, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cut.yml").write_text("%YAML:1.0\n---\ncamera_width: 160\n")
    assert main(["system", "show", name]) == 1
    error = capsys.readouterr().err
    assert error.startswith("fpp: ") and name in error and error.count("\n") == 1


def test_the_drawing_has_both_views_in_millimetres(tmp_path):
    figure = draw(preset("tiny").system)
    top, beside = figure.axes
    assert (top.get_xlabel(), top.get_ylabel()) == ("x (right), mm", "z (forward), mm")
    assert (beside.get_xlabel(), beside.get_ylabel()) == ("z (forward), mm", "y (down), mm")
    low, high = beside.get_ylim()
    assert low > high  # down is down
    points = {tuple(np.round(line.get_data(), 6).ravel()) for line in top.lines}
    assert {(0, 0), (45, 150)} <= points  # camera and projector
    reach = max(line.get_ydata().max() for line in top.lines)
    assert reach == pytest.approx(1.1 * 820)
    file = tmp_path / "tiny.png"
    assert main(["system", "draw", "tiny", str(file)]) == 0
    assert file.read_bytes()[:4] == b"\x89PNG" and [*tmp_path.iterdir()] == [file]
