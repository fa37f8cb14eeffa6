"""A viewer's pinhole against what a viewer sees."""

import cv2
import numpy as np
import pytest

from fpputil.optics.pinhole import Pinhole, camera_matrix, looking

SIZE, ANGLE = (320, 240), 30.0
EYES = {
    "ahead": ((0, 0, 0), (0, 0, 500)),
    "from the left, above": ((-400, -300, 0), (0, 20, 650)),
    "backwards, from below": ((100, 500, 900), (10, 0, 0)),
}


@pytest.mark.parametrize(("look_from", "look_at"), EYES.values(), ids=EYES)
def test_a_viewer_sees_the_target_in_the_middle_and_up_above(look_from, look_at):
    eye = looking(look_from, look_at, SIZE, ANGLE)
    assert (eye.width, eye.height) == SIZE
    np.testing.assert_allclose(eye.centre, look_from, atol=1e-9)
    np.testing.assert_allclose(eye.project(look_at), (159.5, 119.5), atol=1e-9)
    u, v = eye.project(np.array(look_at) - (0, 10, 0))
    assert u == pytest.approx(159.5) and v < 119.5


def test_what_is_to_the_right_is_seen_to_the_right():
    """Facing along z, x is to the right; facing back, it is to the left."""
    ahead, back = (looking((0, 0, 0), (0, 0, z), SIZE, ANGLE) for z in (500, -500))
    assert ahead.project((10, 0, 500))[0] > 160 and back.project((10, 0, -500))[0] < 159


def test_the_angle_is_that_from_the_upper_to_the_lower_edge():
    eye = looking((0, 0, 0), (0, 0, 1), SIZE, ANGLE)
    edge = 500 * np.tan(np.radians(ANGLE / 2))
    np.testing.assert_allclose(eye.project((0, -edge, 500)), (159.5, -0.5), atol=1e-9)
    np.testing.assert_allclose(eye.project((0, edge, 500)), (159.5, 239.5), atol=1e-9)


@pytest.mark.parametrize("number", [4, 5, 8, 12, 14])
def test_a_lens_distorts_as_with_opencv(number):
    rng = np.random.default_rng(number)
    lens = rng.normal(0, 0.02, number)
    K = camera_matrix(600, 640, 480)
    points = np.column_stack([rng.uniform(-250, 250, (200, 2)), rng.uniform(500, 700, 200)])
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, lens)[0][:, 0]
    pinhole = Pinhole(640, 480, K, distortion=lens)
    np.testing.assert_allclose(pinhole.project(points), expected, atol=1e-9)
    xy = points[:, :2] / points[:, 2:]
    np.testing.assert_allclose(pinhole.pixels(xy), expected, atol=1e-9)


def test_a_mirror_shows_the_picture_turned_from_left_to_right():
    K, lens = camera_matrix(600, 640, 480), (-0.1, 0.03, 1e-3, -5e-4)
    mirror = Pinhole(640, 480, K * ((-1, 1, 1), (1, 1, 1), (1, 1, 1)), distortion=lens)
    point = np.array([100.0, 50, 600])
    u, v = Pinhole(640, 480, K, distortion=lens).project(point)
    np.testing.assert_allclose(mirror.project(point), (639 - u, v))
    np.testing.assert_allclose(600 * mirror.rays((639 - u, v)), point, atol=1e-6)
