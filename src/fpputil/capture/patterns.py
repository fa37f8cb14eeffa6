"""What is projected, in which order, and how its photographs are named (chapter 12).

A `Patterns` is written as ``patterns.toml`` beside the pictures for the projector; the photographs
go into a folder under the same names, and the same file tells how to decode them.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np

from fpputil.capture.files.names import Shot, all_names, check_names, per_fringe, shots_of
from fpputil.checks import at_most, finite, positive
from fpputil.decoding.unwrap import TEMPORAL
from fpputil.files import write_whole
from fpputil.optics.fringes import WHITE, Fringe
from fpputil.optics.graycode import GrayCode

NAME = "patterns.toml"
UNWRAP = (*TEMPORAL, "minimum", "gray", "spatial")
ORDERS = ("fringe", "step")
LARGEST = 2**15  # of a projector's sides: more is a slip of the hand
KEYS = (
    *("projector", "unwrap", "shift", "order", "files", "first", "white", "black", "gamma"),
    "fringes",
)
SAVED = ("axis", "pitch", "steps")
CODE = ("axis", "cell", "bits", "shift", "inverse")
FRINGE = ("axis", "pitch", "periods", "steps", "start")
STARTS = {"cosine": 0.0, "sine": -90.0, "black": 180.0}  # degrees, of the first step at column 0


@dataclass(frozen=True)
class Patterns:
    """Fringes to be projected one after the other, and the names of their photographs.

    Parameters
    ----------
    projector : (width, height)
        Pixels; () if it is not known, which spatial unwrapping does not mind.
    fringes : tuple of Fringe, and of GrayCode
        Those of one axis together, in the order of their photographs.
    unwrap : {"mf", "mw", "nt", "minimum", "gray", "spatial"}
        Multi-frequency (the longest pitch covers the projector), multi-wavelength (a beat covers
        it), number-theoretical (two whole pitches), minimum phase (vertical fringes, and a
        calibrated system; chapter 5), or a `GrayCode` along each axis, alone or of the longest
        pitch; or none but from pixel to pixel (one pitch, spatial).
    shift : {1, -1}
        Step n is shifted by ``start + shift 2 pi n / steps``.
    order : {"fringe", "step"}
        Order in time: all steps of a fringe after one another, or each step of all fringes.
    files : str, or sequence
        Names of the photographs with ``{axis}``, ``{pitch}``, ``{step}`` and ``{number}``, which
        counts all photographs from 0 in the order of time, and ``{step:02}`` for two digits at
        least (``{periods}`` are those over the projector; the pitch of a code is ``gray``); or
        with ``*``: these files, in natural order, are the order in time, first white and black if
        they do not go by names of their own. Or one such name for each fringe, as
        ``"pitch-24/*.png"`` of photographs in a folder inside, or a list of the names of its
        steps; or all names in the order of time. A TIFF or NPY file that is named for several
        photographs holds them one after the other.
    first : int, or tuple of int
        Number of the first step in the names; of all fringes, or of each.
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
    first: int | tuple[int, ...] = 0
    white: str = ""
    black: str = ""
    gamma: float = 1.0

    def __post_init__(self):
        for name in ("projector", "fringes"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if isinstance(self.first, list | tuple):
            each = tuple(self.first) if len(self.first) != 1 else self.first[0]
            object.__setattr__(self, "first", each)
            if isinstance(each, tuple) and len(each) != len(self.fringes):
                raise ValueError(
                    f"first {list(each)} given; one number, or one of each of the "
                    f"{len(self.fringes)} fringes is needed"
                )
        for name, (fits, needed) in NEEDED.items():
            if not fits(value := getattr(self, name)):
                raise ValueError(f"{name} {value!r} given; {needed}")
        if not self.projector and self.unwrap != "spatial":
            raise ValueError(f"projector () given; unwrap {self.unwrap!r} needs its size")
        at_most("pixels of the projector", math.prod(self.projector), "FPP_MOST_PIXELS")
        at_most("photographs", sum(f.steps for f in self.fringes), "FPP_MOST_PHOTOGRAPHS")
        coded = [f.axis for f in self.fringes if isinstance(f, GrayCode)]
        if sorted(coded) != (sorted(self.axes) if self.unwrap == "gray" else []):
            raise ValueError(
                f"unwrap {self.unwrap!r} and Gray codes along {', '.join(coded) or 'no axis'} "
                "given; gray takes one code along each axis, the others none"
            )
        axes = [self.axes.index(f.axis) for f in self.fringes]
        if axes != sorted(axes):
            raise ValueError("fringes of both axes mixed; those of one axis stand together")
        steps = [f.steps for f in self.fringes]
        object.__setattr__(self, "files", per_fringe(self.files, steps, self.in_time()))
        check_names(self)

    @property
    def in_folders(self) -> bool:
        """Whether the photographs lie in folders inside that of the capture."""
        return any("/" in name for name in (*all_names(self.files), self.white, self.black))

    @property
    def axes(self) -> list[str]:
        """Axes in the order of their first fringe."""
        return list(dict.fromkeys(f.axis for f in self.fringes))

    def along(self, axis: str) -> dict[int, Fringe]:
        """Fringes of an axis by their number, in the order in which unwrapping takes them.

        ValueError if there are none.
        """
        if axis not in self.axes:
            raise ValueError(f"axis {axis!r} given; the patterns have {', '.join(self.axes)}")
        known = enumerate(self.fringes)
        fringes = [(k, f) for k, f in known if f.axis == axis and isinstance(f, Fringe)]
        if self.unwrap != "nt":  # which takes its two as they stand
            fringes.sort(key=lambda pair: pair[1].pitch, reverse=self.unwrap != "mw")
        return dict(fringes)

    def code(self, axis: str) -> tuple[int, GrayCode] | None:
        """The Gray code of an axis, and its number; None if there is none."""
        codes = [(k, c) for k, c in enumerate(self.fringes) if isinstance(c, GrayCode)]
        return next(((k, code) for k, code in codes if code.axis == axis), None)

    def width(self, axis: str) -> float:
        """Projector pixels along an axis, columns or rows; infinite if they are not known."""
        if not self.projector:
            return math.inf
        return self.projector[0 if axis == "column" else 1]

    def in_time(self) -> list[tuple[int, int]]:
        """Fringe and step of all photographs in the order of time."""
        pairs = [(k, n) for k, f in enumerate(self.fringes) for n in range(f.steps)]
        if self.order == "step":
            pairs.sort(key=lambda pair: (pair[1], pair[0]))
        return pairs

    def shots(self, folder_names: Sequence[str] | None = None) -> list[Shot]:
        """All photographs in the order of time, plain light first.

        If `files` has a ``*``, it needs the names in the folder.
        """
        return shots_of(self, folder_names)

    def picture(self, shot: Shot) -> np.ndarray:
        """What the projector shows for a photograph, (height, width) uint8."""
        if not self.projector:
            raise ValueError("projector () given; a picture needs its size")
        width, height = self.projector
        if shot.fringe < 0:
            return np.full((height, width), 0 if shot.step else WHITE, np.uint8)
        fringe = self.fringes[shot.fringe]
        line = np.arange(self.width(fringe.axis))
        light = fringe.intensity(line, self.shown(shot)) / WHITE
        value = np.rint(WHITE * np.clip(light, 0, 1) ** (1 / self.gamma)).astype(np.uint8)
        column = fringe.axis == "column"
        return np.tile(value, (height, 1)) if column else np.tile(value[:, None], width)

    def shown(self, shot: Shot) -> int:
        """Number of the picture of its fringe that a photograph shows."""
        fringe = self.fringes[shot.fringe]
        return shot.step if isinstance(fringe, GrayCode) else shot.step * self.shift % fringe.steps

    def save(self, path: str | Path) -> None:
        """Write as TOML, whole or not at all."""

        def line(of, name):  # JSON writes numbers, strings and lists of them as TOML does
            plain = {"ensure_ascii": False, "default": lambda number: number.item()}
            return f"{name} = {json.dumps(getattr(of, name), **plain)}\n"

        names = [name for name in KEYS[:-1] if name != "gamma" or self.gamma != 1]
        text = "".join(line(self, name) for name in names)
        for fringe in self.fringes:
            names = SAVED if isinstance(fringe, Fringe) else CODE
            text += "\n[[fringes]]\n" + "".join(line(fringe, name) for name in names)
            if fringe.start:
                text += f"start = {round(math.degrees(fringe.start), 9)!r}\n"
        write_whole(path, text.encode())

    @classmethod
    def load(cls, path: str | Path) -> Patterns:
        """Read what `save` or a hand wrote; ValueError that names the file if it is not whole."""
        path = Path(path)
        if not path.is_file():
            raise FileNotFoundError(f"{path} given; there is no such pattern file")
        try:
            entries = tomllib.loads(path.read_text(encoding="utf-8-sig"))
            if unknown := sorted(set(entries) - {*KEYS, "start"}):
                raise ValueError(f"entry {unknown[0]!r} found; known are {', '.join(KEYS)}, start")
            if entries.get("unwrap") == "spatial":
                entries.setdefault("projector", [])
            for name in ("projector", "fringes"):
                if not isinstance(entries.get(name), list):
                    raise ValueError(
                        f"no list {name!r} found; projector and [[fringes]] are needed"
                    )
            tables = [f for f in entries["fringes"] if isinstance(f, dict)]
            if files := [table.pop("files") for table in tables if "files" in table]:
                if "files" in entries or len(files) != len(entries["fringes"]):
                    raise ValueError(
                        f"files of {len(files)} of {len(entries['fringes'])} fringes found; they "
                        "stand in each of the [[fringes]], or at the top"
                    )
                entries["files"] = files
            start = entries.pop("start", "cosine")
            fringes = [_fringe(f, entries["projector"], start) for f in entries["fringes"]]
            return cls(**{**entries, "fringes": fringes})
        except (
            ValueError,
            TypeError,
            KeyError,
            IndexError,
            OverflowError,
            RecursionError,
        ) as error:
            raise ValueError(f"{path}: {error}") from error


def _is_whole(value, least: int, most: float = float("inf")) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and least <= value <= most


def _is_name(value) -> bool:
    """Whether it names a file in the folder, or in one inside it."""
    if not isinstance(value, str) or not value.isprintable():
        return False
    path = PureWindowsPath(value)  # which knows both kinds of slashes
    inside = path.name != "" and not path.anchor and ".." not in path.parts
    return inside and value == str(PurePosixPath(value))


def _are_names(value) -> bool:
    """A name, or a list of names and of lists of names."""
    if isinstance(value, str):
        return _is_name(value)
    if not isinstance(value, list | tuple) or not value:
        return False
    rows = [[row] if isinstance(row, str) else row for row in value]
    return all(isinstance(row, list | tuple) and all(map(_is_name, row)) for row in rows)


NEEDED = {
    "projector": (
        lambda v: not v or len(v) == 2 and all(_is_whole(n, 1, LARGEST) for n in v),
        f"width and height, 1 to {LARGEST} pixels each, are needed",
    ),
    "fringes": (
        lambda v: v and all(isinstance(f, Fringe | GrayCode) for f in v),
        "one Fringe or more is needed",
    ),
    "unwrap": (lambda v: v in UNWRAP, f"one of {', '.join(UNWRAP)} is needed"),
    "shift": (lambda v: _is_whole(v, -1, 1) and v != 0, "one of 1, -1 is needed"),
    "order": (lambda v: v in ORDERS, f"one of {', '.join(ORDERS)} is needed"),
    "first": (
        lambda v: all(_is_whole(n, 0) for n in (v if isinstance(v, tuple) else (v,))),
        "a whole number of 0 or more is needed",
    ),
    "files": (_are_names, "names in the folder, or in one inside it, are needed"),
    "white": (lambda v: v == "" or _is_name(v), "a name in the folder, or none, is needed"),
    "black": (lambda v: v == "" or _is_name(v), "a name in the folder, or none, is needed"),
    "gamma": (
        lambda v: isinstance(v, Real) and not isinstance(v, bool) and 0.1 <= v <= 10,
        "a number from 0.1 to 10 is needed",
    ),
}
"""Of each entry of `Patterns` what it must be, and how that is said."""


def _fringe(entry, projector, start) -> Fringe | GrayCode:
    if isinstance(entry, dict) and {"cell", "bits"} <= set(entry) <= set(CODE):
        return GrayCode(**entry)
    if not isinstance(entry, dict) or not set(entry) <= set(FRINGE) or "steps" not in entry:
        raise ValueError(f"fringe {entry!r} found; pitch and steps are needed, axis may be given")
    if ("pitch" in entry) == ("periods" in entry):
        raise ValueError(f"fringe {entry!r} found; of pitch and periods, one is needed")
    entry = {**entry, "start": start_angle(entry.get("start", start))}
    if (periods := entry.pop("periods", None)) is not None:
        side = projector[0 if entry.get("axis", "column") == "column" else 1]
        entry["pitch"] = side / positive("periods", periods, "the projector's width or height")
    return Fringe(**entry)


def start_angle(start: str | float) -> float:
    """Phase, radians, of a first step that begins as a name of `STARTS` says, or at degrees.

    >>> start_angle("sine") == start_angle(-90) == start_angle("-90") == -np.pi / 2
    True
    """
    if start in STARTS:
        return math.radians(STARTS[start])
    try:
        return math.radians(finite("start", float(start) if isinstance(start, str) else start))
    except ValueError:
        raise ValueError(
            f"start {start!r} given; one of {', '.join(STARTS)}, or degrees, are needed"
        ) from None
