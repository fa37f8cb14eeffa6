"""A projector whose fringes run along one axis: what is determined is right, the rest is said."""

from dataclasses import replace

import numpy as np
import pytest

from fpputil.calibration.board import Board
from fpputil.calibration.one_axis import line_at, resect
from fpputil.calibration.placement import place_boards
from fpputil.calibration.stereo import BoardView, calibrate_pair
from fpputil.calibration.zhang import Pose, calibrate
from fpputil.capture.folder import decode_folder
from fpputil.capture.patterns import Patterns
from fpputil.capture.virtual import photograph_into
from fpputil.decoding.triangulation import triangulate
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import sphere
from fpputil.optics.system import preset

BOARD, SIZE, RANGE = Board(8, 5, 33.0), (912, 1140), (480.0, 820.0)
AXES = ("column", "row")


def hung_as(hung, axis):
    """A rig whose fringes along an axis tell depth: beside the camera, or above it."""
    place = (45, 0, 150) if axis == "column" else (0, -45, 150)
    return hung(preset("small").system, place)


def depth_off(system, found, axis):
    """|depth| by which points of the range are wrong when measured along one axis, mm, largest."""
    grid = np.meshgrid((-60.0, 0, 60), (-50.0, 0, 50), (550.0, 650, 750))
    x = np.stack(grid, -1).reshape(-1, 3)
    pixels, lit = system.camera.project(x), system.projector.project(x)[:, AXES.index(axis)]
    rays = found.camera.rays(pixels)
    n = found.projector.P[AXES.index(axis)] - lit[:, None] * found.projector.P[2]
    z = -(n[:, 3] + n[:, :3] @ found.camera.centre) / np.einsum("pi,pi->p", n[:, :3], rays)
    return np.abs(z * rays[:, 2] - x[:, 2]).max()


@pytest.mark.parametrize("axis", AXES)
def test_exact_points_give_exact_depth(hung, axis):
    system, other = hung_as(hung, axis), 1 - AXES.index(axis)
    views = []
    for R, t in place_boards(6, 1, system, BOARD.size):
        x = (BOARD.points - BOARD.points.mean(axis=0)) @ R.T + t
        lit = system.projector.project(x)
        lit[:, other] = np.nan
        views.append(BoardView(BOARD.points, system.camera.project(x), lit))
    fit = calibrate_pair(views, (320, 240), SIZE, lens=0, projector_lens=0)
    known = [AXES.index(axis), 2 + AXES.index(axis)]
    K = system.projector.K
    np.testing.assert_allclose(fit.lenses[1, known], K[known[0], [known[0], 2]], rtol=1e-6)
    np.testing.assert_allclose(fit.R, system.projector.R, atol=1e-7)
    seen = [AXES.index(axis), 2]
    np.testing.assert_allclose(fit.t[seen], system.projector.t[seen], atol=1e-4)
    assert fit.lenses[1, 2 + other] == (SIZE[other] - 1) / 2  # assumed in the middle
    assert fit.t[other] == 0 == fit.sigma[f"projector {('fx', 'fy')[other]}"]
    assert fit.errors.max() < 1e-5


@pytest.mark.parametrize("axis", AXES)
def test_photographs_give_a_system_that_measures_along_the_axis(hung, photograph, axis):
    system, gone = hung_as(hung, axis), AXES[1 - AXES.index(axis)]
    poses = place_boards(6, 1, system, BOARD.size)
    shots = [photograph(BOARD, system, *p, f"shot {k}") for k, p in enumerate(poses)]
    shots = [replace(shot, **{gone: None}) for shot in shots]
    found = calibrate(BOARD, shots, SIZE, *RANGE, lens=0)
    assert found.rejected == {}
    assert found.warnings[0].startswith(f"the fringes run along the {axis}s alone: measure with")
    assert max(found.projector_errors.values()) < 0.1
    assert depth_off(system, found.system, axis) < 0.15
    assert triangulate(np.full((240, 320), 450.0), found.system).shape == (240, 320, 3)


def test_half_of_the_orders_may_be_wrong():
    rng = np.random.default_rng(1)
    y, x = np.mgrid[-6.0:7, -6.0:7].reshape(2, -1)
    right = (420 + 2.5 * x + 0.3 * y) / (1 + 0.002 * x - 0.004 * y)
    wrong = rng.random(len(x)) < 0.45
    turns = 24 * rng.integers(1, 3, len(x)) * wrong
    noisy = right + rng.normal(0, 0.05, len(x)) + turns
    assert line_at(noisy, np.stack([x, y], -1)) == pytest.approx(420, abs=0.05)


def test_points_of_one_plane_determine_no_projector():
    x, y = np.mgrid[-50.0:60:10, -50.0:60:10].reshape(2, -1)
    flat = np.stack([x, y, np.full(len(x), 650.0)], -1)
    with pytest.raises(ValueError, match="points of one plane do not determine the projector"):
        resect(flat, 400 + 2 * x, 0, SIZE)


@pytest.mark.slow
def test_the_other_axis_of_such_a_system_is_not_believed(hung, photograph, tmp_path):
    """The projector stands 20 mm lower than assumed: a capture along both axes is refused."""
    system = hung(preset("small").system, (45, 20, 150))
    poses = place_boards(6, 1, system, BOARD.size)
    shots = [photograph(BOARD, system, *p, f"shot {k}") for k, p in enumerate(poses)]
    found = calibrate(BOARD, [replace(s, row=None) for s in shots], SIZE, *RANGE, lens=0).system
    fringes = (*fringe_set((912, 114, 24), 4), *fringe_set((1140, 114, 24), 4, axis="row"))
    view = raycast(sphere(90, (0, 0, 660)), system)
    photograph_into(tmp_path / "both", view, Patterns(SIZE, fringes), system, 9, noise=1)
    photograph_into(tmp_path / "one", view, Patterns(SIZE, fringes[:3]), system, 9, noise=1)
    result = decode_folder(tmp_path / "both", None, found, report=False, pictures=False)
    assert result.points is None and [f.code for f in result.findings if f.severe] == ["apart"]
    result = decode_folder(tmp_path / "one", None, found, report=False, pictures=False)
    assert np.nanmedian(np.abs(result.points[..., 2] - view.depth)) < 0.3


PLAIN = np.full((60, 80), 90.0)
REFUSED = {
    "no axis": (lambda: Pose(PLAIN, None, None, "shot 0"), "shot 0 without columns and rows given"),
    "poses of different axes": (
        lambda: calibrate(
            BOARD, [Pose(PLAIN, PLAIN, PLAIN, "a"), Pose(PLAIN, PLAIN, None, "b")], SIZE, *RANGE
        ),
        "all need the same axes",
    ),
    "a lens": (
        lambda: calibrate_pair(
            [BoardView(BOARD.points, BOARD.points[:, :2], np.full((40, 2), (1.0, np.nan)))],
            (320, 240),
            SIZE,
            projector_lens=2,
        ),
        "2 distortion coefficients of the projector given; fringes along one axis determine none",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_is_refused(what):
    call, said = REFUSED[what]
    with pytest.raises(ValueError, match=said):
        call()
