"""Flat boards with points at known places, and where a photograph shows them (chapter 12)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

from fpputil.calibration.board_corners import refine
from fpputil.checks import positive, whole

MARKERS = 250  # of the dictionary of a ChArUco board
MARKER, DISC = 0.75, 0.5  # width of a marker and diameter of a circle, squares
LEAST = 3  # columns and rows of a ChArUco board that must be found
DISC_OF = {"chessboard": 0.35, "charuco": 0.15}  # radius, squares, where no other edge reaches


@dataclass(frozen=True)
class Board:
    """A flat target with points at known places. Chapter 12.

    Parameters
    ----------
    columns, rows : int
        Points across and down: inner corners of a chessboard, circles.
    square : float
        Distance of neighbouring points, mm.
    kind : {"chessboard", "charuco", "circles"}
        A ChArUco board carries 4 x 4 markers, three quarters of a square wide, and may be seen
        in part; circles stand in a symmetric grid, half a square across.

    Examples
    --------
    >>> board = Board(8, 5, 25.0)
    >>> board.points.shape, board.size
    ((40, 3), (225.0, 150.0))
    >>> which, pixels = board.find(board.picture(20))
    >>> len(which), pixels[which == 0].round(1)
    (40, array([[39.5, 39.5]]))
    """

    columns: int
    rows: int
    square: float
    kind: str = "chessboard"

    def __post_init__(self):
        whole("columns", self.columns, LEAST)
        whole("rows", self.rows, LEAST)
        positive("square", self.square, "mm")
        if self.kind not in KINDS:
            raise ValueError(f"board {self.kind!r} given; the kinds are {', '.join(KINDS)}")
        needed = (self.columns + 1) * (self.rows + 1) // 2
        if self.kind == "charuco" and needed > MARKERS:
            raise ValueError(
                f"a ChArUco board of {self.columns} x {self.rows} corners given; it needs {needed} "
                f"markers and the dictionary has {MARKERS}"
            )

    @property
    def points(self) -> np.ndarray:
        """Points in the board's own frame, (rows * columns, 3) float64, mm, row by row; z is 0."""
        v, u = np.mgrid[: self.rows, : self.columns]
        return np.stack([u, v, np.zeros_like(u)], -1).reshape(-1, 3) * float(self.square)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the printed squares, mm, without the margin of the picture."""
        return (self.columns + 1) * self.square, (self.rows + 1) * self.square

    def picture(self, scale: int = 40) -> np.ndarray:
        """The board to print or to render, with a white margin of one square on every side.

        Of `scale`, 16 or more, pixels a square: ((rows + 3) * scale, (columns + 3) * scale) uint8.
        """
        whole("scale", scale, 16)
        draw, _ = KINDS[self.kind]
        return np.pad(draw(self, scale), scale, constant_values=255)

    def find(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which points of the board a photograph shows, and where.

        Parameters
        ----------
        image : (H, W) array
            Integers or floats, of any brightness; the mean of many frames has least noise.

        Returns
        -------
        which : (P,) int array
            Rows of `points`.
        pixels : (P, 2) float64 array
            u, v, to a few hundredths of a pixel.

        Raises
        ------
        ValueError
            If the image is no finite (H, W) array or does not show the board.
        """
        _, find = KINDS[self.kind]
        corners = find(self, _check_image(image))
        if corners is None:
            raise ValueError(
                f"no {self.kind} of {self.columns} x {self.rows} points found; the board must be "
                "in the picture, sharp and evenly lit, and of a chessboard its inner corners "
                "count, one fewer than squares each way"
            )
        which, pixels = corners
        return which, pixels.astype(np.float64)

    def _charuco(self):
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
        size = (self.columns + 1, self.rows + 1)
        return cv2.aruco.CharucoBoard(size, self.square, MARKER * self.square, dictionary)


def spacing(pixels: np.ndarray) -> float:
    """Least distance between two of the points (P, 2), pixels."""
    return float(cKDTree(pixels).query(pixels, k=2)[0][:, 1].min())


def _draw_chessboard(board, scale):
    v, u = np.indices(((board.rows + 1) * scale, (board.columns + 1) * scale)) // scale
    return np.where((u + v) % 2, 255, 0).astype(np.uint8)


def _draw_charuco(board, scale):
    return board._charuco().generateImage(((board.columns + 1) * scale, (board.rows + 1) * scale))


def _draw_circles(board, scale):
    v, u = (np.indices(((board.rows + 1) * scale, (board.columns + 1) * scale)) + 0.5) / scale
    off = np.hypot(
        u - np.clip(np.rint(u), 1, board.columns), v - np.clip(np.rint(v), 1, board.rows)
    )
    edge = (off - DISC / 2) * scale + 0.5  # one pixel from black to white
    return np.rint(255 * np.clip(edge, 0, 1)).astype(np.uint8)


