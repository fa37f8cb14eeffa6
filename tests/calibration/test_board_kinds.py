"""Boards of other makers: circles of either grid and colour, ChArUco of any layout and markers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fpputil.calibration.board import Board, _dictionaries

R = Rotation.from_euler("xyz", (18, -20, 5), degrees=True).as_matrix()
BOARDS = {
    "circles": Board(7, 5, 25.0, "circles"),
    "asymmetric": Board(4, 7, 25.0, "asymmetric"),
    "asymmetric, as OpenCV's": Board(4, 11, 15.0, "asymmetric"),
    "charuco": Board(7, 5, 28.0, "charuco", "5x5_100", marker=0.6),
    "legacy charuco": Board(5, 5, 36.0, "charuco", "6x6_250", legacy=True, marker=2 / 3),
    "odd legacy charuco": Board(6, 4, 30.0, "charuco", "4x4_50", legacy=True),
    "april tags": Board(4, 4, 36.0, "charuco", "APRILTAG_36h11", marker=2 / 3),
}


class Negative(Board):
    """Printed white on black."""

    def picture(self, scale=40):
        return 255 - super().picture(scale)


def seen(board, photograph, system, shade=True):
    """A photograph of a board, and the true pixels of its points."""
    width, height = board.size
    t = np.array([5.0, -4.0, 650.0])
    middle = np.array([width / 2 - board.square, height / 2 - board.square, 0])
    points = (board.points - middle) @ R.T + t
    return photograph(board, system, R, t, shade=shade).plain, system.camera.project(points)


@pytest.fixture(scope="module")
def photographs(photograph, paper):
    return {name: seen(board, photograph, paper.system) for name, board in BOARDS.items()}


@pytest.mark.parametrize("name", BOARDS)
def test_points_are_found_to_a_few_hundredths_of_a_pixel(name, photographs):
    image, truth = photographs[name]
    which, pixels = BOARDS[name].find(image)
    assert len(which) > 0.9 * len(truth)
    turned = np.abs(pixels[0] - truth[which[0]]).max() > 10  # circles may be turned about
    off = pixels - (truth[::-1] if turned else truth)[which]
    assert np.sqrt(np.mean(off**2)) < 0.05, (name, turned)


@pytest.mark.parametrize("name", ["circles", "asymmetric"])
def test_white_circles_on_black_are_found(name, photograph, paper):
    board = BOARDS[name]
    negative = Negative(board.columns, board.rows, board.square, board.kind)
    image, truth = seen(negative, photograph, paper.system)
    _, pixels = board.find(image)
    off = min((pixels - order for order in (truth, truth[::-1])), key=np.ptp)
    assert np.sqrt(np.mean(off**2)) < 0.08


PROPOSALS = [
    ("circles", {"kind": "chessboard"}, "--kind circles --board 7x5"),
    ("asymmetric", {"kind": "circles"}, "--kind asymmetric --board 4x7"),
    (
        "asymmetric",
        {"kind": "chessboard", "columns": 7, "rows": 4},
        "--kind asymmetric --board 4x7",
    ),
    ("charuco", {"dictionary": "4x4_250"}, "--kind charuco --board 7x5 --dictionary 5x5_50"),
    ("legacy charuco", {"legacy": False}, "--board 5x5 --dictionary 6x6_50 --legacy"),
    ("april tags", {"dictionary": "4x4_250"}, "--dictionary apriltag_36h11"),
]


@pytest.mark.parametrize("name, wrong, said", PROPOSALS)
def test_a_board_that_would_fit_is_proposed(name, wrong, said, photographs):
    board = replace(BOARDS[name], **wrong)
    with pytest.raises(ValueError, match="points found") as error:
        board.find(photographs[name][0])
    assert said in str(error.value).split("; it looks like ")[1]


def test_a_chessboard_counted_in_squares_is_proposed(photograph, paper):
    board = Board(7, 5, 28.0)
    image, _ = seen(board, photograph, paper.system)
    with pytest.raises(ValueError, match="it looks like --kind chessboard --board 7x5"):
        replace(board, columns=8, rows=6).find(image)


def test_nothing_is_proposed_where_there_is_no_board():
    noise = np.random.default_rng(0).integers(0, 256, (200, 200), np.uint8)
    with pytest.raises(ValueError) as error:
        BOARDS["circles"].find(noise)
    assert "looks like" not in str(error.value)


@pytest.mark.parametrize(
    "change, said",
    [
        ({"dictionary": "9x9_1"}, "dictionary '9x9_1' given; OpenCV has 4x4_50, "),
        ({"dictionary": "4x4_50", "rows": 20}, "the dictionary has 50"),
        ({"marker": 1.0}, "marker 1.0 given; it is less than a square wide"),
        ({"kind": "dots"}, "chessboard, charuco, circles, asymmetric"),
    ],
)
def test_boards_that_cannot_be(change, said):
    with pytest.raises(ValueError) as error:
        replace(BOARDS["charuco"], **change)
    assert said in str(error.value)


def test_small_dictionaries_are_the_beginning_of_large_ones():
    """On which the proposal of the least one rests."""
    small, large = (_dictionaries()[name].bytesList for name in ("5x5_50", "5x5_1000"))
    np.testing.assert_array_equal(small, large[:50])
