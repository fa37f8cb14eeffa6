"""A pinhole with lens distortion: the camera, and the projector (chapter 2).

Pixel centres lie at integer coordinates, as in OpenCV.
"""

from dataclasses import dataclass, field

import cv2
import numpy as np

from fpputil.checks import at_most, rotation_matrix, whole


@dataclass(frozen=True, eq=False)
class Pinhole:
    """A pinhole with lens distortion; a projector is a camera that sends light.

    Parameters
    ----------
    width, height : int
        Pixels.
    K : (3, 3) array
        Camera matrix, pixels. Its first focal length is negative if the picture is mirrored left
        to right.
    R : (3, 3) array
        Rotation from the world to this pinhole's frame.
    t : (3,) array
        Translation in mm: ``x_local = R x_world + t``.
    distortion : (k,) array
        OpenCV's coefficients (k1, k2, p1, p2, k3 ...); empty for an ideal lens.

    Examples
    --------
    >>> camera = Pinhole(640, 480, camera_matrix(1000, 640, 480))
    >>> camera.project([0, 0, 500]).tolist()
    [319.5, 239.5]
    >>> (500 * camera.rays([419.5, 239.5])).tolist()
    [50.0, 0.0, 500.0]
    """

    width: int
    height: int
    K: np.ndarray
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    t: np.ndarray = field(default_factory=lambda: np.zeros(3))
    distortion: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self):
        for name in ("K", "R", "t", "distortion"):
            value = np.array(getattr(self, name), np.float64)
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        K, R, t, distortion = self.K, self.R, self.t, self.distortion
        if K.shape != (3, 3) or t.shape != (3,):
            raise ValueError(f"K {K.shape}, t {t.shape} given; they are (3, 3) and (3,)")
        pixels = whole("width", self.width, 1) * whole("height", self.height, 1)
        at_most(f"{self.width} x {self.height} pixels, in all", pixels, "FPP_MOST_PIXELS")
        if not all(np.isfinite(a).all() for a in (K, R, t, distortion)):
            raise ValueError("NaN or infinite camera parameters given; all must be finite")
        if not (K[0, 0] != 0 and K[1, 1] > 0 and np.allclose(K[2], (0, 0, 1)) and K[1, 0] == 0):
            raise ValueError(
                f"camera matrix {K.tolist()} given; it needs positive focal lengths (the first is "
                "negative in a mirror) and the last row 0 0 1, or its rays are undefined"
            )
        rotation_matrix("R", R)
        if (k := distortion.size) not in (0, 4, 5, 8, 12, 14):
            raise ValueError(
                f"{k} distortion coefficients given; OpenCV takes 0, 4, 5, 8, 12 or 14"
            )

    @property
    def centre(self) -> np.ndarray:
        """Optical centre in the world, (3,), mm."""
        return -self.R.T @ self.t

    @property
    def P(self) -> np.ndarray:
        """Projection matrix K [R | t], (3, 4), of the ideal lens."""
        return self.K @ np.column_stack([self.R, self.t])

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels u (column) and v (row), (..., 2), of world points (..., 3), mm.

        NaN for points that are not in front of the pinhole, and for those so far off its axis that
        the distortion would fold them back into the image.
        """
        points = np.asarray(points, np.float64)
        local = points @ self.R.T + self.t
        with np.errstate(divide="ignore", invalid="ignore"):
            xy = local[..., :2] / local[..., 2:]
        xy = np.where(local[..., 2:] > 0, xy, np.nan)
        if self.distortion.any():
            distorted = self._distort(xy)
            xy = np.where(_apart(self._undistort(distorted), xy), np.nan, distorted)
        return xy @ self.K[:2, :2].T + self.K[:2, 2]

    def pixels(self, xy: np.ndarray) -> np.ndarray:
        """Pixels u, v, (..., 2), of directions x / z, y / z, (..., 2), in this pinhole's frame.

        Other than by `project`, a direction that the distortion folds back is not noticed.
        """
        xy = self._distort(xy) if self.distortion.any() else xy
        return xy @ self.K[:2, :2].T + self.K[:2, 2]

    def rays(self, pixels: np.ndarray | None = None) -> np.ndarray:
        """Directions (..., 3), in the world, of the rays through pixels; z is 1 in its own frame.

        Of u and v, (..., 2); by default of all pixel centres, (H, W, 2). ``centre + s * rays`` are
        the points seen; NaN where the distortion leaves no ray.
        """
        pixels = self.grid() if pixels is None else np.asarray(pixels, np.float64)
        xy = (pixels - self.K[:2, 2]) @ np.linalg.inv(self.K[:2, :2]).T
        if self.distortion.any():
            ideal = self._undistort(xy)
            xy = np.where(_apart(self._distort(ideal), xy), np.nan, ideal)
        return np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1) @ self.R

    def _distort(self, xy):
        """Distort normalised coordinates (..., 2); NaN stays NaN. OpenCV's takes 20 times as long.

        Only a tilted sensor, of 14 coefficients, is left to it.
        """
        k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, *tilt = np.pad(
            self.distortion, (0, 14 - self.distortion.size)
        )
        if any(tilt):
            lens = np.zeros(3), np.zeros(3), np.eye(3), self.distortion
            return _where_known(xy, lambda p: cv2.projectPoints(np.insert(p, 2, 1, 1), *lens)[0])
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        if k4 or k5 or k6:
            radial /= 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        out = xy * (radial + 2 * (p1 * y + p2 * x))[..., None]
        out[..., 0] += r2 * (p2 + s1 + r2 * s2)
        out[..., 1] += r2 * (p1 + s3 + r2 * s4)
        return out

    def _undistort(self, xy):
        """Undistort normalised coordinates (..., 2); NaN stays NaN."""
        stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
        lens = (np.eye(3), self.distortion, None, None, stop)
        return _where_known(xy, lambda flat: cv2.undistortPointsIter(flat[:, None], *lens))

    def grid(self) -> np.ndarray:
        """Pixel centres u, v, shape (H, W, 2)."""
        return np.stack(np.meshgrid(np.arange(float(self.width)), np.arange(self.height)), -1)

    def inside(self, pixels: np.ndarray) -> np.ndarray:
        """True where pixels (..., 2) lie on the sensor, from -0.5 to size - 0.5."""
        u, v = pixels[..., 0], pixels[..., 1]
        return (u >= -0.5) & (u < self.width - 0.5) & (v >= -0.5) & (v < self.height - 0.5)


def _where_known(xy, lens):
    """``lens`` of those coordinates (..., 2) that are finite; the others stay NaN."""
    out = np.full(xy.shape, np.nan)
    known = np.isfinite(xy[..., 0] + xy[..., 1])
    if known.any():
        out[known] = lens(np.ascontiguousarray(xy[known]))[:, 0]
    return out


def _apart(a, b):
    """True, (..., 1), where normalised coordinates (..., 2) differ or are unknown."""
    with np.errstate(invalid="ignore"):
        off = np.abs(a - b)
        return ~(np.maximum(off[..., :1], off[..., 1:]) < 1e-6)


def camera_matrix(focal: float, width: int, height: int) -> np.ndarray:
    """K with square pixels and the principal point in the middle, (3, 3), pixels."""
    return np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])


def looking(look_from, look_at, size: tuple[int, int], angle: float) -> Pinhole:
    """The pinhole of a viewer at one point, mm, who looks at another, the world's -y up.

    `size` is (width, height), pixels; `angle` the vertical field of view, degrees.

    >>> eye = looking((100, 0, 0), (100, 0, 500), (320, 240), angle=30)
    >>> eye.project([100, 0, 500]).tolist()
    [159.5, 119.5]
    """
    look_from, look_at = np.asarray(look_from, np.float64), np.asarray(look_at, np.float64)
    if not 0 < angle < 180:
        raise ValueError(f"angle {angle} given; a field of view lies between 0 and 180 degrees")
    forward = look_at - look_from
    right = np.cross([0.0, 1.0, 0.0], forward)
    if not np.linalg.norm(right) > 0:
        raise ValueError(
            f"an eye at {look_from.tolist()} mm that looks at {look_at.tolist()} mm given; its "
            "direction must not be zero or along y, or the picture has no upper edge"
        )
    right, forward = right / np.linalg.norm(right), forward / np.linalg.norm(forward)
    R = np.stack([right, np.cross(forward, right), forward])
    focal = size[1] / 2 / np.tan(np.radians(angle) / 2)
    return Pinhole(*size, camera_matrix(focal, *size), R, -R @ look_from)
