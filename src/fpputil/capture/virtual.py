"""Photographs of a view under all patterns of a set, one by one (chapter 12)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from fpputil.capture.files.names import Shot
from fpputil.capture.patterns import NAME, Patterns
from fpputil.capture.photographs import write_photograph
from fpputil.checks import seeded
from fpputil.files import write_arrays
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import System
from fpputil.optics.view import View


def photograph(
    view: View, patterns: Patterns, system: System, seed: int = 0, response: float = 1.0, **camera
) -> Iterator[tuple[Shot, np.ndarray]]:
    """Photograph a view under each pattern, in the order of time. Chapter 12.

    Parameters
    ----------
    view, patterns, system
        What is seen, what is projected, and the `System` with which the view was made.
    seed : int
        Of the noise.
    response : float
        Power to which the projector raises the light.
    **camera
        noise, gain, ambient, gamma, saturation as of `View.frames`.

    Yields
    ------
    Shot, (H, W) uint8 array
    """
    (width, height), projector = patterns.projector, system.projector
    if (width, height) != (projector.width, projector.height):
        raise ValueError(
            f"patterns for a projector of {width} x {height} given; the system has one of "
            f"{projector.width} x {projector.height}"
        )
    shots = patterns.shots()
    seeds = seeded(seed).integers(2**31, size=len(shots)).tolist()
    for shot, drawn in zip(shots, seeds, strict=True):
        if shot.fringe < 0:
            yield shot, (view.dark if shot.step else view.plain)(**camera, seed=drawn)
            continue
        fringe = patterns.fringes[shot.fringe]
        if isinstance(fringe, Fringe):
            fringe = replace(fringe, gamma=response / patterns.gamma, levels=256)
        yield shot, view.frames(fringe, steps=[patterns.shown(shot)], seed=drawn, **camera)[0]


def photograph_into(
    folder: str | Path,
    view: View,
    patterns: Patterns,
    system: System,
    seed: int = 0,
    response: float = 1.0,
    **camera,
) -> None:
    """`photograph` into a folder, which is made, with the pattern file beside. Chapter 12.

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
    number = Counter(shot.file for shot in patterns.shots())
    stacks: dict[str, list[np.ndarray]] = {}
    for shot, frame in photograph(view, patterns, system, seed, response, **camera):
        stacks.setdefault(shot.file, []).append(frame)
        if len(frames := stacks[shot.file]) == number[shot.file]:
            (folder / shot.file).parent.mkdir(parents=True, exist_ok=True)
            write_photograph(folder / shot.file, np.stack(frames) if len(frames) > 1 else frame)
            del stacks[shot.file]
    patterns.save(folder / NAME)


def save_truth(path: str | Path, view: View) -> None:
    """Write column, row, depth and mask of a view as NPZ, whole or not at all."""
    names = ("column", "row", "depth", "mask")
    write_arrays(path, {name: getattr(view, name) for name in names})
