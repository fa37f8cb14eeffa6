"""Photographs of a view under all patterns of a set, one by one (chapter 12)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from fpputil.capture.patterns import NAME, Patterns, Shot
from fpputil.checks import seeded, whole
from fpputil.files import write_arrays, write_whole
from fpputil.optics.system import System
from fpputil.optics.view import View

LEVELS = 256  # of the pictures that `Patterns` gives to the projector


def photograph(
    view: View, patterns: Patterns, system: System, seed: int = 0, response: float = 1.0, **camera
) -> Iterator[tuple[Shot, np.ndarray]]:
    """Photograph a view under each pattern, in the order of time. Chapter 12.

    Parameters
    ----------
    view : View
    patterns : Patterns
    system : System
        With which the view was made.
    seed : int
        Of the noise.
    response : float
        Power to which the projector raises the light.
    **camera
        noise, gain, ambient, gamma, saturation as of `View.frames`.

    Yields
    ------
    Shot, (H, W) uint8 array

    Raises
    ------
    ValueError
        If the patterns are for another projector, or an option is out of range.
    """
    projector = (system.projector.width, system.projector.height)
    if patterns.projector != projector:
        raise ValueError(
            f"patterns for a projector of {_by(patterns.projector)} given; the system has one "
            f"of {_by(projector)}"
        )
    shots = patterns.shots()
    seeds = seeded(whole("seed", seed, 0)).integers(2**31, size=len(shots))
    for shot, own in zip(shots, seeds.tolist(), strict=True):
        if shot.fringe < 0:
            yield shot, (view.dark if shot.step else view.plain)(**camera, seed=own)
            continue
        fringe = replace(patterns.fringes[shot.fringe], gamma=response, levels=LEVELS)
        step = shot.step * patterns.shift % fringe.steps
        yield shot, view.frames(fringe, steps=[step], seed=own, **camera)[0]


def photograph_into(
    folder: str | Path,
    view: View,
    patterns: Patterns,
    system: System,
    seed: int = 0,
    response: float = 1.0,
    **camera,
) -> None:
    """Photograph a view into a folder, with its pattern file beside. Chapter 12.

    Parameters
    ----------
    folder : path
        There, or its parent is.

    Other parameters and errors are those of `photograph`.

    Examples
    --------
    >>> import tempfile
    >>> from fpputil.optics import fringe_set, preset, raycast, shapes
    >>> system = preset("tiny").system
    >>> view = raycast(shapes.sphere(100, [0, 0, 660]), system)
    >>> with tempfile.TemporaryDirectory() as room:
    ...     photograph_into(room, view, Patterns((912, 1140), fringe_set(24, 3)), system)
    ...     sorted(path.name for path in Path(room).iterdir())[:2]
    ['column-24-00.png', 'column-24-01.png']
    """
    folder = Path(folder)
    folder.mkdir(exist_ok=True)
    for shot, frame in photograph(view, patterns, system, seed, response, **camera):
        done, data = cv2.imencode(Path(shot.file).suffix, frame)
        write_whole(folder / shot.file, data.tobytes())
    patterns.save(folder / NAME)


def save_truth(path: str | Path, view: View) -> None:
    """Write column, row, depth and mask of a view as NPZ, whole or not at all."""
    names = ("column", "row", "depth", "mask")
    write_arrays(path, {name: getattr(view, name) for name in names})


def _by(size) -> str:
    return f"{size[0]} x {size[1]}"
