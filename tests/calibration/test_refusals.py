"""What a calibration refuses, and in which words: one case for each kind of error."""

import numpy as np
import pytest

from fpputil.calibration import Board, PlacedBoard, Pose, calibrate, place_boards
from fpputil.calibration.stereo import calibrate_pair
from fpputil.optics.system import preset

BOARD = Board(8, 5, 25.0)
PLAIN = np.full((60, 80), 90.0)
NAN = np.full((60, 80), np.nan)
PICTURE = np.zeros((30, 40), np.uint8)
BLANK = (Pose(PLAIN, PLAIN, PLAIN),)


def placed(picture=PICTURE, width=200.0, R=None, t=(0, 0, 650.0)):
    return PlacedBoard(picture, width, np.eye(3) if R is None else R, np.array(t))


def place(number=1, seed=0, size=(300, 225)):
    return place_boards(number, seed, preset("tiny").system, size)


def solve(poses=BLANK, projector=(912, 1140), z_min=480.0, z_max=820.0):
    return calibrate(BOARD, poses, projector, z_min, z_max)


BOARDS = [
    (lambda: Board(2, 5, 25.0), "columns 2 given"),
    (lambda: Board(8, 4.5, 25.0), "rows 4.5 given"),
    (lambda: Board(8, 5, np.nan), "square nan given"),
    (lambda: Board(8, 5, 25.0, "dots"), "board 'dots' given; the kinds are"),
    (lambda: Board(40, 30, 25.0, "charuco"), "needs 635 markers"),
    (lambda: BOARD.picture(3), "scale 3 given"),
]
PLACES = [
    (lambda: placed(np.zeros((3, 3))), "dtype float64"),
    (lambda: placed(np.zeros((3, 3, 3), np.uint8)), r"shape \(3, 3, 3\)"),
    (lambda: placed(width=0), "width 0 given"),
    (lambda: placed(R=2 * np.eye(3)), "orthonormal"),
    (lambda: placed(t=(0, 0, np.nan)), "finite"),
    (lambda: place(number=0), "number 0 given"),
    (lambda: place(seed=-1), "seed -1 given"),
    (lambda: place(size=(0, 100)), "width 0 given"),
    (lambda: place(size=(900, 700)), "900 x 700 mm given; in"),
]
CALIBRATIONS = [
    (lambda: solve(poses=[]), "no poses given"),
    (lambda: solve(z_max=np.inf), "z_max inf given"),
    (lambda: solve(z_max="far"), "z_max 'far' given"),
    (lambda: solve(z_min=900.0), "900.0 to 820.0 mm given"),
    (lambda: solve(projector=912), "projector 912 given"),
    (lambda: solve(projector=(912, 0)), "projector height 0 given"),
    (lambda: solve(), r"0 of 1 poses can be used; .* \(pose 0: no chessboard of 8 x 5"),
    (lambda: calibrate_pair([], (640, 480), (912, 1140), lens=3), "3 distortion coefficients"),
    (lambda: Pose(PLAIN, PLAIN, PLAIN[:-1]), r"one \(H, W\)"),
    (lambda: Pose(PLAIN, NAN, PLAIN, "shot 0"), "shot 0 with a column map of NaN alone"),
]


@pytest.mark.parametrize("call, words", [*BOARDS, *PLACES, *CALIBRATIONS])
def test_refused(call, words):
    with pytest.raises(ValueError, match=words):
        call()
