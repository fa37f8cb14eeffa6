"""What is refused with real photographs, and in which words."""

import math

import cv2
import numpy as np
import pytest

from fpputil.capture.folder import board_pose, decode_folder
from fpputil.capture.gamma import estimate_gamma, harmonic_ratio, linearise
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import NAME, Patterns
from fpputil.capture.photographs import open_capture
from fpputil.optics.fringes import fringe_set
from fpputil.optics.system import preset

PROJECTOR = (912, 1140)


def folder_of(path, pitches=(912, 114), unwrap="mf", axis="column"):
    """A folder of dark photographs with its pattern file."""
    patterns = Patterns(PROJECTOR, fringe_set(pitches, 3, axis=axis), unwrap)
    for shot in patterns.shots():
        cv2.imwrite(str(path / shot.file), np.zeros((120, 160), np.uint8))
    patterns.save(path / NAME)
    return path


def measured(path, *given, how=None, **patterns):
    return measure(open_capture(folder_of(path, *given, **patterns)), **(how or {}))


def without_photographs(path):
    for file in folder_of(path).glob("*.png"):
        file.unlink()
    return path


def into_a_full_folder(path):
    (path / "there").mkdir()
    (path / "there" / "diary.txt").touch()
    decode_folder(folder_of(path), path / "there")


def of_rows(path):
    result = measured(path, (1140, 114), axis="row", how={"axis": "row"})
    return result.points(preset("tiny").system)


SMALL = {"system": preset("small").system}
REFUSALS = {
    "steps": (lambda _: estimate_gamma(np.zeros((4, 10))), "5 steps or more"),
    "pixels": (lambda _: estimate_gamma(np.zeros((8, 0))), "at least one pixel"),
    "no fringe": (lambda _: estimate_gamma(np.full((8, 10), 7.0)), "none takes it away"),
    "gamma": (lambda _: linearise(np.zeros(3), 0), "gamma 0 given"),
    "harmonic": (lambda _: harmonic_ratio(np.zeros((8, 3)), 4), "harmonic 4 of 8 steps"),
    "axis": (
        lambda path: measured(path, how={"axis": "row"}),
        "axis 'row' given; the patterns have column",
    ),
    "no system": (lambda path: measured(path, (304, 24), "minimum"), "no system given"),
    "other system": (
        lambda path: measured(path, (304, 24), "minimum", how=SMALL),
        "the photographs have 160 x 120",
    ),
    "order of pitches": (lambda path: measured(path, (24, 912)), "they must descend strictly"),
    "first pitch": (lambda path: measured(path, (114, 24)), "must cover the whole projector"),
    "beats": (lambda path: measured(path, (14, 15), "mw"), "of their beats"),
    "depth of rows": (of_rows, "fringes along rows given"),
    "no folder": (lambda path: open_capture(path / "none"), "there is no such folder"),
    "no patterns": (lambda path: open_capture(path), "no patterns.toml in"),
    "no photograph": (lambda path: open_capture(without_photographs(path)), "0 of 6 photographs"),
    "one axis": (lambda path: board_pose(folder_of(path)), "a calibration needs columns and rows"),
    "noise": (lambda path: measured(path, how={"noise": -1.0}), "noise -1.0 given"),
    "threshold": (lambda path: measured(path, how={"threshold": math.nan}), "threshold nan given"),
    "results there": (into_a_full_folder, "is not empty"),
    "results over the photographs": (
        lambda path: decode_folder(folder_of(path), path, force=True),
        "lies there: name another folder",
    ),
}


@pytest.mark.parametrize("call, words", REFUSALS.values(), ids=REFUSALS)
def test_what_is_refused_is_named(tmp_path, call, words):
    with pytest.raises((ValueError, FileNotFoundError)) as error:
        call(tmp_path)
    assert words in str(error.value)