def _check_image(image) -> np.ndarray:
    image = np.asarray(image)
    if image.ndim != 2 or min(image.shape) < 32 or image.dtype.kind not in "uif":
        raise ValueError(
            f"photograph of shape {image.shape} and dtype {image.dtype} given; "
            "a board is found in (H, W) numbers, 32 pixels or more each way"
        )
    image = image.astype(np.float32)
    if not np.isfinite(image).all() or image.max() <= 0:
        raise ValueError("photograph that is black or holds NaN given; all must be finite numbers")
    return np.clip(image * (255 / np.percentile(image, 99.9).clip(1e-6)), 0, 255)


def _find_chessboard(board, image):
    """By its squares, which is fast, or else by its saddle points."""
    size, image8 = (board.columns, board.rows), _bytes(image)
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    complete, pixels = cv2.findChessboardCorners(image8, size, flags=flags)
    if not complete:
        flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE
        complete, pixels = cv2.findChessboardCornersSB(image8, size, flags=flags)
    if not complete:
        return None
    return _refined(board, image, np.arange(board.columns * board.rows), pixels.reshape(-1, 2))


def _find_charuco(board, image):
    pixels, which, *_ = cv2.aruco.CharucoDetector(board._charuco()).detectBoard(_bytes(image))
    which = np.ravel([] if which is None else which)
    if min(len(set(which // board.columns)), len(set(which % board.columns))) < LEAST:
        return None
    return _refined(board, image, which, pixels.reshape(-1, 2))


def _refined(board, image, which, pixels):
    """The corners found, to a hundredth of a pixel, without those that do not look like one."""
    flat = board.points[which, :2]
    H = cv2.findHomography(flat, pixels)[0]
    steps = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)]) * (board.square / 4)
    ends = cv2.perspectiveTransform(flat + steps[:, None], H)
    edges = np.stack([ends[0] - ends[2], ends[1] - ends[3]], 1)
    radius = max(3.0, DISC_OF[board.kind] * spacing(pixels))
    corners = refine(image, pixels, edges, radius)
    known = np.isfinite(corners).all(axis=1)
    return (which[known], corners[known]) if known.sum() >= LEAST**2 else None


def _find_circles(board, image):
    options = cv2.SimpleBlobDetector_Params()
    options.maxArea = image.size / (board.columns * board.rows)
    size, blobs = (board.columns, board.rows), cv2.SimpleBlobDetector_create(options)
    complete, pixels = cv2.findCirclesGrid(_bytes(image), size, blobDetector=blobs)
    if not complete:
        return None
    pixels = pixels.reshape(-1, 2).astype(np.float64)
    reach = spacing(pixels) / 2
    centroids = np.array([_centroid(image, *p, reach) for p in pixels])
    if not np.isfinite(centroids).all():
        return None
    return np.arange(len(pixels)), centroids - _ellipse_shift(board, centroids)


def _centroid(image, u, v, reach):
    """Middle, u and v, of the dark disc at a point, by what it takes of the light around it."""
    # Neighbours stay outside.
    rows, cols = (slice(max(0, round(x - reach)), round(x + reach) + 1) for x in (v, u))
    y, x = (a.ravel() for a in np.mgrid[rows, cols][:, : image.shape[0], : image.shape[1]])
    light = image[y, x].astype(np.float64)
    white = light > (light.min() + light.max()) / 2
    terms = np.column_stack([np.ones(len(x)), x - u, y - v])
    around = terms @ np.linalg.lstsq(terms[white], light[white], rcond=None)[0]
    dark = np.clip(1 - light / around, 0, None)
    dark[dark < 0.1 * dark.max()] = 0  # noise of the white paper far out
    return dark @ x / dark.sum(), dark @ y / dark.sum()


def _ellipse_shift(board, pixels):
    """What the middle of each ellipse is off the image of its circle's middle, (P, 2), pixels.

    The dual conic ``c c^T - r^2 diag(1, 1, 0)`` of a circle goes through a homography H as
    ``H C H^T``, and its last column is the middle of the ellipse.
    """
    flat = np.column_stack([board.points[:, :2], np.ones(len(pixels))])
    H = cv2.findHomography(flat[:, :2], pixels)[0]
    middle = flat @ H.T
    ellipse = middle * middle[:, 2:] - (DISC / 2 * board.square) ** 2 * (
        H @ np.diag([1.0, 1.0, 0.0]) @ H[2]
    )
    return ellipse[:, :2] / ellipse[:, 2:] - middle[:, :2] / middle[:, 2:]


def _bytes(image):
    return np.rint(image).astype(np.uint8)


KINDS = {
    "chessboard": (_draw_chessboard, _find_chessboard),
    "charuco": (_draw_charuco, _find_charuco),
    "circles": (_draw_circles, _find_circles),
}
