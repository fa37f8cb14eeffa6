"""Answers to the exercises of chapter 2: right ones, and typical misconceptions."""

import numpy as np

TAN10 = np.tan(np.radians(10))

RIGHT = {
    "2.1": 7.2,
    "2.2": (351.8, 223.3),
    "2.3": (-0.9962, -0.08716, 0),
    "2.4": 405.2,
    "2.5": 97.92,
    "2.6": (583.2, 505.7),
}

WRONG = [
    ("2.1", 12 / 6.4 * 480 * 3 / 500, "rows for columns"),
    ("2.1", 6.4 / 12 * 640 * 3 / 500, "upside down"),
    ("2.1", 12 * 3 / 500, "millimetres on the sensor"),
    ("2.1", 1066.667 * 3 / 500, "the sensor of the preset"),
    ("2.2", (351.823, 255.662), "y upwards"),
    ("2.2", (352.323, 223.838), "pixel centres at halves"),
    ("2.2", (32.323, -16.162), "principal point forgotten"),
    ("2.2", (223.338, 351.823), "row first"),
    ("2.3", (0.9962, 0.0872, 0), "looking along +z"),
    ("2.3", (-1, 0, 0), "the camera's direction"),
    ("2.3", (-np.sin(95), np.cos(95), 0), "degrees taken as radians"),
    ("2.4", 45 / TAN10, "measured from the projector"),
    ("2.4", 150 + 45 * TAN10, "tangent upside down"),
    ("2.4", 150 + 45 / np.tan(10), "degrees taken as radians"),
    ("2.4", 150 + 45 / np.sin(np.radians(10)), "along the axis, not forward"),
    ("2.5", 255 * 0.6 * 400 / 500, "distance not squared"),
    ("2.5", 255 * (400 / 500) ** 2, "albedo forgotten"),
    ("2.5", 255 * 0.6 * (500 / 400) ** 2, "ratio upside down"),
    ("2.6", (327.82, 633.34), "turned by 180 degrees"),
    ("2.6", (583.18, 633.34), "y downwards"),
    ("2.6", (583.68, 506.16), "pixel centres at halves"),
    ("2.6", (505.66, 583.18), "row first"),
    ("2.6", (127.68, -63.84), "principal point forgotten"),
]
