"""Checkers of chapter 2: the virtual system."""

import numpy as np

from fpputil.exercises import close, exercise
from fpputil.optics import shapes
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import System, from_blender, preset


@exercise("2.1", "Millimetres of focal length over millimetres a pixel, along the same side.")
def focal_length(answer):
    return close(answer, 12 * 640 / 6.4)


@exercise("2.2", "f x'/z' + c_u and f y'/z' + c_v; pixel centres lie at integers, v grows down.")
def pixel(answer):
    return close(answer, preset("paper").system.camera.project([20.0, -10.0, 660.0]), 0.05, 0)


@exercise("2.3", "A Blender camera looks along its own -z; degrees; x turns first, then z.")
def viewing_direction(answer):
    return close(answer, from_blender((-0.15, 0.045, 0), (90, 0, 95))[0][2], 1e-3)


@exercise("2.4", "In the plan the axis runs 45 mm sideways over the distance 45 / tan(10 degrees).")
def crossing(answer):
    camera, _ = from_blender((0, 0, 0), (90, 0, 90))
    R, centre = from_blender((-0.15, 0.045, 0), (90, 0, 100))
    (x, _, z), (dx, _, dz) = camera @ centre, camera @ R[2]
    return close(answer, z - x / dx * dz)


@exercise("2.5", "White reads 255 at 400 mm; light falls with the square of the distance.")
def grey_level(answer):
    camera = preset("tiny").system.camera
    wall = raycast(shapes.plane(500.0), System(camera, camera, 1.0, 1000.0), albedo=0.6)
    return close(answer, wall.plain(quantise=False)[59:61, 79:81].mean(), rtol=2e-3)


@exercise("2.6", "f x/(-z) + c_u and f y/z + c_v: ahead is -z, and y points up while rows go down.")
def pixel_of_the_lamp(answer):
    projector = preset("paper").system.projector
    ray = np.array([0.1, 0.05, -1.0]) * (1, -1, -1)
    return close(answer, projector.project(projector.centre + 1000 * ray @ projector.R), 0.05, 0)
