"""What is projected, in which order, and how its photographs are named (chapter 12).

A `Patterns` is written as ``patterns.toml`` beside the pictures for the projector; the photographs
go into a folder under the same names, and the same file tells how to decode them.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from math import prod
from numbers import Integral, Real
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fpputil.checks import at_most
from fpputil.decoding.unwrap import TEMPORAL
from fpputil.files import write_whole
from fpputil.optics.fringes import WHITE, Fringe

NAME = "patterns.toml"
UNWRAP = (*TEMPORAL, "minimum")
ORDERS = ("fringe", "step")
LARGEST = 2**15  # of a projector's sides: more is a slip of the hand
FORMATS = {"axis": "s", "pitch": "g", "step": "d", "number": "d"}
FIELD = re.compile(r"\{(axis|pitch|step|number)(?::(0?[1-9]))?\}")
KEYS = (
    *("projector", "unwrap", "shift", "order", "files", "first", "white", "black", "gamma"),
    "fringes",
)
FRINGE = ("axis", "pitch", "steps")


class Shot(NamedTuple):
    """A photograph: the number of its fringe (-1 for plain light), its step, and its file."""

    fringe: int
    step: int
    file: str


@dataclass(frozen=True)
class Patterns:
    """Fringes to be projected one after the other, and the names of their photographs.

    Parameters
    ----------
    projector : (width, height)
        Pixels.
    fringes : tuple of Fringe
        Those of one axis together, in the order in which unwrapping takes them.
    unwrap : {"mf", "mw", "nt", "minimum"}
        Multi-frequency (pitches descending, the first covers the projector), multi-wavelength
        (ascending, their last beat covers it), number-theoretical (two whole pitches), or
        minimum phase (descending, vertical fringes, and a calibrated system; chapter 5).
    shift : {1, -1}
        Step n is shifted by ``shift 2 pi n / steps``.
    order : {"fringe", "step"}
        Order in time: all steps of a fringe after one another, or each step of all fringes.
    files : str
        Names of the photographs with ``{axis}``, ``{pitch}``, ``{step}`` and ``{number}``, which
        counts all photographs from 0 in the order of time, and ``{step:02}`` for two digits at
        least; or with ``*``: these files, in natural order, are the order in time, first white
        and black if they do not go by names of their own.
    first : int
        Number of the first step in the names.
    white, black : str
        Names of the photographs in plain light and in none; "" if there is none.
    gamma : float
        Exponent of the projector for which the pictures are corrected, so that its light is a
        sinusoid; 1 for none.

    Raises
    ------
    ValueError
        If an entry is not as above.

    Examples
    --------
    >>> from fpputil.optics import fringe_set
    >>> patterns = Patterns((912, 1140), fringe_set((912, 114, 18), 8))
    >>> shots = patterns.shots()
    >>> len(shots), shots[-1].file, patterns.picture(shots[-1]).shape
    (24, 'column-18-07.png', (1140, 912))
    """

    projector: tuple[int, int]
    fringes: tuple[Fringe, ...]
    unwrap: str = "mf"
    shift: int = 1
    order: str = "fringe"
    files: str = "{axis}-{pitch}-{step:02}.png"
    first: int = 0
    white: str = ""
    black: str = ""
    gamma: float = 1.0

    def __post_init__(self):
        for name in ("projector", "fringes"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        for name, (fits, needed) in NEEDED.items():
            if not fits(value := getattr(self, name)):
                raise ValueError(f"{name} {value!r} given; {needed}")
        at_most("pixels of the projector", prod(self.projector), "FPP_MOST_PIXELS")
        at_most("photographs", sum(f.steps for f in self.fringes), "FPP_MOST_PHOTOGRAPHS")
        axes = [self.axes.index(f.axis) for f in self.fringes]
        if axes != sorted(axes):
            raise ValueError("fringes of both axes mixed; those of one axis stand together")
        plain = FIELD.sub("", self.files)
        if "{" in plain or "}" in plain:
            raise ValueError(
                f"files {self.files!r} given; {{axis}}, {{pitch}}, {{step}} and {{number}} are "
                "known, with the least number of digits as in {step:02}"
            )
        names = [] if "*" in self.files else [shot.file for shot in self.shots()]
        if twice := [name for name, number in Counter(names).items() if number > 1]:
            raise ValueError(
                f"files {self.files!r} given; {twice[0]} would be several photographs: name the "
                "axis, the pitch and the step where there are several"
            )

    @property
    def axes(self) -> list[str]:
        """Axes in the order of their first fringe."""
        return list(dict.fromkeys(f.axis for f in self.fringes))

    def along(self, axis: str) -> dict[int, Fringe]:
        """Fringes of an axis by their number; ValueError if there are none."""
        if axis not in self.axes:
            raise ValueError(f"axis {axis!r} given; the patterns have {', '.join(self.axes)}")
        return {k: f for k, f in enumerate(self.fringes) if f.axis == axis}

    def width(self, axis: str) -> int:
        """Projector pixels along an axis: columns or rows."""
        return self.projector[0 if axis == "column" else 1]

    def shots(self, folder_names: Sequence[str] | None = None) -> list[Shot]:
        """All photographs in the order of time, plain light first.

        If `files` has a ``*``, it needs the names in the folder.
        """
        pairs = [(k, n) for k, f in enumerate(self.fringes) for n in range(f.steps)]
        if self.order == "step":
            pairs.sort(key=lambda pair: (pair[1], pair[0]))
        plain = [Shot(-1, n, file) for n, file in enumerate((self.white, self.black)) if file]
        named = [self._name(*pair, number) for number, pair in enumerate(pairs, len(plain))]
        if "*" in self.files:
            plain, named = self._matching(folder_names or (), plain, len(pairs))
        return plain + [Shot(*pair, file) for pair, file in zip(pairs, named, strict=True)]

    def picture(self, shot: Shot) -> np.ndarray:
        """What the projector shows for a photograph, (height, width) uint8."""
        width, height = self.projector
        if shot.fringe < 0:
            return np.full((height, width), 0 if shot.step else WHITE, np.uint8)
        fringe = self.fringes[shot.fringe]
        line = np.arange(self.width(fringe.axis))
        step = shot.step * self.shift % fringe.steps
        light = fringe.intensity(line, step) / WHITE
        value = np.rint(WHITE * np.clip(light, 0, 1) ** (1 / self.gamma)).astype(np.uint8)
        column = fringe.axis == "column"
        return np.tile(value, (height, 1)) if column else np.tile(value[:, None], width)

    def save(self, path: str | Path) -> None:
        """Write as TOML, whole or not at all."""

        def line(of, name):  # JSON writes numbers, strings and lists of them as TOML does
            plain = {"ensure_ascii": False, "default": lambda number: number.item()}
            return f"{name} = {json.dumps(getattr(of, name), **plain)}\n"

        names = [name for name in KEYS[:-1] if name != "gamma" or self.gamma != 1]
        text = "".join(line(self, name) for name in names)
        for fringe in self.fringes:
            text += "\n[[fringes]]\n" + "".join(line(fringe, name) for name in FRINGE)
        write_whole(path, text.encode())

    @classmethod
    def load(cls, path: str | Path) -> Patterns:
        """Read what `save` or a hand wrote; ValueError that names the file if it is not whole."""
        path = Path(path)
        if not path.is_file():
            raise FileNotFoundError(f"{path} given; there is no such pattern file")
        try:
            entries = tomllib.loads(path.read_text(encoding="utf-8"))
            if unknown := sorted(set(entries) - set(KEYS)):
                raise ValueError(f"entry {unknown[0]!r} found; known are {', '.join(KEYS)}")
            for name in ("projector", "fringes"):
                if not isinstance(entries.get(name), list):
                    raise ValueError(
                        f"no list {name!r} found; projector and [[fringes]] are needed"
                    )
            return cls(**{**entries, "fringes": [_fringe(f) for f in entries["fringes"]]})
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
            raise ValueError(f"{path}: {error}") from error

    def _name(self, k: int, n: int, number: int) -> str:
        fringe, step = self.fringes[k], n + self.first
        values = {"axis": fringe.axis, "pitch": fringe.pitch, "step": step, "number": number}
        return FIELD.sub(lambda m: format(values[m[1]], (m[2] or "") + FORMATS[m[1]]), self.files)

    def _matching(self, names: Sequence[str], plain: list[Shot], needed: int):
        """Photographs in plain light, by name or the first of all, and names of the others."""
        plain_names = {shot.file for shot in plain}
        matching = sorted((n for n in names if fnmatchcase(n, self.files)), key=natural)
        if plain_names & set(names):
            matching = [n for n in matching if n not in plain_names]
        elif len(matching) == needed + len(plain):
            first, matching = matching[: len(plain)], matching[len(plain) :]
            plain = [shot._replace(file=n) for shot, n in zip(plain, first, strict=True)]
        if len(matching) != needed:
            each = " + ".join(str(f.steps) for f in self.fringes)
            raise ValueError(
                f"{len(matching)} files match {self.files!r}; the fringes have {each} = {needed} "
                f"steps, before which {len(plain)} photographs in plain light may stand (white and "
                "black in the pattern file)"
            )
        return plain, matching


def natural(name: str) -> list:
    """Key that sorts step-2 before step-10."""
    return [(int(p), p) if p.isdecimal() else (0, p) for p in re.split(r"([0-9]+)", name)]


def _is_whole(value, least: int, most: float = float("inf")) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and least <= value <= most


def _is_name(value) -> bool:
    return isinstance(value, str) and value == Path(value).name != "" and value.isprintable()


NEEDED = {
    "projector": (
        lambda v: len(v) == 2 and all(_is_whole(n, 1, LARGEST) for n in v),
        f"width and height, 1 to {LARGEST} pixels each, are needed",
    ),
    "fringes": (
        lambda v: v and all(isinstance(f, Fringe) for f in v),
        "one Fringe or more is needed",
    ),
    "unwrap": (lambda v: v in UNWRAP, f"one of {', '.join(UNWRAP)} is needed"),
    "shift": (lambda v: _is_whole(v, -1, 1) and v != 0, "one of 1, -1 is needed"),
    "order": (lambda v: v in ORDERS, f"one of {', '.join(ORDERS)} is needed"),
    "first": (lambda v: _is_whole(v, 0), "a whole number of 0 or more is needed"),
    "files": (_is_name, "names in the folder itself are needed"),
    "white": (lambda v: v == "" or _is_name(v), "a name in the folder itself, or none, is needed"),
    "black": (lambda v: v == "" or _is_name(v), "a name in the folder itself, or none, is needed"),
    "gamma": (
        lambda v: isinstance(v, Real) and not isinstance(v, bool) and 0.1 <= v <= 10,
        "a number from 0.1 to 10 is needed",
    ),
}
"""Of each entry of `Patterns` what it must be, and how that is said."""


def _fringe(entry) -> Fringe:
    if not isinstance(entry, dict) or not {"pitch", "steps"} <= set(entry) <= set(FRINGE):
        raise ValueError(f"fringe {entry!r} found; pitch and steps are needed, axis may be given")
    return Fringe(**entry)
