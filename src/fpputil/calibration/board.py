"""Flat boards with points at known places, and where a photograph shows them (chapter 12)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
from scipy.spatial import cKDTree

from fpputil.calibration.board_corners import refine
from fpputil.checks import positive, whole

DICTIONARY = "4x4_250"  # of the markers of a ChArUco board
MARKER, DISC = 0.75, 0.5  # width of a marker and diameter of a circle that is drawn, squares
ENOUGH = 1200  # pixels of a picture's longer side, in which a board is recognised
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
    kind : {"chessboard", "charuco", "circles", "asymmetric"}
        A ChArUco board carries markers and may be seen in part. Circles, black on white or white
        on black, stand in a symmetric grid, or in an asymmetric one as OpenCV's: the distance
        `square` is that of neighbouring rows, of which every second one is moved by it, and
        those of a row are two apart.
    dictionary : str
        Of the markers of a ChArUco board, as OpenCV calls it: "5x5_100", "apriltag_36h11" ...
    legacy : bool
        Whether a ChArUco board has the layout of OpenCV before 4.6: with an even number of rows
        of squares its first one is white.
    marker : float
        Width of a marker, squares.

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
    dictionary: str = DICTIONARY
    legacy: bool = False
    marker: float = MARKER

    def __post_init__(self):
        whole("columns", self.columns, LEAST)
        whole("rows", self.rows, LEAST)
        positive("square", self.square, "mm")
        if self.kind not in KINDS:
            raise ValueError(f"board {self.kind!r} given; the kinds are {', '.join(KINDS)}")
        if self.kind != "charuco":
            return
        if not 0 < positive("marker", self.marker, "squares") < 1:
            raise ValueError(f"marker {self.marker} given; it is less than a square wide")
        if (name := self.dictionary.lower()) not in _dictionaries():
            known = ", ".join(_dictionaries())
            raise ValueError(f"dictionary {self.dictionary!r} given; OpenCV has {known}")
        needed, there = self._markers, len(_dictionaries()[name].bytesList)
        if needed > there:
            raise ValueError(
                f"a ChArUco board of {self.columns} x {self.rows} corners given; it needs {needed} "
                f"markers and the dictionary has {there}"
            )

    @property
    def points(self) -> np.ndarray:
        """Points in the board's own frame, (rows * columns, 3) float64, mm, row by row; z is 0."""
        v, u = np.mgrid[: self.rows, : self.columns]
        u = 2 * u + v % 2 if self.kind == "asymmetric" else u
        return np.stack([u, v, np.zeros_like(u)], -1).reshape(-1, 3) * float(self.square)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the printed squares, mm, without the margin of the picture."""
        return self._across * self.square, (self.rows + 1) * self.square

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
                f"count, one fewer than squares each way{_likely(self, _check_image(image))}"
            )
        which, pixels = corners
        return which, pixels.astype(np.float64)

    @property
    def _across(self) -> int:
        """Squares from the left edge to the right."""
        return 2 * self.columns + 1 if self.kind == "asymmetric" else self.columns + 1

    @property
    def _markers(self) -> int:
        return (self.columns + 1) * (self.rows + 1) // 2

    def _charuco(self):
        dictionary = _dictionaries()[self.dictionary.lower()]
        size, marker = (self.columns + 1, self.rows + 1), self.marker * self.square
        board = cv2.aruco.CharucoBoard(size, self.square, marker, dictionary)
        board.setLegacyPattern(self.legacy)
        return board


@cache
def _dictionaries() -> dict:
    """Dictionaries of markers by name, the small ones of a kind first."""
    names = [name for name in dir(cv2.aruco) if name.startswith("DICT_")]
    names.sort(key=lambda name: getattr(cv2.aruco, name))
    predefined = cv2.aruco.getPredefinedDictionary
    return {name[5:].lower(): predefined(getattr(cv2.aruco, name)) for name in names}


def spacing(pixels: np.ndarray) -> float:
    """Least distance between two of the points (P, 2), pixels."""
    return float(cKDTree(pixels).query(pixels, k=2)[0][:, 1].min())


def _draw_chessboard(board, scale):
    v, u = np.indices(((board.rows + 1) * scale, (board.columns + 1) * scale)) // scale
    return np.where((u + v) % 2, 255, 0).astype(np.uint8)


def _draw_charuco(board, scale):
    return board._charuco().generateImage(((board.columns + 1) * scale, (board.rows + 1) * scale))


def _draw_circles(board, scale):
    v, u = (np.indices(((board.rows + 1) * scale, board._across * scale)) + 0.5) / scale - 1
    off, _ = cKDTree(board.points[:, :2] / board.square).query(np.stack([u, v], -1))
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
    """Black circles on white, or else white ones on black."""
    found = _find_black_circles(board, image)
    return found if found is not None else _find_black_circles(board, 255 - image)


def _find_black_circles(board, image):
    options = cv2.SimpleBlobDetector_Params()
    options.maxArea = image.size / (board.columns * board.rows)
    size, blobs = (board.columns, board.rows), cv2.SimpleBlobDetector_create(options)
    grid = cv2.CALIB_CB_ASYMMETRIC_GRID if board.kind == "asymmetric" else 0
    flags = grid or cv2.CALIB_CB_SYMMETRIC_GRID
    complete, pixels = cv2.findCirclesGrid(_bytes(image), size, flags=flags, blobDetector=blobs)
    if not complete:
        return None
    pixels = pixels.reshape(-1, 2).astype(np.float64)
    reach = spacing(pixels) / 2
    *centroids, areas = np.array([_centroid(image, *p, reach) for p in pixels]).T
    centroids = np.stack(centroids, -1)
    if not np.isfinite(centroids).all():
        return None
    return np.arange(len(pixels)), centroids - _ellipse_shift(board, centroids, areas)


def _centroid(image, u, v, reach):
    """Middle, u and v, of the dark disc at a point, by what it takes of the light; its area."""
    # Neighbours stay outside.
    rows, cols = (slice(max(0, round(x - reach)), round(x + reach) + 1) for x in (v, u))
    y, x = (a.ravel() for a in np.mgrid[rows, cols][:, : image.shape[0], : image.shape[1]])
    light = image[y, x].astype(np.float64)
    white = light > (light.min() + light.max()) / 2
    terms = np.column_stack([np.ones(len(x)), x - u, y - v])
    around = terms @ np.linalg.lstsq(terms[white], light[white], rcond=None)[0]
    dark = np.clip(1 - light / around, 0, None)
    dark[dark < 0.1 * dark.max()] = 0  # noise of the white paper far out
    return dark @ x / dark.sum(), dark @ y / dark.sum(), dark.sum() / dark.max()


def _ellipse_shift(board, pixels, areas):
    """What the middle of each ellipse is off the image of its circle's middle, (P, 2), pixels.

    The dual conic ``c c^T - r^2 diag(1, 1, 0)`` of a circle goes through a homography H as
    ``H C H^T``, and its last column is the middle of the ellipse. The radius r comes of the
    areas, (P,), square pixels.
    """
    flat = np.column_stack([board.points[:, :2], np.ones(len(pixels))])
    H = cv2.findHomography(flat[:, :2], pixels)[0]
    middle = flat @ H.T
    scale = np.abs(np.linalg.det(H)) / np.abs(middle[:, 2]) ** 3  # square pixels a square mm
    square_of_radius = np.median(areas / scale) / np.pi
    ellipse = middle * middle[:, 2:] - square_of_radius * (H @ np.diag([1.0, 1.0, 0.0]) @ H[2])
    return ellipse[:, :2] / ellipse[:, 2:] - middle[:, :2] / middle[:, 2:]


def _bytes(image):
    return np.rint(image).astype(np.uint8)


def _likely(board, image) -> str:
    """What another board the photograph shows, as a remedy; "" if none that comes to mind."""
    image = _small(image)
    for other in _others(board, image):
        if KINDS[other.kind][1](other, image) is None:
            continue
        text = f"; it looks like --kind {other.kind} --board {other.columns}x{other.rows}"
        if other.kind == "charuco":
            text += f" --dictionary {other.dictionary}" + other.legacy * " --legacy"
        return text
    return ""


def _small(image):
    """The picture at a size that is enough to recognise a board."""
    scale = ENOUGH / max(image.shape)
    area = {"fx": scale, "fy": scale, "interpolation": cv2.INTER_AREA}
    return image if scale >= 1 else cv2.resize(image, None, **area)


def _others(board, image):
    """Boards that may be meant by one that was not found."""
    sizes = [(board.columns, board.rows), (board.rows, board.columns)]
    if (dictionary := _dictionary_seen(image, board._markers)) is not None:
        for legacy in (False, True):
            yield replace(board, kind="charuco", dictionary=dictionary, legacy=legacy)
        return
    for kind in ("circles", "asymmetric"):
        yield from (replace(board, kind=kind, columns=c, rows=r) for c, r in sizes)
    for c, r in ((-1, -1), (1, 1), (0, 0)):
        near = board.columns + c, board.rows + r
        if min(near) >= LEAST:
            yield replace(board, kind="chessboard", columns=near[0], rows=near[1])


def _dictionary_seen(image, markers: int) -> str | None:
    """The least dictionary of those markers that a photograph shows, if it shows some."""
    best, most = None, LEAST
    for name, dictionary in _dictionaries().items():
        if len(dictionary.bytesList) < markers:
            continue
        _, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(_bytes(image))
        if ids is not None and len(set(ids.ravel()[ids.ravel() < markers])) > most:
            best, most = name, len(set(ids.ravel()[ids.ravel() < markers]))
    return best


KINDS = {
    "chessboard": (_draw_chessboard, _find_chessboard),
    "charuco": (_draw_charuco, _find_charuco),
    "circles": (_draw_circles, _find_circles),
    "asymmetric": (_draw_circles, _find_circles),
}
