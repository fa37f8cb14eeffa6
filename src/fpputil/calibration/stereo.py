"""Camera, projector and all poses of a board in one least-squares fit (chapter 12).

`cv2.stereoCalibrateExtended` fits the same, but takes float32 points (exact ones come back wrong by
2e-5 pixels, here by 2e-13), weights a coarse projector like a fine camera (focal lengths scatter up
to 1.8 times as much where the noise differs twofold), gives no standard deviations, and wants one
lens model for both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from fpputil.calibration.one_axis import resect

LENS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
COUNTS = (0, 1, 2, 4, 5)  # of distortion coefficients that may be free, in OpenCV's order
SURE = 1e-3  # pixels: no fit is weighted as if it were better


@dataclass(frozen=True, eq=False)
class BoardView:
    """Points of a board at one pose: (P, 3) in its frame, mm, and u, v in both, (P, 2), pixels.

    Fringes along one axis leave the projector's other coordinate NaN.
    """

    points: np.ndarray
    camera: np.ndarray
    projector: np.ndarray


@dataclass(frozen=True, eq=False)
class StereoFit:
    """Both pinholes, the pose between them and the poses of all boards.

    Parameters
    ----------
    lenses : (2, 9) array
        fx, fy, cx, cy, k1, k2, p1, p2, k3 of camera and projector; what the coordinate that is
        not known would tell is assumed, as `resect` does.
    R, t : (3, 3) and (3,) array
        Pose of the projector, mm: ``x_projector = R x_camera + t``.
    poses : (N, 6) array
        Rotation vector and translation, mm, of each board in the camera's frame.
    errors : (2, N) array
        RMS distance of each pose's points from their images, pixels.
    sigma : dict of str to float
        Standard deviations: "camera fx" to "projector k3" in pixels (k, p without unit),
        "baseline" in mm; 0 of what was held fixed.
    """

    lenses: np.ndarray
    R: np.ndarray
    t: np.ndarray
    poses: np.ndarray
    errors: np.ndarray
    sigma: dict[str, float]


def known_axis(views: Sequence[BoardView]) -> int | None:
    """Which coordinate of the projector is known alone, 0 (columns) or 1 (rows), or None."""
    known = np.any([np.isfinite(view.projector).any(axis=0) for view in views], axis=0)
    return int(np.argmax(known)) if np.sum(known) == 1 else None


def calibrate_pinhole(views: Sequence[BoardView], who: str, size: tuple[int, int], lens: int):
    """The camera or the projector alone from a flat board at several poses (Zhang, OpenCV).

    Returns its lens, (9,), and the poses of the boards in its frame, (N, 6), as of `StereoFit`,
    and the RMS distance of the points from their images, pixels.
    """
    if lens not in COUNTS:
        raise ValueError(f"{lens} distortion coefficients given; 0, 1, 2, 4 or 5 can be free")
    problem = (
        f"{len(views)} poses given; they do not determine the {who}: tilt the board in several "
        "directions"
    )
    flags = (lens < 1) * cv2.CALIB_FIX_K1 | (lens < 2) * cv2.CALIB_FIX_K2
    flags |= (lens < 4) * cv2.CALIB_ZERO_TANGENT_DIST | (lens < 5) * cv2.CALIB_FIX_K3
    points = [v.points.astype(np.float32) for v in views]
    pixels = [getattr(v, who).astype(np.float32) for v in views]
    try:
        rms, K, d, *turns = cv2.calibrateCamera(points, pixels, size, None, None, flags=flags)
    except cv2.error as error:
        raise ValueError(f"{problem} (OpenCV: {error.err})") from error
    pinhole = np.concatenate([K[(0, 1, 0, 1), (0, 1, 2, 2)], d.ravel()[:5]])
    poses = np.concatenate([np.reshape(t, (-1, 3)) for t in turns[:2]], axis=1)
    if not np.isfinite([rms, *pinhole, *poses.ravel()]).all():
        raise ValueError(problem)
    return pinhole, poses, rms


def calibrate_pair(
    views: Sequence[BoardView],
    camera: tuple[int, int],
    projector: tuple[int, int],
    lens: int = 4,
    projector_lens: int = 4,
) -> StereoFit:
    """Fit both pinholes, the pose between them and all boards to all points at once. Chapter 12.

    Each pinhole's residuals are weighted by the inverse of their RMS when it is fitted alone. A
    projector of which one coordinate is known has no distortion.

    Parameters
    ----------
    views : sequence of N BoardView
    camera, projector : (width, height)
        Pixels.
    lens, projector_lens : int
        Free distortion coefficients of each: the first 0, 1, 2, 4 or 5 of k1, k2, p1, p2, k3.

    Raises
    ------
    ValueError
        If the poses do not determine a pinhole, or a number of coefficients is unknown.

    Examples
    --------
    >>> from fpputil.calibration.board import Board
    >>> from fpputil.calibration.placement import place_boards
    >>> from fpputil.optics.system import preset
    >>> system, board = preset("tiny").system, Board(8, 5, 30.0)
    >>> camera, projector = system.camera, system.projector
    >>> middle = board.points - board.points.mean(axis=0)
    >>> places = [middle @ R.T + t for R, t in place_boards(4, 0, system, board.size)]
    >>> views = [
    ...     BoardView(board.points, camera.project(x), projector.project(x)) for x in places
    ... ]
    >>> fit = calibrate_pair(views, (160, 120), (912, 1140), lens=0, projector_lens=0)
    >>> bool(np.allclose(fit.t, projector.t))
    True
    """
    axis = known_axis(views)
    if axis is not None and projector_lens:
        raise ValueError(
            f"{projector_lens} distortion coefficients of the projector given; fringes along one "
            "axis determine none"
        )
    seen = calibrate_pinhole(views, "camera", camera, lens)
    if axis is None:
        lit = calibrate_pinhole(views, "projector", projector, projector_lens)
        pinhole, between, rms = lit[0], _between(seen, lit), lit[2]
    else:
        light = np.concatenate([view.projector[:, axis] for view in views])
        pinhole, between = resect(_in_camera(views, seen[1]), light, axis, projector)
    start = np.concatenate([seen[0], pinhole, between, seen[1].ravel()])
    free = np.ones(len(start), bool)
    free[4 + lens : 9] = free[13 + projector_lens : 18] = False
    if axis is not None:
        free[[10 - axis, 12 - axis, 22 - axis]] = False  # focal length, centre, place across
        rms = np.sqrt(np.nanmean(_off(start, views)[1] ** 2))
    weights = 1 / np.maximum([seen[2], rms], SURE)[:, None, None]

    def full(x):
        values = start.copy()
        values[free] = x
        return values

    def residuals(x):
        return np.nan_to_num(_off(full(x), views) * weights).ravel()

    fit = least_squares(residuals, start[free], method="lm", x_scale="jac")
    return _fit(full(fit.x), views, _covariance(fit, free))


def _between(camera, projector):
    """Rotation vector and translation from camera to projector, (6,), mean of all poses."""
    of = [Rotation.from_rotvec(poses[:, :3]) for _, poses, _ in (camera, projector)]
    R = (of[1] * of[0].inv()).mean()
    t = np.median(projector[1][:, 3:] - R.apply(camera[1][:, 3:]), axis=0)
    return np.concatenate([R.as_rotvec(), t])


def _off(x, views):
    """Pixels by which all P points miss their images in camera and projector, (2, P, 2)."""
    local = _in_camera(views, x[24:].reshape(-1, 6))
    lit = local @ Rotation.from_rotvec(x[18:21]).as_matrix().T + x[21:24]
    measured = [np.concatenate([getattr(v, who) for v in views]) for who in ("camera", "projector")]
    return np.stack([_image(local, x[:9]), _image(lit, x[9:18])]) - measured


def _in_camera(views, poses):
    """All points of the boards in the camera's frame, (P, 3), mm."""
    turns = Rotation.from_rotvec(poses[:, :3]).as_matrix()
    placed = zip(views, turns, poses[:, 3:], strict=True)
    return np.concatenate([view.points @ R.T + t for view, R, t in placed])


