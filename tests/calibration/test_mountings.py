"""Projectors above the camera, on their heads, on their sides and in mirrors, calibrated."""

from dataclasses import replace

import numpy as np
import pytest

from fpputil.calibration.board import Board
from fpputil.calibration.placement import PlacedBoard, place_boards
from fpputil.calibration.zhang import calibrate
from fpputil.capture.faults.mounting import growth_by
from fpputil.capture.folder import board_pose, decode_folder
from fpputil.capture.patterns import Patterns
from fpputil.capture.virtual import photograph_into
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import sphere
from fpputil.optics.system import preset

BOARD = Board(8, 5, 33.0)
RANGE = (480.0, 820.0)
PLACES = {
    "left": ((-45, 0, 150), 0),
    "above": ((0, -45, 150), 0),
    "on its head": ((45, 0, 150), 180),
    "on its side": ((45, 0, 150), 90),
}


def calibrated(system, photograph, board=BOARD, turn=lambda pose: pose, **more):
    poses = place_boards(6, 1, system, board.size)
    shots = [turn(photograph(board, system, *p, f"shot {k}")) for k, p in enumerate(poses)]
    return calibrate(board, shots, (912, 1140), *RANGE, lens=0, projector_lens=0, **more)


def points_off(found, system):
    """How far the found projector sees points of the range from where it does, pixels."""
    x = np.stack(np.meshgrid((-60, 60), (-50, 50), (550, 750)), -1).reshape(-1, 3).astype(float)
    lit = system.projector.project(x)
    return np.abs(found.system.projector.project(x) - lit).max()


@pytest.mark.parametrize(
    "place",
    [
        *("above", "on its head"),
        *(pytest.param(place, marks=pytest.mark.slow) for place in ("left", "on its side")),
    ],
)
def test_any_mounting_is_calibrated_and_told_by_R(hung, photograph, place):
    system = hung(preset("small").system, *PLACES[place])
    found = calibrated(system, photograph)
    assert found.rejected == {} and not any("mirror" in w for w in found.warnings)
    np.testing.assert_allclose(found.system.projector.R, system.projector.R, atol=2e-3)
    assert np.linalg.norm(found.system.projector.centre - system.projector.centre) < 0.5
    assert points_off(found, system) < 0.3
    np.testing.assert_allclose(growth_by(found.system), growth_by(system), atol=0.02)


def test_mirrored_photographs_give_a_negative_focal_length(hung, photograph):
    system = hung(preset("small").system)

    def mirror(pose):
        return replace(pose, **{k: getattr(pose, k)[:, ::-1] for k in ("plain", "column", "row")})

    found = calibrated(system, photograph, turn=mirror)
    camera = found.system.camera
    assert "photographs are mirrored left to right" in found.warnings[0]
    assert camera.K[0, 0] == pytest.approx(-system.camera.K[0, 0], rel=1e-3)
    assert camera.K[0, 2] == pytest.approx(319 - system.camera.K[0, 2], abs=0.3)
    assert points_off(found, system) < 0.3  # of the world as it is, not of its mirror image


def test_a_board_that_can_be_read_tells_a_mirrored_projector(hung, photograph):
    """Its markers are read, so the camera does not mirror."""
    system, board = hung(preset("small").system), Board(8, 5, 33.0, "charuco")
    K = system.projector.K * ((-1, 1, 1), (1, 1, 1), (1, 1, 1))
    system = replace(system, projector=replace(system.projector, K=K))
    found = calibrated(system, photograph, board)
    assert found.warnings[0].startswith("the projector's picture is mirrored")
    assert found.system.projector.K[0, 0] == pytest.approx(K[0, 0], rel=2e-3)
    assert found.system.camera.K[0, 0] > 0 and points_off(found, system) < 0.5


def test_poses_that_could_not_be_read_are_told(photograph):
    unread = {"pose-07": "two photographs are exchanged"}
    found = calibrated(preset("small").system, photograph, unread=unread)
    assert found.rejected == unread and len(found.camera_errors) == 6
    with pytest.raises(ValueError, match="0 of 1 poses can be used; .*pose-07: two photographs"):
        calibrate(BOARD, [], None, *RANGE, unread=unread)


@pytest.mark.slow
@pytest.mark.parametrize("place", [*PLACES, "mirrored", "columns alone"])
def test_a_sphere_is_measured_by_what_the_boards_said(hung, tmp_path, place):
    """All from noisy photographs at `paper`: boards, fringes, and the sphere's depth."""
    system = hung(preset("paper").system, *PLACES.get(place, ((45, 0, 150), 0)))
    if place == "mirrored":
        K = system.camera.K * ((-1, 1, 1), (1, 1, 1), (1, 1, 1))
        system = replace(system, camera=replace(system.camera, K=K))
    fringes = (*fringe_set((912, 114, 24), 4), *fringe_set((1140, 114, 24), 4, axis="row"))
    if place == "columns alone":
        fringes = fringes[:3]
    patterns, picture, poses = Patterns((912, 1140), fringes), BOARD.picture(40), []
    for k, (R, t) in enumerate(place_boards(8, 0, system, BOARD.size)):
        board = PlacedBoard(picture, picture.shape[1] * BOARD.square / 40, R, t)
        view = raycast(board.mesh, system, albedo=board.albedo, supersample=2)
        photograph_into(tmp_path / f"pose-{k}", view, patterns, system, k, noise=1)
        poses.append(board_pose(tmp_path / f"pose-{k}")[0])
    found = calibrate(BOARD, poses, (912, 1140), *RANGE, lens=0, projector_lens=0)
    view = raycast(sphere(90, (0, 0, 660)), system)
    photograph_into(tmp_path / "shots", view, patterns, system, 9, noise=1, ambient=10)
    result = decode_folder(tmp_path / "shots", None, found.system, report=False, pictures=False)
    off = result.points[..., 2] - view.depth
    assert result.findings == () and np.isfinite(off).sum() > 0.95 * view.mask.sum()
    assert np.nanmedian(np.abs(off)) < 0.15
