"""A flat picture posed in space, to be photographed for calibration (chapter 12).

The frame of a board lies in the middle of its picture: x right, y down, z away from the viewer.
A pose is R, t with ``x_world = R x_board + t``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from fpputil.checks import positive, rotation_matrix, seeded, whole
from fpputil.optics.system import System

DRAWS = 2000  # poses tried for each one that is kept
TILT = 25.0, 40.0  # degrees, between which the boards' tilts lie
ROLL = 20.0  # degrees, at most, about the board's normal
CELLS = 12  # cells across each picture, by which its coverage is counted
INK, PAPER = 0.08, 0.9  # albedo where the picture is 0 and 255
RIM = 7  # points along each edge of the target that must be in the pictures


@dataclass(frozen=True, eq=False)
class PlacedBoard:
    """A picture on a flat board at a pose.

    Parameters
    ----------
    picture : (h, w) uint8 array
        What is printed on it.
    width : float
        Of the picture, mm; the height follows.
    R, t : (3, 3) and (3,) arrays
        Rotation from the board's frame to the world, and its middle there, mm.

    Examples
    --------
    >>> picture = np.tile(np.array([0, 255], np.uint8), (30, 20))  # 40 pixels across, 30 down
    >>> PlacedBoard(picture, 200.0, np.eye(3), np.array([0.0, 0.0, 650.0])).size
    (200.0, 150.0)
    """

    picture: np.ndarray
    width: float
    R: np.ndarray
    t: np.ndarray

    def __post_init__(self):
        picture, t = np.asarray(self.picture), np.asarray(self.t)
        if picture.ndim != 2 or picture.dtype != np.uint8 or 0 in picture.shape:
            raise ValueError(
                f"picture of shape {picture.shape} and dtype {picture.dtype} given; "
                "a target takes (h, w) uint8"
            )
        positive("width", self.width, "mm")
        rotation_matrix("R", self.R)
        if t.shape != (3,) or not np.isfinite(t).all():
            raise ValueError(f"t {t.tolist()} given; a place is (3,), finite, in mm")

    @property
    def size(self) -> tuple[float, float]:
        """Width and height, mm."""
        h, w = np.shape(self.picture)
        return self.width, self.width * h / w

    @property
    def mesh(self) -> trimesh.Trimesh:
        """The board in the world: two triangles that face the viewer."""
        corners = _rectangle(self.size, 2)[[0, 1, 3, 2]]
        world = corners @ np.transpose(self.R) + self.t
        return trimesh.Trimesh(world, [(0, 2, 1), (0, 3, 2)], process=False)

    def albedo(self, points: np.ndarray) -> np.ndarray:
        """Albedo, (P,), of world points (P, 3), mm, on the board, bilinear; for `raycast`."""
        h, w = np.shape(self.picture)
        local = (np.asarray(points) - self.t) @ self.R
        x, y = local[:, 0] * (w / self.width), local[:, 1] * (w / self.width)
        place = [y + (h - 1) / 2, x + (w - 1) / 2]
        ink = map_coordinates(np.float32(self.picture), place, order=1, mode="nearest")
        return INK + (PAPER - INK) * ink / 255.0


def place_boards(
    number: int, seed: int, system: System, size: tuple[float, float]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Poses of a board that constrain a calibration: tilted strongly, every way, all over.

    The boards stand at 25 to 40 degrees to the camera's picture plane. The directions of tilt go
    round evenly, the angles and depths are spread over their ranges, and of many places the one is
    kept that covers most of what no earlier pose covered in the pictures of camera and projector.

    Parameters
    ----------
    number, seed : int
        Of poses; of the draws.
    system : System
        Camera and projector that must both see the whole board inside the measuring range.
    size : (width, height)
        What must be seen of the board, mm, around its middle.

    Returns
    -------
    list of (R, t)
        As `PlacedBoard` takes them.

    Raises
    ------
    ValueError
        If a number is out of range or no place is found where the board is seen whole.

    Examples
    --------
    >>> from fpputil.optics.system import preset
    >>> poses = place_boards(2, 0, preset("tiny").system, (270.0, 180.0))
    >>> R, t = poses[0]
    >>> len(poses), R.shape, t.shape
    (2, (3, 3), (3,))
    """
    whole("number", number, 1)
    for name, value in zip(("width", "height"), size, strict=True):
        positive(name, value, "mm")
    rng = seeded(seed)
    start = rng.uniform(0, 2 * np.pi)
    covered, poses = np.zeros((2, CELLS, CELLS), int), []
    for k, share in enumerate(rng.permutation(number)):
        towards = start + 2 * np.pi * k / number
        angle = np.radians(TILT[0] + (TILT[1] - TILT[0]) * (share + 0.5) / number)
        pose, cells = _best(_draw(rng, system, towards, angle), system, size, covered)
        covered = covered + cells
        poses.append(pose)
    return poses


def _draw(rng, system, towards, angle):
    """DRAWS poses with one tilt, anywhere in view and range: R (D, 3, 3) and t (D, 3)."""
    camera = system.camera
    tilt = Rotation.from_rotvec(angle * np.array([np.cos(towards), np.sin(towards), 0]))
    roll = Rotation.from_euler("z", rng.uniform(-ROLL, ROLL, (DRAWS, 1)), degrees=True)
    pixels = rng.uniform((0, 0), (camera.width - 1, camera.height - 1), (DRAWS, 2))
    depth = rng.uniform(system.z_min, system.z_max, (DRAWS, 1))
    return camera.R.T @ (tilt * roll).as_matrix(), camera.centre + depth * camera.rays(pixels)


def _best(drawn, system, size, covered):
    """The drawn pose that is seen whole and covers most new ground, and its cells."""
    R, t = drawn
    points = np.einsum("dij,pj->dpi", R, _rectangle(size, RIM)) + t[:, None]
    R, t, points = (a[_within(points, system)] for a in (R, t, points))
    if not len(R):
        raise ValueError(
            f"a board of {size[0]:g} x {size[1]:g} mm given; in {DRAWS} places none was found "
            "where camera and projector see all of it inside the measuring range; "
            "take a smaller board"
        )
    cells = np.stack([_cells(p, points) for p in (system.camera, system.projector)], 1)
    best = np.sum(cells / (1 + covered) ** 2, axis=(1, 2, 3)).argmax()
    return (R[best], t[best]), cells[best]


def _within(points, system):
    """True, (D,), where all of (D, P, 3) points are in range and in both pictures."""
    depth = points @ system.camera.R[2] + system.camera.t[2]
    good = ((depth >= system.z_min) & (depth <= system.z_max)).all(axis=1)
    for pinhole in (system.camera, system.projector):
        good[good] = pinhole.inside(pinhole.project(points[good])).all(axis=1)
    return good


def _cells(pinhole, points):
    """Cells of a picture, (D, CELLS, CELLS), that (D, P, 3) points reach."""
    place = (pinhole.project(points) + 0.5) / (pinhole.width, pinhole.height)
    u, v = np.moveaxis((place * CELLS).astype(int), -1, 0)
    cells = np.zeros((len(points), CELLS, CELLS), bool)
    cells[np.arange(len(points))[:, None], v, u] = True
    return cells


def _rectangle(size, number):
    """Grid of points over a rectangle around the origin, (number * number, 3), row by row."""
    x, y = (np.linspace(-s / 2, s / 2, number) for s in size)
    return np.stack([*np.meshgrid(x, y), np.zeros((number, number))], -1).reshape(-1, 3)
