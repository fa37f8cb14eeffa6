"""Calibration against the systems that took the photographs."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from fpputil.calibration.board import Board
from fpputil.calibration.placement import PlacedBoard, place_boards
from fpputil.calibration.stereo import BoardView, calibrate_pair
from fpputil.calibration.zhang import Pose, calibrate, light_at
from fpputil.decoding.decoder import decode
from fpputil.decoding.triangulation import column
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import System, preset

BOARD = Board(8, 5, 33.0)
PROJECTOR = (912, 1140)
RANGE = (480.0, 820.0)


def bent(system):
    """The system with two lenses: barrel in the camera, pincushion in the projector."""
    camera = replace(system.camera, distortion=(-0.12, 0.06, 8e-4, -6e-4, 0))
    projector = replace(system.projector, distortion=(0.03, -0.02, -4e-4, 5e-4, 0))
    return System(camera, projector, *RANGE)


@pytest.fixture(scope="module")
def small():
    return preset("small").system


@pytest.fixture(scope="module")
def poses(small, photograph):
    drawn = place_boards(9, 1, small, BOARD.size)
    return [photograph(BOARD, small, *pose, f"shot {k}") for k, pose in enumerate(drawn)]


@pytest.fixture(scope="module")
def sightings(paper):
    """Points of 12 boards, seen exactly by the bent system."""
    system, board = bent(paper.system), Board(11, 8, 25.0)
    centred = board.points - board.points.mean(axis=0)
    return [
        BoardView(board.points, *(p.project(centred @ R.T + t) for p in pinholes(system)))
        for R, t in place_boards(12, 0, paper.system, board.size)
    ]


def pinholes(system):
    return system.camera, system.projector


def calibrated(poses, **options):
    options = {"lens": 0, "projector_lens": 0} | options
    return calibrate(BOARD, poses, PROJECTOR, *RANGE, **options)


def truth(system):
    return [[p.K[0, 0], p.K[1, 1], *p.K[:2, 2], *p.distortion] for p in pinholes(system)]


def test_exact_points_give_the_exact_system(paper, sightings):
    system = bent(paper.system)
    fit = calibrate_pair(sightings, (640, 480), PROJECTOR)
    np.testing.assert_allclose(fit.lenses, truth(system), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(fit.R, system.projector.R, atol=1e-8)
    np.testing.assert_allclose(fit.t, system.projector.t, atol=1e-5)
    assert fit.errors.max() < 1e-5


@pytest.mark.slow
def test_standard_deviations_are_honest(paper, sightings):
    """Over six draws of noise, errors in units of their sigma have variance 1."""
    system, rng, ratios = bent(paper.system), np.random.default_rng(0), []
    for _ in range(6):
        noisy = [
            BoardView(
                s.points,
                s.camera + rng.normal(0, 0.05, s.camera.shape),
                s.projector + rng.normal(0, 0.1, s.projector.shape),
            )
            for s in sightings
        ]
        fit = calibrate_pair(noisy, (640, 480), PROJECTOR)
        off = np.delete(fit.lenses - truth(system), 8, axis=1).ravel()
        sigma = [s for name, s in fit.sigma.items() if name != "baseline" and "k3" not in name]
        span = np.linalg.norm(fit.t) - np.linalg.norm(system.projector.t)
        ratios.append([*(off / sigma), span / fit.sigma["baseline"]])
        assert fit.sigma["camera k3"] == 0  # held fixed
    assert 0.7 < np.sqrt(np.mean(np.square(ratios))) < 1.4 and np.abs(ratios).max() < 4.5


def test_photographs_give_the_system(small, poses):
    found = calibrated(poses)
    for got, true in zip(pinholes(found.system), pinholes(small), strict=True):
        np.testing.assert_allclose(np.diag(got.K), np.diag(true.K), rtol=5e-4)
        assert not got.distortion.any()
    assert abs(np.linalg.norm(found.system.projector.centre) - np.hypot(45, 150)) < 0.1
    assert (found.system.z_min, found.system.z_max) == RANGE
    assert list(found.camera_errors) == list(found.projector_errors) == [p.name for p in poses]
    assert max(found.camera_errors.values()) < 0.03 and max(found.projector_errors.values()) < 0.06
    assert found.rejected == {} and found.warnings == ()
    assert 0 < found.sigma["camera fx"] < 0.5 and 0 < found.sigma["baseline"] < 0.1


@pytest.mark.slow
def test_a_rendered_calibration_reaches_its_figures(small):
    """From rendered, noisy photographs of a ChArUco board through two bent lenses."""
    system, board = bent(small), Board(8, 5, 33.0, "charuco")
    sets = [fringe_set((w, w / 8, w / 48), 4, axis=a) for w, a in ((912, "column"), (1140, "row"))]
    picture, shots = board.picture(40), []
    for k, (R, t) in enumerate(place_boards(5, 3, small, board.size)):
        target = PlacedBoard(picture, picture.shape[1] * board.square / 40, R, t)
        view = raycast(target.mesh, system, albedo=target.albedo, supersample=2)
        frames = [view.frames(f, noise=2, seed=2 * k + n) for n, f in enumerate(sets)]
        maps = [
            column(decode(f, s, w).Phi, s[-1].pitch)
            for f, s, w in zip(frames, sets, PROJECTOR, strict=True)
        ]
        shots.append(Pose(np.mean(frames, axis=(0, 1)), *maps))
    found = calibrate(board, shots, PROJECTOR, *RANGE)
    for got, true in zip(pinholes(found.system), pinholes(system), strict=True):
        np.testing.assert_allclose(np.diag(got.K), np.diag(true.K), rtol=2e-3)
        np.testing.assert_allclose(got.distortion[0], true.distortion[0], atol=0.02)
    assert np.linalg.norm(found.system.projector.centre - system.projector.centre) < 0.5
    assert any("5 poses" in w for w in found.warnings)


def test_a_pose_that_fits_less_well_stays_if_it_fits_well_enough(poses):
    nudged = replace(poses[3], column=poses[3].column + 0.3)
    found = calibrated([*poses[:3], nudged, *poses[4:]])
    assert found.rejected == {}
    errors = found.projector_errors
    assert 0.3 > errors["shot 3"] > 3 * np.median(list(errors.values()))


def test_a_bumped_projector_leaves_with_its_reason(poses):
    """The board alone would fit: only the joint fit knows that the projector moved."""
    bumped = replace(poses[3], column=poses[3].column + 12.0)
    found = calibrated([*poses[:3], bumped, *poses[4:]])
    assert list(found.rejected) == ["shot 3"] and "projector" in found.rejected["shot 3"]
    assert "shot 3" not in found.camera_errors


def test_poses_that_show_nothing_leave_with_their_reasons(poses):
    blank = replace(poses[0], plain=np.full_like(poses[0].plain, 90), name="blank")
    dark = np.full_like(poses[0].column, np.nan)
    dark[:5, :5] = 1.0
    unlit = replace(poses[0], column=dark, name="unlit")
    found = calibrated([*poses, blank, unlit])
    assert "no chessboard of 8 x 5" in found.rejected["blank"]
    assert found.rejected["unlit"].startswith("0 of 40 points are lit")


def test_wrong_pixels_in_the_maps_do_not_matter(poses):
    rng = np.random.default_rng(0)
    thrown = [
        replace(p, column=p.column + 19 * rng.choice([-1, 0, 1], p.column.shape, p=[0.1, 0.8, 0.1]))
        for p in poses
    ]
    clean, found = calibrated(poses), calibrated(thrown)
    for a, b in zip(pinholes(found.system), pinholes(clean.system), strict=True):
        np.testing.assert_allclose(a.K, b.K, rtol=2e-4)


def test_noise_of_the_maps_is_averaged_over_a_square(poses):
    """Over the 400 pixels of one, noise of 1 becomes 0.05 each way, or with a slope 0.07."""
    rng = np.random.default_rng(0)
    noisy = [
        replace(p, **{k: getattr(p, k) + rng.normal(0, 1, p.row.shape) for k in ("column", "row")})
        for p in poses
    ]
    assert max(calibrated(noisy).projector_errors.values()) < 0.13


@pytest.mark.parametrize("tilt", [4.5, 5.5])
def test_almost_parallel_boards_are_warned_of(small, photograph, tilt):
    """Four turn about x and four about y: an RMS of the tilt over the root of two."""
    ways = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)] * 2)
    turns = Rotation.from_rotvec(np.radians(tilt) * np.sqrt(2) * np.insert(ways, 2, 0, 1))
    places = np.linspace((-30, 20, 560), (30, -20, 700), 8)
    shots = [photograph(BOARD, small, R, t) for R, t in zip(turns.as_matrix(), places, strict=True)]
    found = calibrated(shots)
    told = [w for w in found.warnings if "normals vary" in w]
    assert len(told) == (tilt < 5) and all("by 4.5 degrees" in w for w in told)


@pytest.mark.parametrize("square", [14.0, 37.0, 43.0])
def test_few_poses_that_cover_little_are_warned_of(small, photograph, square):
    board = Board(6, 4, square)
    turns = Rotation.from_euler("xyz", [(30, 0, 0), (-20, 25, 0), (0, -30, 5)], degrees=True)
    t, centred = np.array([0, 0, 560.0]), board.points - board.points.mean(axis=0)
    shots = [photograph(board, small, R, t, str(k)) for k, R in enumerate(turns.as_matrix())]
    found = calibrate(board, shots, PROJECTOR, *RANGE, lens=0, projector_lens=0)
    assert any("3 poses were used" in w for w in found.warnings)
    points = np.concatenate([small.camera.project(centred @ R.T + t) for R in turns.as_matrix()])
    cover = ConvexHull(points).volume / (320 * 240)
    told = [w for w in found.warnings if "% of the picture" in w]
    assert len(told) == (cover < 0.3) and all(f"cover {100 * cover:.0f} %" in w for w in told)


@pytest.mark.parametrize("factor", [0.4, 2.0])
def test_a_wrong_square_is_doubted(poses, factor):
    """It moves every board as many times nearer or farther, and out of the range."""
    board = replace(BOARD, square=factor * BOARD.square)
    found = calibrate(board, poses, PROJECTOR, *RANGE, lens=0, projector_lens=0)
    assert any("is the size of the board right?" in w for w in found.warnings)


@pytest.mark.parametrize("free", [{}, {"lens": 5, "projector_lens": 1}])
def test_as_much_of_the_lens_is_free_as_said(poses, free):
    """By default k1, k2, p1 and p2 of both."""
    found = calibrate(BOARD, poses, PROJECTOR, *RANGE, **free)
    for who, number in (
        ("camera", free.get("lens", 4)),
        ("projector", free.get("projector_lens", 4)),
    ):
        sigma = [found.sigma[f"{who} {name}"] for name in ("k1", "k2", "p1", "p2", "k3")]
        assert np.count_nonzero(sigma) == number and all(sigma[:number])


def test_poses_of_two_sizes_or_one_name_are_refused(poses):
    cut = Pose(*(a[:100] for a in (poses[1].plain, poses[1].column, poses[1].row)), "cut")
    with pytest.raises(ValueError, match=r"\(100, 320\), \(240, 320\)"):
        calibrated([poses[0], cut, poses[2]])
    with pytest.raises(ValueError, match="each its name"):
        calibrated([poses[0], poses[0], poses[2]])


def test_a_board_found_nowhere_is_refused(poses):
    with pytest.raises(ValueError, match="0 of 3 poses can be used; .* no charuco of 8 x 5"):
        calibrate(Board(8, 5, 33.0, "charuco"), poses[:3], PROJECTOR, *RANGE)
    with pytest.raises(ValueError, match="2 of 2 poses can be used; 3 are needed"):
        calibrated(poses[:2])


def test_one_pose_thrice_is_refused_or_doubted(poses):
    same = [replace(poses[0], name=f"copy {k}") for k in range(3)]
    try:
        found = calibrated(same)
    except ValueError as error:
        assert "tilt the board" in str(error)
    else:
        assert len(found.warnings) >= 2


def test_maps_are_read_between_pixels_whatever_the_orders():
    """Of a plane seen by two pinholes; a quarter of the orders is wrong, all to one side."""
    y, x = np.mgrid[:60, :80].astype(float)
    H = np.array([[1.5, -0.2, 3.0], [0.1, 1.2, 5.0], [1e-3, -5e-4, 1.0]])
    column, row = np.moveaxis(through(H, np.stack([x, y], -1)), -1, 0)
    rng = np.random.default_rng(0)
    column[rng.random(column.shape) < 0.25] += 19
    column[:, 60:] = np.nan
    points = np.array([(70, 30), (200, 200), (20.3, 30.6), (55.5, 30.2)])
    light = light_at(column, row, points, 8)
    np.testing.assert_allclose(light[2:], through(H, points[2:]), atol=1e-6)
    assert np.isnan(light[:2]).all()


def through(H, points):
    """Points (..., 2) through a homography."""
    image = points @ H[:, :2].T + H[:, 2]
    return image[..., :2] / image[..., 2:]
