"""A wall that waves, seen by the system "small", and captures of it."""

import functools

import cv2
import numpy as np
import pytest

from fpputil.capture.faults.diagnosis import diagnose
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import NAME
from fpputil.capture.photographs import open_capture
from fpputil.capture.virtual import photograph
from fpputil.decoding.unwrap import TWO_PI
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import preset
from fpputil.optics.view import View


@pytest.fixture(scope="session")
def wall():
    """A smooth height map before the system "small", lit by columns 60 to 850."""
    system = preset("small").system
    v, u = np.mgrid[0:240, 0:320].astype(float)
    depth = 660 + 15 * np.sin(u / 45) * np.cos(v / 60)
    points = system.camera.rays(np.stack([u, v], -1).reshape(-1, 2)) * depth.reshape(-1, 1)
    column, row = system.projector.project(points).T.reshape(2, 240, 320)
    inside = (column > 60) & (column < 850) & (row > 0) & (row < 1139)
    shade = np.where(inside, 0.75 + 0.15 * np.sin(u / 80), 0)
    hidden = [np.where(inside, a, np.nan) for a in (column, row, depth)]
    column, row, depth = (a.astype("f4") for a in hidden)
    return View(column, row, shade.astype("f4"), depth, inside)


@pytest.fixture(scope="session")
def photographs():
    """Function from a view, patterns, a response and a camera to frames by name, not to be changed.

    The last are kept: many tests begin with the same.
    """

    def taken(view, patterns, response, light, **camera):
        shots = photograph(view, patterns, preset("small").system, 0, response, **camera)
        return {shot.file: frame for shot, frame in shots}

    kept = functools.lru_cache(8)(taken)

    def of(view, patterns, response=1.0, **camera):
        take = kept if isinstance(response, float) else taken
        light = Fringe._buffer  # which some tests replace
        return dict(take(view, patterns, response, light, **camera))

    return of


@pytest.fixture
def taken(tmp_path, wall, photographs):
    """Function from patterns, a change of their photographs and a camera to a `Capture`."""

    def capture(patterns, change=lambda frames: frames, response=1.0, view=wall, **camera):
        frames = photographs(view, patterns, response, **{"noise": 1.0, "ambient": 10.0, **camera})
        for name, frame in change(frames).items():
            cv2.imwrite(str(tmp_path / name), frame)
        patterns.save(tmp_path / NAME)
        return open_capture(tmp_path, patterns)

    return capture


@pytest.fixture
def judged(taken):
    """Function with the arguments of `taken` to the measurement and its findings by code."""

    def judge(patterns, *change, gamma_back=None, **camera):
        capture = taken(patterns, *change, **camera)
        measurement = measure(capture, gamma=gamma_back)
        return measurement, {f.code: f for f in diagnose(measurement, capture)}

    return judge


@pytest.fixture
def error(wall):
    """Function from a measurement to its error, radians at the mask, and the mask's share."""

    def off(measurement):
        both = measurement.mask & wall.mask
        columns = (measurement.coordinate - wall.column)[both]
        return columns * TWO_PI / measurement.pitch, both.sum() / wall.mask.sum()

    return off
