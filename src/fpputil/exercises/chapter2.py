"""Exercises of chapter 2: the virtual system."""

import numpy as np

from fpputil.exercises import exercise
from fpputil.optics import shapes
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import System, from_blender, preset


@exercise(
    "2.1",
    "how wide is one pixel, and how many of them is the focal length?",
    "the focal length in pixels, 12 / (6.4 / 640), times width over distance.",
    unit="pixels",
)
def width_of_a_picture():
    return 12 / (6.4 / 640) * 3 / 500


@exercise(
    "2.2",
    "y points down, and so does v; the principal point is ((W - 1)/2, (H - 1)/2).",
    "u = f x / z + c_u and v = f y / z + c_v.",
    unit="px",
)
def pixel():
    return preset("paper").system.camera.project([20.0, -10.0, 660.0])


@exercise(
    "2.3",
    "turn (0, 0, -1) about x first, then about z; the angles are degrees.",
    "(-sin 95, cos 95, 0), in degrees.",
)
def viewing_direction():
    return from_blender((-0.15, 0.045, 0), (90, 0, 95))[0][2]


@exercise(
    "2.4",
    "draw the plan: the projector stands 45 mm to the right and 150 mm forward.",
    "its axis runs 45 mm sideways while it goes 45 / tan(10 degrees) forward; add the 150 mm.",
    unit="mm",
)
def crossing():
    camera, _ = from_blender((0, 0, 0), (90, 0, 90))
    R, centre = from_blender((-0.15, 0.045, 0), (90, 0, 100))
    (x, _, z), (dx, _, dz) = camera @ centre, camera @ R[2]
    return z - x / dx * dz


@exercise(
    "2.5",
    "white paper reads 255 at 400 mm; light falls with the square of the distance.",
    "255 * albedo * (400 / distance)^2.",
    unit="grey levels",
)
def grey_level():
    camera = preset("tiny").system.camera
    wall = raycast(shapes.plane(500.0), System(camera, camera, 1.0, 1000.0), albedo=0.6)
    return wall.plain(quantise=False)[59:61, 79:81].mean()


@exercise(
    "2.6",
    "ahead is -z; y points up, while rows are counted downwards.",
    "u = f x / (-z) + c_u and v = f y / z + c_v.",
    unit="px",
)
def pixel_of_the_lamp():
    projector = preset("paper").system.projector
    ray = np.array([0.1, 0.05, -1.0]) * (1, -1, -1)
    return projector.project(projector.centre + 1000 * ray @ projector.R)
