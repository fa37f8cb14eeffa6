"""A projector of which only one coordinate is known: fringes along one axis (chapter 12).

Of the three rows of a projection matrix (paper, Eq. 8) a column needs the first and the third. So
columns tell the projector's turn, its focal length, and its place but for a move along its own
columns; a row tells nothing more of depth, and its focal length and place are assumed.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

DRAWS, SAMPLE = 200, 5  # at half of the orders wrong, one of 32 samples has none
INLIER = 2.5  # robust standard deviations


def line_at(coordinate, around) -> float:
    """Coordinate at the origin of one that a flat board shows at points (P, 2) around it.

    It is a quotient of two linear functions of the place, as each coordinate of a homography; its
    least median of squares lets up to half of the fringe orders be wrong. NaN if nothing fits.

    >>> x, y = np.mgrid[-4.0:5, -4.0:5].reshape(2, -1)
    >>> wrong = np.arange(81) % 3 == 0
    >>> float(round(line_at((50 + 2 * x) / (1 + 0.01 * y) + 24 * wrong, np.stack([x, y], -1)), 6))
    50.0
    """
    scale = np.abs(around).max()
    x, y = np.transpose(around) / scale
    A = np.stack([x, y, np.ones_like(x), -coordinate * x, -coordinate * y], axis=-1)
    draws = np.random.default_rng(0).integers(len(x), size=(DRAWS, SAMPLE))
    whole = np.abs(np.linalg.det(A[draws])) > 1e-9 * np.abs(coordinate).max() ** 2
    if not whole.any():
        return np.nan
    fits = np.linalg.solve(A[draws[whole]], coordinate[draws[whole], None])[..., 0]
    square = (A @ fits.T - coordinate[:, None]) ** 2
    best = np.median(square, axis=0).argmin()
    limit = INLIER * 1.4826 * np.sqrt(np.median(square[:, best])) + 1e-6
    near = np.sqrt(square[:, best]) <= limit
    return float(np.linalg.lstsq(A[near], coordinate[near], rcond=None)[0][2])


def resect(points, coordinate, axis: int, size: tuple[int, int]):
    """Lens (9,) and pose (6,) of a projector from points (P, 3) and one coordinate of each, (P,).

    `axis` is 0 of columns, 1 of rows; `size` is (width, height). The other coordinate has the same
    focal length, its principal point in the middle, and no translation: assumptions. The pose is
    rotation vector and translation, as of `StereoFit`. ValueError if the points do not determine
    it, as those of one plane.
    """
    middle, spread = points.mean(axis=0), points.std()
    centre, half = coordinate.mean(), coordinate.std() or 1.0
    X = np.column_stack([(points - middle) / spread, np.ones(len(points))])
    c = ((coordinate - centre) / half)[:, None]
    _, s, V = np.linalg.svd(np.hstack([X, -c * X]), full_matrices=False)
    if not s[-2] > 1e-6 * s[0]:
        raise ValueError("points of one plane do not determine the projector")
    own, third = V[-1].reshape(2, 4)
    own = half * own + centre * third
    back = np.block([[np.eye(3) / spread, -middle[:, None] / spread], [np.zeros(3), 1.0]])
    own, third = np.stack([own, third]) @ back
    third, own = (row / np.linalg.norm(third[:3]) for row in (third, own))
    sign = np.sign(np.median(points @ third[:3] + third[3]))  # what is lit stands before it
    own, third = sign * own, sign * third
    principal = own[:3] @ third[:3]
    along = own[:3] - principal * third[:3]
    focal = np.linalg.norm(along)
    rows = np.empty((3, 3))
    rows[2], rows[axis] = third[:3], along / focal
    rows[1 - axis] = np.cross(rows[2], rows[0]) if axis == 0 else np.cross(rows[1], rows[2])
    t = np.zeros(3)
    t[2], t[axis] = third[3], (own[3] - principal * third[3]) / focal
    middles = (np.asarray(size) - 1) / 2
    middles[axis] = principal
    lens = np.concatenate([[focal, focal], middles, np.zeros(5)])
    return lens, np.concatenate([Rotation.from_matrix(rows).as_rotvec(), t])