def _image(local, lens):
    fx, fy, cx, cy = lens[:4]
    K, zero = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), np.zeros(3)
    return cv2.projectPoints(local, zero, zero, K, lens[4:])[0].reshape(-1, 2)


def _covariance(fit, free):
    """Of all parameters; zero for those held fixed."""
    scale = np.linalg.norm(fit.jac, axis=0)
    J = fit.jac / np.where(scale > 0, scale, 1)
    # Without the small ridge a direction that nothing determines would end the calculation.
    inverse = np.linalg.inv(J.T @ J + 1e-13 * np.eye(len(scale))) / np.outer(scale, scale)
    spare = max(1, fit.jac.shape[0] - fit.jac.shape[1])
    full = np.zeros((len(free), len(free)))
    full[np.ix_(free, free)] = inverse * (2 * fit.cost / spare)
    return full


def _fit(x, views, covariance) -> StereoFit:
    square = np.nansum(_off(x, views) ** 2, axis=-1)
    ends = np.cumsum([len(v.points) for v in views])[:-1]
    errors = [[np.sqrt(part.mean()) for part in np.split(each, ends)] for each in square]
    t = x[21:24]
    along = t / np.linalg.norm(t)
    names = [f"{who} {name}" for who in ("camera", "projector") for name in LENS]
    sigma = dict(zip(names, np.sqrt(np.diag(covariance)[:18]).tolist(), strict=True))
    sigma["baseline"] = float(np.sqrt(along @ covariance[21:24, 21:24] @ along))
    return StereoFit(
        lenses=x[:18].reshape(2, 9),
        R=Rotation.from_rotvec(x[18:21]).as_matrix(),
        t=t,
        poses=x[24:].reshape(-1, 6),
        errors=np.array(errors),
        sigma=sigma,
    )
