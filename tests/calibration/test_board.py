"""Boards found in photographs whose points are known exactly."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fpputil.calibration.board import Board, spacing
from fpputil.calibration.board_corners import refine

KINDS = ("chessboard", "charuco", "circles")
TILTED = Rotation.from_euler("xyz", (25, -28, 12), degrees=True).as_matrix()


@pytest.fixture(scope="module")
def posed(paper, photograph):
    """Each board tilted, its photograph and its points' true pixels."""

    def shoot(kind, R=TILTED, square=25.0):
        board, t = Board(8, 5, square, kind), np.array([15.0, -8.0, 640.0])
        pose = photograph(board, paper.system, R, t)
        points = (board.points - board.points.mean(axis=0)) @ R.T + t
        return board, pose.plain, paper.system.camera.project(points)

    shots = {kind: shoot(kind) for kind in KINDS}
    R = Rotation.from_euler("xyz", (10, -8, 12), degrees=True).as_matrix()
    return shots | {"small": shoot("chessboard", R, 4.0)}


@pytest.mark.parametrize("kind", KINDS)
def test_points_are_found_to_a_fiftieth_of_a_pixel(posed, kind):
    board, photo, truth = posed[kind]
    which, pixels = board.find(photo)
    assert len(which) == 40
    turned = np.abs(pixels[0] - truth[which[0]]).max() > 10  # symmetric boards may be turned
    off = pixels - (truth[::-1] if turned else truth)[which]
    assert not (turned and kind == "charuco")
    assert np.sqrt(np.mean(off**2)) < 0.02 and np.abs(off.mean(axis=0)).max() < 0.01


def test_most_corners_of_squares_of_six_pixels_are_found(posed):
    board, photo, truth = posed["small"]
    which, pixels = board.find(photo)
    assert 6 < spacing(truth) < 7 and len(which) > 25
    off = min((pixels - order[which] for order in (truth, truth[::-1])), key=np.ptp)
    assert np.sqrt(np.mean(off**2)) < 0.02


@pytest.mark.parametrize("kind", KINDS)
def test_brightness_and_type_do_not_matter(posed, kind):
    board, photo, _ = posed[kind]
    dim = photo.astype(np.float64) * (40 / 255)
    which, pixels = board.find(photo)
    again, same = board.find(dim)
    np.testing.assert_array_equal(which, again)
    np.testing.assert_allclose(same, pixels, atol=0.01)


def test_half_a_charuco_is_enough(posed):
    board, photo, truth = posed["charuco"]
    photo = photo.copy()
    photo[:, : int(truth[3, 0])] = 128
    which, pixels = board.find(photo)
    assert 12 <= len(which) < 36
    np.testing.assert_allclose(pixels, truth[which], atol=0.1)


def test_middles_of_circles_are_not_middles_of_ellipses(posed):
    """Seen aslant, the middle of the ellipse lies off the circle's; the correction counts."""
    from fpputil.calibration.board import _ellipse_shift

    board, _, truth = posed["circles"]
    H = cv2.findHomography(board.points[:, :2], truth)[0]
    turns = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    rims = board.points[:, None, :2] + 6.25 * np.stack([np.cos(turns), np.sin(turns)], -1)
    rims = [cv2.perspectiveTransform(rim[None], H)[0] for rim in rims]
    areas = np.array([cv2.contourArea(rim.astype(np.float32)) for rim in rims])
    shift = _ellipse_shift(board, truth, areas)
    moments = [cv2.moments(rim.astype(np.float32)) for rim in rims]
    middles = np.array([(m["m10"] / m["m00"], m["m01"] / m["m00"]) for m in moments])
    np.testing.assert_allclose(shift, middles - truth, atol=0.05 * np.abs(shift).max())
    assert 0.02 < np.hypot(*shift.T).max() < 0.2


@pytest.mark.parametrize("kind", KINDS)
def test_a_picture_has_a_white_margin(kind):
    picture = Board(4, 3, 10.0, kind).picture(20)
    assert picture.shape == (6 * 20, 7 * 20) and picture.dtype == np.uint8
    assert (picture[:20] == 255).all() and (picture[:, -20:] == 255).all()
    assert 0.1 < np.mean(picture[20:-20, 20:-20] < 128) < 0.75


def test_points_go_row_by_row():
    board = Board(4, 3, 10.0)
    np.testing.assert_array_equal(board.points[[0, 1, 4]], [(0, 0, 0), (10, 0, 0), (0, 10, 0)])
    assert board.size == (50.0, 40.0) and spacing(board.points[:, :2]) == 10


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "image, message",
    [
        (np.full((100, 120), 90, np.uint8), "no .* of 8 x 5 points found"),
        (np.random.default_rng(0).integers(0, 256, (64, 64), np.uint8), "no .* points found"),
        (np.random.default_rng(1).integers(0, 256, (32, 33)), "no .* points found"),
        (np.zeros((100, 120)), "black"),
        (np.full((100, 120), np.nan), "NaN"),
        (np.zeros((10, 12), np.uint8), "32 pixels or more"),
        (np.zeros((100, 120, 3), np.uint8), r"shape \(100, 120, 3\)"),
        (np.zeros((100, 120), complex), "complex128"),
    ],
)
def test_what_shows_no_board_is_refused(kind, image, message):
    with pytest.raises(ValueError, match=message):
        Board(8, 5, 25.0, kind).find(image)


def crossing(u, v, slope=0.0):
    """A corner at u, v with edges turned by 0.3, in light that rises along x."""
    y, x = (a - c for a, c in zip(np.mgrid[:41, :41], (v, u), strict=True))
    sides = [np.tanh(1.2 * (np.cos(a) * y - np.sin(a) * x)) for a in (0.3, 0.3 + 1.4)]
    return 100 * (1 + slope * x) * (1 + 0.5 * sides[0] * sides[1])


@pytest.mark.parametrize("slope", [0, 0.01])
@pytest.mark.parametrize("u, v", [(20, 20), (20.5, 19.5), (19.8, 20.3)])
@pytest.mark.parametrize("radius, atol", [(3, 0.02), (8, 0.01)])
def test_shading_does_not_draw_a_corner_aside(u, v, slope, radius, atol):
    edges = np.array([[(np.cos(a), np.sin(a)) for a in (0.2, 1.8)]])
    found = refine(crossing(u, v, slope), np.array([(u + 1, v - 0.8)]), edges, radius)
    np.testing.assert_allclose(found, [(u, v)], atol=atol)


def test_a_corner_at_the_border_is_left_out():
    edges = np.array([np.eye(2)] * 3)
    found = refine(crossing(20, 20), np.array([(3, 20), (20, 39), (20, 20)]), edges, 8)
    assert np.isnan(found[:2]).all() and np.isfinite(found[2]).all()
