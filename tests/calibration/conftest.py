"""A board photographed without a renderer: plane, pinholes and a picture, at each pixel."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from fpputil.calibration.zhang import Pose

FINE = 3  # samples across a pixel
INK = 24  # pixels of the picture across a square: few, so that its edges are smooth


@pytest.fixture(scope="session")
def photograph():
    """Photograph a board, at R and t of its picture's middle, by a system without distortion."""

    def shoot(board, system, R, t, name="", shade=True):
        camera, projector = system.camera, system.projector
        steps = (np.arange(FINE) + 0.5) / FINE - 0.5
        pixels = camera.grid()[:, None, :, None] + np.stack(np.meshgrid(steps, steps), -1)[:, None]
        points = _on_plane(camera, pixels.reshape(-1, 2), R, t)
        light = _ink(board, (points - t) @ R) * (_falloff(projector, points) if shade else 1)
        shape = camera.height, FINE, camera.width, FINE
        plain = 110 * light.reshape(shape).mean(axis=(1, 3))
        lit = projector.project(_on_plane(camera, camera.grid().reshape(-1, 2), R, t))
        lit[~projector.inside(lit)] = np.nan
        column, row = lit.reshape(camera.height, camera.width, 2).transpose(2, 0, 1)
        return Pose(np.rint(plain).astype(np.uint8), column, row, name)

    return shoot


def _on_plane(camera, pixels, R, t):
    rays = camera.rays(pixels)
    return camera.centre + rays * ((R[:, 2] @ (t - camera.centre)) / (rays @ R[:, 2]))[:, None]


def _falloff(projector, points):
    return (500 / np.linalg.norm(points - projector.centre, axis=1)) ** 2


def _ink(board, local):
    """Albedo at points (P, 3) in the frame of the picture's middle; the wall behind is grey."""
    picture = board.picture(INK)
    scale = INK / board.square
    place = [local[:, k] * scale + (picture.shape[1 - k] - 1) / 2 for k in (1, 0)]
    return 0.05 + 0.9 / 255 * map_coordinates(np.float32(picture), place, order=1, cval=100)
