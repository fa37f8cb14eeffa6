"""Which way the projector's columns and rows run in the picture, and what a system says (ch. 12).

How a projector hangs beside a camera, upright, on its head, on its side, is seen in the local
frequencies of the fringes; a mirror in camera or projector in both axes together.
"""

from __future__ import annotations

import cv2
import numpy as np

from fpputil.capture.measurement import Measurement
from fpputil.optics.system import System

SMOOTH = (9, 9)  # pixels, over which the local frequency is averaged
PLACES = 9  # across and down, at which a system is asked
AXES = ("column", "row")


def local_gradients(m: Measurement) -> np.ndarray:
    """Median change of each wrapped phase a pixel along u and v, radians, (P, 2).

    Above pi a pixel it wraps, and tells nothing.
    """
    lit, medians = m.lit, np.full((len(m.wrapped), 2), np.nan)
    for k, phi in enumerate(m.wrapped if lit.any() else ()):
        phasor = np.exp(1j * phi)
        for n, along in enumerate((1, 0)):
            turn = np.roll(phasor, -1, along) * phasor.conj() * (lit & np.roll(lit, -1, along))
            parts = turn.view(np.float32).reshape(*lit.shape, 2)
            smooth = cv2.boxFilter(parts, -1, SMOOTH).view(np.complex64)[..., 0]
            medians[k, n] = np.median(np.angle(smooth[lit]))
    return medians


def growth(m: Measurement, gradients: np.ndarray) -> np.ndarray:
    """By how many projector pixels the coordinate grows a camera pixel along u and v, (2,).

    Of the `local_gradients` of the measurement.
    """
    pitches = np.array([f.pitch for f in m.fringes])
    return np.median(gradients * (pitches[:, None] / (2 * np.pi)), axis=0)


def growth_by(system: System) -> np.ndarray:
    """By how many pixels column and row grow a camera pixel along u and v, (2, 2).

    Medians over the picture, on a plane in the middle of the measuring range.

    >>> from fpputil.optics import preset
    >>> growth_by(preset("tiny").system).round(1) + 0
    array([[6.2, 0. ],
           [0. , 6.2]])
    """
    camera, z = system.camera, (system.z_min + system.z_max) / 2
    u, v = (np.linspace(0, n - 2, PLACES) for n in (camera.width, camera.height))
    pixels = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    ends = np.stack([pixels, pixels + (1, 0), pixels + (0, 1)])
    lit = system.projector.project(camera.centre + z * camera.rays(ends))
    known = np.isfinite(lit).all(axis=(0, 2))
    if not known.any():
        return np.full((2, 2), np.nan)
    return np.median(lit[1:, known] - lit[0, known], axis=1).T


def heading(axis: str, grown: np.ndarray, system: System | None = None) -> np.ndarray | None:
    """Unit vector (u, v) along which columns or rows should grow in the picture.

    By the system; without one, of an upright projector. None for one that lies on its side, as its
    `growth` (2,) shows: nobody can say which way is up.
    """
    k = AXES.index(axis)
    if system is not None:
        towards = growth_by(system)[k]
        return towards / np.linalg.norm(towards)
    along = int(np.argmax(np.abs(grown)))
    return np.eye(2)[along] if along == k else None


def sense(turn: np.ndarray) -> float:
    """Positive if column and row grow, (2, 2), as in an upright picture, however turned.

    Negative in a mirror; NaN where nothing is known.
    """
    (a, b), (c, d) = turn
    return float(a * d - b * c)


def way(towards) -> str:
    """A direction (u, v) in the picture, in words."""
    across, down = towards
    if abs(across) > abs(down):
        return "from left to right" if across > 0 else "from right to left"
    return "downwards" if down > 0 else "upwards"


def writing(system: System) -> str:
    """How a photograph shows writing that the projector of a system projects, in words."""
    turn = growth_by(system)
    text = {"from left to right": "stands upright", "from right to left": "stands on its head"}
    mirrored = sense(turn) < 0
    told = text.get(way(turn[0]), "stands on its side")
    return f"{told} and is mirrored" if mirrored else told
