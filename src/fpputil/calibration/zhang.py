"""Camera and projector from photographs of a board with fringes on it, by Zhang's method (ch. 12).

The board's points are found in the plain photograph; the phases say which projector pixel lights
each of them; so the projector sees the board, too, and both are calibrated as cameras.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from fpputil.calibration.board import Board, spacing
from fpputil.calibration.one_axis import line_at
from fpputil.calibration.stereo import BoardView, StereoFit, calibrate_pair
from fpputil.checks import positive, whole
from fpputil.optics.pinhole import Pinhole
from fpputil.optics.system import System

REACH = 0.5  # squares to each side of a point over which the projector pixel is fitted
KNOWN, ASIDE = 0.3, 0.3  # least share of known pixels; most that their middle may be off, windows
OUTLIER, CLEAR = 3.0, 0.3  # times the median error, and pixels, above which a pose goes
LEAST_POSES, LEAST_POINTS = 3, 12
FEW_POSES = 8
LEAST_TILT = 5.0  # degrees, RMS, by which the boards' normals must vary both ways
LEAST_COVER = 0.3  # share of the camera's picture


MIRRORED = {
    "camera": "the photographs are mirrored left to right, and fx of the camera is negative; if "
    "writing on the scene reads right in them, it is the projector that mirrors (rear projection): "
    "set it right, or the points will be a mirror image",
    "projector": "the projector's picture is mirrored left to right, and its fx is negative",
}
"""What a calibration warns of where camera or projector mirrors."""

ONE_AXIS = (
    "the fringes run along the {0}s alone: measure with {0}s, for what the system says of the "
    "projector across them is assumed, its lens is taken to have no distortion, and mirrored "
    "photographs are not seen"
)
"""What a calibration warns of where one coordinate of the projector is known."""


@dataclass(frozen=True, eq=False)
class Pose:
    """One position of the board, as the camera saw it. Chapter 12.

    Parameters
    ----------
    plain : (H, W) array
        Photograph in white light, or the mean of the fringes, which has less noise.
    column, row : (H, W) arrays
        Projector pixel that lights each camera pixel; NaN where there is no phase. One of them is
        None where the fringes run along the other axis alone.
    name : str
        For messages.

    Examples
    --------
    >>> row, column = np.mgrid[:60.0, :80.0]
    >>> Pose(np.full((60, 80), 90.0), column, row, "left").name
    'left'
    """

    plain: np.ndarray
    column: np.ndarray | None
    row: np.ndarray | None
    name: str = ""

    def __post_init__(self):
        if not self.axes:
            raise ValueError(f"{self.name or 'pose'} without columns and rows given; one is needed")
        shapes = [np.shape(a) for a in (self.plain, *(getattr(self, name) for name in self.axes))]
        if len(set(shapes)) > 1 or len(shapes[0]) != 2:
            raise ValueError(f"plain, column and row {shapes} given; a pose needs one (H, W)")
        for name in self.axes:
            if not np.isfinite(getattr(self, name)).any():
                raise ValueError(
                    f"{self.name or 'pose'} with a {name} map of NaN alone given; decode its "
                    f"{name} fringes with a threshold that leaves pixels"
                )

    @property
    def axes(self) -> tuple[str, ...]:
        """Of "column" and "row" those that are known."""
        return tuple(name for name in ("column", "row") if getattr(self, name) is not None)


@dataclass(frozen=True, eq=False)
class Calibration:
    """What a calibration found. Chapter 12.

    Parameters
    ----------
    system : System
        The camera is the world.
    camera_errors, projector_errors : dict of str to float
        RMS reprojection error of each pose that was used, pixels.
    rejected : dict of str to str
        Poses that were not, and why.
    sigma : dict of str to float
        Standard deviations from the fit: "camera fx" to "projector k3" (fx, fy, cx, cy in pixels)
        and "baseline", mm. They know the scatter of the points, not a wrong square.
    warnings : tuple of str
        What makes the result doubtful: few poses, little tilt, a picture that is hardly covered,
        boards outside the measuring range.
    """

    system: System
    camera_errors: dict[str, float]
    projector_errors: dict[str, float]
    rejected: dict[str, str]
    sigma: dict[str, float]
    warnings: tuple[str, ...] = ()


def calibrate(
    board: Board,
    poses: Sequence[Pose],
    projector: tuple[int, int],
    z_min: float,
    z_max: float,
    *,
    lens: int = 4,
    projector_lens: int | None = None,
    unread: Mapping[str, str] | None = None,
) -> Calibration:
    """Camera, projector and their pose from photographs of a board (Zhang). Chapter 12.

    Each pinhole is calibrated alone, then both and all boards are fitted jointly; poses that fit
    far worse than the others leave, one at a time. The projector may hang in any way, which R says.
    If camera and projector see the boards mirrored, the one that mirrors gets a negative fx: the
    projector with a ChArUco board, whose markers cannot be read in a mirror, else the camera.

    Of fringes along one axis the system measures with that axis alone. What it says of the other
    is assumed (`one_axis`), a warning tells, and so is a lens without distortion.

    Parameters
    ----------
    board : Board
    poses : sequence of Pose
        Ten or more, tilted in different directions and spread over the measuring range.
    projector : (width, height)
        Pixels.
    z_min, z_max : float
        Measuring range of the system that comes out, mm.
    lens, projector_lens : int
        Free distortion coefficients of each: the first 0, 1, 2, 4 or 5 of k1, k2, p1, p2, k3; by
        default 4, of a projector with fringes along one axis 0.
    unread : dict of str to str, optional
        Names of further poses that could not be read, and why: `Calibration.rejected` tells them.

    Raises
    ------
    ValueError
        If there are no poses, their sizes or names clash, the range is not one, fewer than three
        poses show the board lit by fringes, or the poses do not determine the system.
    """
    names = [pose.name or f"pose {k}" for k, pose in enumerate(poses)]
    rejected = dict(unread or {})
    if rejected and not len(poses):
        _enough({}, rejected)
    size = _check(poses, names, projector, z_min, z_max)
    views = {}
    for name, pose in zip(names, poses, strict=True):
        try:
            views[name] = _view(board, pose)
        except ValueError as error:
            rejected[name] = str(error)
    axes = poses[0].axes
    if projector_lens is None:
        projector_lens = 4 if len(axes) > 1 else 0
    mirrored = len(axes) > 1 and _mirrored(views)
    mirror = ("projector" if board.kind == "charuco" else "camera") if mirrored else ""
    sizes = {"camera": size, "projector": tuple(map(int, projector))}
    if mirror:
        views = {name: _flipped(view, mirror, sizes[mirror][0]) for name, view in views.items()}
    while True:
        _enough(views, rejected)
        fit = calibrate_pair(list(views.values()), *sizes.values(), lens, projector_lens)
        name, reason = _worst(fit, list(views))
        if reason is None:
            break
        rejected[name] = reason
        del views[name]
    errors = [dict(zip(views, e.tolist(), strict=True)) for e in fit.errors]
    system = System(*_pinholes(fit, sizes, mirror), float(z_min), float(z_max))
    warnings = tuple(_warnings(fit, list(views.values()), system))
    if mirror:
        warnings = (MIRRORED[mirror], *warnings)
    if len(axes) == 1:
        warnings = (ONE_AXIS.format(axes[0]), *warnings)
    return Calibration(system, *errors, rejected, fit.sigma, warnings)


def light_at(column, row, pixels: np.ndarray, reach: float) -> np.ndarray:
    """Projector pixel that lights each point, by a homography of its own around the point.

    Over a small window of a flat board camera and projector see each other through a homography
    (Moreno and Taubin 2012, "Simple, accurate, and robust projector-camera calibration"). Its
    least median of squares lets up to half of the fringe orders be wrong. Chapter 12.

    `column` and `row`, (H, W), NaN where unknown, are read at `pixels` u, v, (P, 2), in windows of
    half the width `reach`, camera pixels. Returned are columns and rows, (P, 2); NaN where less
    than a third of the window is known or the known pixels lie to one side. One of the maps may
    be None; then its coordinates are NaN.

    Examples
    --------
    >>> row, column = np.mgrid[:40.0, :60.0]
    >>> light_at(2 * column + 5, row, np.array([(30.25, 20.5)]), reach=4).round(6)
    array([[65.5, 20.5]])
    """
    light = np.full(np.shape(pixels), np.nan)
    reach = max(3, round(reach))
    known = [k for k, a in enumerate((column, row)) if a is not None]
    for n, (u, v) in enumerate(pixels):
        left, top = (max(0, round(x) - reach) for x in (u, v))
        window = np.s_[top : max(0, round(v) + reach + 1), left : max(0, round(u) + reach + 1)]
        lit = np.stack([(column, row)[k][window] for k in known], -1)
        y, x = np.nonzero(np.isfinite(lit).all(axis=-1))
        around = np.stack([x + left - u, y + top - v], -1)
        if len(x) < KNOWN * (2 * reach + 1) ** 2 or np.hypot(*around.mean(axis=0)) > ASIDE * reach:
            continue
        if len(known) == 1:
            light[n, known[0]] = line_at(lit[y, x, 0].astype(np.float64), around)
            continue
        H, _ = cv2.findHomography(around, lit[y, x].astype(np.float64), cv2.LMEDS)
        if H is not None:
            light[n] = H[:2, 2] / H[2, 2]  # of the point itself, which is the origin
    return light


def _check(poses, names, projector, z_min, z_max):
    """Size (width, height) of the photographs."""
    if not len(poses):
        raise ValueError(f"no poses given; {LEAST_POSES} are needed, ten are better")
    shapes = sorted({np.shape(p.plain) for p in poses})
    if len(shapes) > 1 or len(set(names)) < len(names):
        raise ValueError(f"photographs {shapes} called {names} given; one size, and each its name")
    if len(axes := {p.axes for p in poses}) > 1:
        raise ValueError(f"poses with fringes along {sorted(axes)} given; all need the same axes")
    if np.shape(projector) != (2,):
        raise ValueError(f"projector {projector} given; its width and height in pixels are needed")
    for what, value in zip(("projector width", "projector height"), projector, strict=True):
        whole(what, value, 2)
    if not positive("z_min", z_min, "mm") < positive("z_max", z_max, "mm"):
        raise ValueError(f"measuring range {z_min} to {z_max} mm given; z_min < z_max is needed")
    return shapes[0][::-1]


def _view(board: Board, pose: Pose) -> BoardView:
    which, pixels = board.find(pose.plain)
    light = light_at(pose.column, pose.row, pixels, REACH * spacing(pixels))
    known = np.isfinite(light).sum(axis=1) == len(pose.axes)
    if known.sum() < LEAST_POINTS:
        raise ValueError(
            f"{known.sum()} of {len(known)} points are lit by fringes; {LEAST_POINTS} are needed"
        )
    return BoardView(board.points[which[known]], pixels[known], light[known])


def _enough(views, rejected):
    if len(views) < LEAST_POSES:
        names = {}
        for name, text in rejected.items():
            names.setdefault(text, []).append(name)
        reasons = "; ".join(f"{', '.join(names[text])}: {text}" for text in names)
        raise ValueError(
            f"{len(views)} of {len(views) + len(rejected)} poses can be used; {LEAST_POSES} are "
            "needed, ten are better" + (f" ({reasons})" if reasons else "")
        )


def _worst(fit: StereoFit, names) -> tuple[str, str | None]:
    """The pose that fits worst, and why it has to go, or None."""
    limits = np.maximum(OUTLIER * np.median(fit.errors, axis=1), CLEAR)
    over = fit.errors / limits[:, None]
    who, k = np.unravel_index(over.argmax(), over.shape)
    if over[who, k] <= 1:
        return names[k], None
    return names[k], (
        f"reprojection error of the {('camera', 'projector')[who]} {fit.errors[who, k]:.2f} px, "
        f"above {limits[who]:.2f} px, {OUTLIER:g} times the median of {len(names)} poses"
    )


def _mirrored(views) -> bool:
    """Whether camera and projector see most boards in opposite senses of rotation."""
    senses = [np.linalg.det(cv2.findHomography(v.camera, v.projector)[0]) for v in views.values()]
    return bool(senses) and float(np.median(np.sign(senses))) < 0


def _flipped(view: BoardView, who: str, width: int) -> BoardView:
    """A view with the picture of camera or projector turned from left to right."""
    return replace(view, **{who: (width - 1, 0) + getattr(view, who) * (-1, 1)})


def _pinholes(fit: StereoFit, sizes, mirror):
    """Camera and projector of a fit; the one whose pictures were flipped becomes a mirror."""
    poses = (np.eye(3), np.zeros(3)), (fit.R, fit.t)
    for lens, (who, size), (R, t) in zip(fit.lenses, sizes.items(), poses, strict=True):
        K = np.array([[lens[0], 0, lens[2]], [0, lens[1], lens[3]], [0, 0, 1]])
        if who == mirror:
            K = np.array([[-1, 0, size[0] - 1], [0, 1, 0], [0, 0, 1]]) @ K
        yield Pinhole(*size, K, R, t, lens[4:] if lens[4:].any() else ())


def _warnings(fit: StereoFit, views: Sequence[BoardView], system: System):
    """Why the poses may not determine the system that was fitted to them, in sentences."""
    normals = Rotation.from_rotvec(fit.poses[:, :3]).as_matrix()[:, :, 2]
    spread = np.linalg.svd(normals - normals.mean(axis=0), compute_uv=False)[1]
    tilt = np.degrees(spread / np.sqrt(len(normals)))
    if tilt < LEAST_TILT:
        yield (
            f"the boards' normals vary by {tilt:.1f} degrees (RMS) in one direction; "
            f"{LEAST_TILT:g} or more both ways are needed, or focal length and depth trade places"
        )
    if len(views) < FEW_POSES:
        yield f"{len(views)} poses were used; with fewer than {FEW_POSES} chance weighs much"
    hull = cv2.convexHull(np.concatenate([v.camera for v in views]).astype(np.float32))
    cover = cv2.contourArea(hull) / (system.camera.width * system.camera.height)
    if cover < LEAST_COVER:
        yield (
            f"the points cover {100 * cover:.0f} % of the picture; beyond them the distortion "
            f"is a guess, so bring the board to the picture's edges"
        )
    near, far = fit.poses[:, 5].min(), fit.poses[:, 5].max()
    if far < system.z_min or near > system.z_max:  # a wrong square, which no +- knows of
        yield (
            f"the boards stand {near:.0f} to {far:.0f} mm away, outside the measuring range of "
            f"{system.z_min:g} to {system.z_max:g} mm; is the size of the board right?"
        )
