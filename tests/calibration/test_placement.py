"""Targets and their poses against plain geometry."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fpputil.calibration.placement import PlacedBoard, place_boards
from fpputil.optics.raycasting import raycast

PICTURE = np.zeros((30, 40), np.uint8)
PICTURE[:10, :20] = 255  # bright at the upper left
FACING = np.eye(3), np.array([0.0, 0.0, 650.0])


def test_the_frame_lies_in_the_middle():
    R = Rotation.from_euler("xyz", (20, -30, 10), degrees=True).as_matrix()
    target = PlacedBoard(PICTURE, 200.0, R, np.array([10.0, -20.0, 600.0]))
    assert target.size == (200.0, 150.0)
    local = (target.mesh.vertices - target.t) @ R
    corners = [(-100, -75, 0), (100, -75, 0), (100, 75, 0), (-100, 75, 0)]
    np.testing.assert_allclose(local, corners, atol=1e-9)
    assert (target.mesh.face_normals @ R[:, 2] < 0).all()  # it faces the viewer


def test_albedo_at_the_middles_of_the_pixels_is_the_picture():
    R = Rotation.from_euler("xyz", (20, -30, 10), degrees=True).as_matrix()
    target = PlacedBoard(PICTURE, 200.0, R, np.array([10.0, -20.0, 600.0]))
    x, y = np.meshgrid((np.arange(40) - 19.5) * 5, (np.arange(30) - 14.5) * 5)
    points = np.stack([x, y, 0 * x], -1).reshape(-1, 3) @ R.T + target.t
    expected = np.where(PICTURE.ravel() == 255, 0.9, 0.08)
    np.testing.assert_allclose(target.albedo(points), expected, atol=1e-6)


def test_a_photograph_shows_the_picture_upright(tiny):
    target = PlacedBoard(PICTURE, 240.0, *FACING)
    photo = raycast(target.mesh, tiny.system, albedo=target.albedo, supersample=2).plain()
    quarters = [photo[30:55, 40:75], photo[30:55, 90:120], photo[75:100, 40:75]]
    bright, *dark = (q.mean() for q in quarters)
    assert bright > 5 * max(dark) > 0


@pytest.fixture(scope="module")
def drawn(tiny):
    return place_boards(12, 0, tiny.system, (300, 225))


def test_drawn_boards_are_seen_whole(tiny, drawn):
    system = tiny.system
    assert len(drawn) == 12
    for R, t in drawn:
        x, y = np.meshgrid(np.linspace(-150, 150, 31), np.linspace(-112.5, 112.5, 31))
        points = np.stack([x, y, 0 * x], -1).reshape(-1, 3) @ R.T + t
        assert system.camera.inside(system.camera.project(points)).all()
        assert system.projector.inside(system.projector.project(points)).all()
        assert system.z_min <= points[:, 2].min() and points[:, 2].max() <= system.z_max


def test_drawn_boards_are_tilted_every_way(drawn):
    normals = np.array([R[:, 2] for R, _ in drawn])
    tilts = np.degrees(np.arccos(normals[:, 2]))
    assert (tilts > 25).all() and (tilts < 40).all() and np.ptp(tilts) > 10
    ways = np.sort(np.arctan2(normals[:, 1], normals[:, 0]))
    assert np.diff(ways).max() < np.radians(31)
    axes = np.cross((0, 0, 1), normals)
    axes *= (np.radians(tilts) / np.linalg.norm(axes, axis=1))[:, None]
    rolls = Rotation.from_rotvec(-axes) * Rotation.from_matrix([R for R, _ in drawn])
    about = np.degrees(rolls.as_rotvec())
    np.testing.assert_allclose(about[:, :2], 0, atol=1e-9)
    assert about[:, 2].min() < -5 and about[:, 2].max() > 5 and np.abs(about[:, 2]).max() < 20


@pytest.mark.parametrize("seed", [0, 1])
def test_small_boards_go_where_none_was(tiny, seed):
    """By chance they cover 0.45 of the camera's picture and 0.31 of the projector's."""
    corners = np.array([(-60, -45, 0), (60, -45, 0), (60, 45, 0), (-60, 45, 0)])
    poses = place_boards(12, seed, tiny.system, (120, 90))
    for pinhole, least in ((tiny.system.camera, 0.7), (tiny.system.projector, 0.53)):
        picture = np.zeros((pinhole.height, pinhole.width), np.uint8)
        for R, t in poses:
            outline = pinhole.project(corners @ R.T + t)
            cv2.fillConvexPoly(picture, np.rint(outline).astype(np.int32), 1)
        assert picture.mean() > least


def test_a_seed_repeats_its_poses(tiny, drawn):
    again = place_boards(12, 0, tiny.system, (300, 225))
    for (R, t), (Q, s) in zip(drawn, again, strict=True):
        assert np.array_equal(R, Q) and np.array_equal(t, s)
