"""What is projected, in which order, and how its photographs are named (chapter 12).

A `Patterns` is written as ``patterns.toml`` beside the pictures for the projector; the photographs
go into a folder under the same names, and the same file tells how to decode them.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fpputil.checks import whole
from fpputil.files import write_whole
from fpputil.optics.fringes import WHITE, Fringe

NAME = "patterns.toml"
UNWRAP = ("mf", "mw", "nt", "minimum")
ORDERS = ("fringe", "step")
LARGEST = 2**15
"""Of a projector's sides and of the steps of a fringe: more is a slip of the hand."""

FIELD = re.compile(r"\{(axis|pitch|step|number)(?::(0?[1-9]))?\}")
KEYS = ("projector", "unwrap", "shift", "order", "files", "first", "white", "black", "fringes")


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

    Raises
    ------
    ValueError
        If an entry is not as above.
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

    def __post_init__(self):
        for name in ("projector", "fringes"):
            value = getattr(self, name)
            object.__setattr__(self, name, tuple(value) if isinstance(value, list) else value)
        _check(self)

    @property
    def axes(self) -> list[str]:
        """Axes in the order of their first fringe."""
        return list(dict.fromkeys(f.axis for f in self.fringes))

    def width(self, axis: str) -> int:
        """Projector pixels along an axis: columns or rows."""
        return self.projector[0 if axis == "column" else 1]

    def shots(self, folder_names: Sequence[str] | None = None) -> list[Shot]:
        """All photographs in the order of time, plain light first.

        Parameters
        ----------
        folder_names : sequence of str, optional
            Names in the folder; needed if `files` has a ``*``.
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
        value = np.rint(fringe.intensity(line, step)).astype(np.uint8)
        along = value[None, :] if fringe.axis == "column" else value[:, None]
        return np.ascontiguousarray(np.broadcast_to(along, (height, width)))

    def save(self, path: str | Path) -> None:
        """Write as TOML, whole or not at all."""
        write_whole(path, _toml(self).encode())

    @classmethod
    def load(cls, path: str | Path) -> Patterns:
        """Read what `save` or a hand wrote; ValueError that names the file if it is not whole."""
        path = Path(path)
        if not path.is_file():
            raise FileNotFoundError(f"{path} given; there is no such pattern file")
        try:
            return _from_dict(tomllib.loads(path.read_text()))
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
            raise ValueError(f"{path}: {error}") from error

    def _name(self, k: int, n: int, number: int) -> str:
        fringe, step = self.fringes[k], n + self.first
        values = {"axis": fringe.axis, "pitch": fringe.pitch, "step": step, "number": number}

        def shown(match):
            value, digits = values[match[1]], match[2] or "0"
            if isinstance(value, str):
                return value
            return f"{value:{digits}g}" if match[1] == "pitch" else f"{value:{digits}d}"

        return FIELD.sub(shown, self.files)

    def _matching(self, names: Sequence[str], plain: list[Shot], needed: int):
        """Photographs in plain light, and the names of all others in natural order.

        Plain ones that do not go by their own names are the first of all.
        """
        own = {shot.file for shot in plain}
        found = sorted((n for n in names if fnmatchcase(n, self.files)), key=natural)
        if own & set(names):
            found = [n for n in found if n not in own]
        elif len(found) == needed + len(plain):
            first, found = found[: len(plain)], found[len(plain) :]
            plain = [shot._replace(file=n) for shot, n in zip(plain, first, strict=True)]
        if len(found) != needed:
            each = " + ".join(str(f.steps) for f in self.fringes)
            raise ValueError(
                f"{len(found)} files match {self.files!r}; the fringes have {each} = {needed} "
                f"steps, before which {len(plain)} photographs in plain light may stand (white and "
                "black in the pattern file)"
            )
        return plain, found


def natural(name: str) -> list:
    """Key that sorts step-2 before step-10."""
    return [(int(p), p) if p.isdecimal() else (0, p) for p in re.split(r"([0-9]+)", name)]


def _check(p: Patterns) -> None:
    if not isinstance(p.projector, tuple) or len(p.projector) != 2:
        raise ValueError(f"projector {p.projector!r} given; its width and height are needed")
    for name, side in zip(("width", "height"), p.projector, strict=True):
        if whole(f"projector {name}", side, 1) > LARGEST:
            raise ValueError(f"projector {name} {side} given; {LARGEST} pixels at most are taken")
    if not isinstance(p.fringes, tuple) or not all(isinstance(f, Fringe) for f in p.fringes):
        raise ValueError(f"fringes {p.fringes!r} given; a tuple of Fringe is needed")
    if not p.fringes:
        raise ValueError("no fringe given; at least one is needed")
    if [f.axis for f in p.fringes] != sorted((f.axis for f in p.fringes), key=p.axes.index):
        raise ValueError("fringes of both axes mixed; those of one axis stand together")
    if max(f.steps for f in p.fringes) > LARGEST:
        raise ValueError(f"a fringe of more than {LARGEST} steps given")
    for name, known in (("unwrap", UNWRAP), ("order", ORDERS), ("shift", (1, -1))):
        value = getattr(p, name)
        if value not in known or isinstance(value, bool):
            raise ValueError(
                f"{name} {value!r} given; one of {', '.join(map(str, known))} is needed"
            )
    whole("first", p.first, 0)
    _check_names(p)


def _check_names(p: Patterns) -> None:
    for name in ("files", "white", "black"):
        value = getattr(p, name)
        if not isinstance(value, str) or value != Path(value).name or not value.isprintable():
            if value or name == "files":
                raise ValueError(f"{name} {value!r} given; names in the folder itself are needed")
    rest = FIELD.sub("", p.files)
    if "{" in rest or "}" in rest:
        raise ValueError(
            f"files {p.files!r} given; {{axis}}, {{pitch}}, {{step}} and {{number}} are known, "
            "with the least number of digits as in {step:02}"
        )
    if "*" in p.files:
        return
    names = [s.file for s in p.shots()]
    if len(set(names)) < len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise ValueError(
            f"files {p.files!r} given; {twice} would be several photographs: name the axis, the "
            "pitch and the step where there are several"
        )


def _toml(p: Patterns) -> str:
    lines = [f"projector = [{p.projector[0]}, {p.projector[1]}]"]
    for name in KEYS[1:-1]:
        value = getattr(p, name)
        lines.append(f"{name} = {json.dumps(value, ensure_ascii=False)}")
    for f in p.fringes:
        lines += ["", "[[fringes]]", f'axis = "{f.axis}"', f"pitch = {f.pitch!r}"]
        lines.append(f"steps = {f.steps}")
    return "\n".join(lines) + "\n"


def _from_dict(data: dict) -> Patterns:
    unknown = sorted(set(data) - set(KEYS))
    if unknown:
        raise ValueError(f"entry {unknown[0]!r} found; known are {', '.join(KEYS)}")
    for name in ("projector", "fringes"):
        if not isinstance(data.get(name), list):
            raise ValueError(f"no list {name!r} found; projector and [[fringes]] are needed")
    return Patterns(**{**data, "fringes": tuple(_fringe(f) for f in data["fringes"])})


def _fringe(entry) -> Fringe:
    known = ("axis", "pitch", "steps")
    if not isinstance(entry, dict) or not {"pitch", "steps"} <= set(entry) <= set(known):
        raise ValueError(f"fringe {entry!r} found; pitch and steps are needed, axis may be given")
    return Fringe(**entry)
