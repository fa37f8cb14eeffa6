"""What is projected, in which order, and how its photographs are named (chapter 12).

A `Patterns` is written as ``patterns.toml`` beside the pictures for the projector; the photographs
go into a folder under the same names, and the same file tells how to decode them.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
import unicodedata
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from numbers import Integral, Real
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import NamedTuple

import numpy as np

from fpputil.capture.images import STACKS
from fpputil.checks import at_most, finite, positive
from fpputil.decoding.unwrap import TEMPORAL
from fpputil.files import write_whole
from fpputil.optics.fringes import WHITE, Fringe
from fpputil.optics.graycode import GrayCode

NAME = "patterns.toml"
UNWRAP = (*TEMPORAL, "minimum", "gray", "spatial")
ORDERS = ("fringe", "step")
LARGEST = 2**15  # of a projector's sides: more is a slip of the hand
FORMATS = {"axis": "s", "pitch": "g", "periods": "g", "step": "d", "number": "d"}
FIELD = re.compile(r"\{(axis|pitch|periods|step|number)(?::(0?[1-9]))?\}")
KEYS = (
    *("projector", "unwrap", "shift", "order", "files", "first", "white", "black", "gamma"),
    "fringes",
)
SAVED = ("axis", "pitch", "steps")
CODE = ("axis", "cell", "bits", "shift", "inverse")
FRINGE = ("axis", "pitch", "periods", "steps", "start")
STARTS = {"cosine": 0.0, "sine": -90.0, "black": 180.0}  # degrees, of the first step at column 0


class Shot(NamedTuple):
    """A photograph: its fringe (-1 for plain light), its step, its file, and its page there."""

    fringe: int
    step: int
    file: str
    page: int = 0


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
        object.__setattr__(self, "files", self._per_fringe(self.files))
        for name in self._templates():
            plain = FIELD.sub("", name)
            if "{" in plain or "}" in plain:
                raise ValueError(
                    f"files {name!r} given; {{axis}}, {{pitch}}, {{step}} and {{number}} are "
                    "known (and {periods}), with the least number of digits as in {step:02}"
                )
        fixed = not any("*" in name for name in self._templates())
        names = [shot.file for shot in self.shots()] if fixed else []
        twice = [name for name, number in Counter(names).items() if number > 1]
        if twice := [name for name in twice if not name.lower().endswith(STACKS)]:
            raise ValueError(
                f"files {self.files!r} given; {twice[0]} would be several photographs: name the "
                "axis, the pitch and the step where there are several"
            )

    @property
    def in_folders(self) -> bool:
        """Whether the photographs lie in folders inside that of the capture."""
        return any("/" in name for name in (*self._templates(), self.white, self.black))

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

    def shots(self, folder_names: Sequence[str] | None = None) -> list[Shot]:
        """All photographs in the order of time, plain light first.

        If `files` has a ``*``, it needs the names in the folder.
        """
        pairs = self._in_time()
        plain = [Shot(-1, n, file) for n, file in enumerate((self.white, self.black)) if file]
        names, here = folder_names or (), {shot.file for shot in plain}
        if isinstance(self.files, str) and "*" in self.files:
            plain, named = self._matching(names, plain, len(pairs))
        elif isinstance(self.files, str):
            named = [self._name(*pair, number) for number, pair in enumerate(pairs, len(plain))]
        else:
            of = [self._of_fringe(k, [n for n in names if n not in here]) for k in self._numbers]
            named = [of[k][n] for k, n in pairs]
        return _paged(plain + [Shot(*pair, file) for pair, file in zip(pairs, named, strict=True)])

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

    @property
    def _numbers(self) -> range:
        return range(len(self.fringes))

    def _in_time(self) -> list[tuple[int, int]]:
        """Fringe and step of all photographs in the order of time."""
        pairs = [(k, n) for k, f in enumerate(self.fringes) for n in range(f.steps)]
        if self.order == "step":
            pairs.sort(key=lambda pair: (pair[1], pair[0]))
        return pairs

    def _per_fringe(self, files):
        """One name, or a tuple with a name, or the names of all steps, of each fringe."""
        if isinstance(files, str) or len(files) == 1:
            return files if isinstance(files, str) else files[0]
        pairs = self._in_time()
        if len(files) == len(pairs) and all(isinstance(name, str) for name in files):
            names = dict(zip(pairs, files, strict=True))
            files = [[names[k, n] for n in range(f.steps)] for k, f in enumerate(self.fringes)]
        if len(files) != len(self.fringes):
            raise ValueError(
                f"{len(files)} files given; one name for all, or for each of the "
                f"{len(self.fringes)} fringes, or for each of the {len(pairs)} photographs is "
                "needed"
            )
        for k, (file, fringe) in enumerate(zip(files, self.fringes, strict=True), 1):
            if not isinstance(file, str) and len(file) != fringe.steps:
                raise ValueError(
                    f"{len(file)} files of fringe {k} given; it has {fringe.steps} steps"
                )
        return tuple(file if isinstance(file, str) else tuple(file) for file in files)

    def _templates(self) -> list[str]:
        """All names as they were given."""
        given = (self.files,) if isinstance(self.files, str) else self.files
        return [name for file in given for name in ((file,) if isinstance(file, str) else file)]

    def _of_fringe(self, k: int, names: Sequence[str]) -> Sequence[str]:
        """Names of the photographs of a fringe by step, out of those in the folder."""
        fringe, file = self.fringes[k], self.files[k]
        if not isinstance(file, str):
            return file
        if "*" not in file:
            return [self._name(k, n, n) for n in range(fringe.steps)]
        matching = _matches(names, file)
        if len(matching) != fringe.steps:
            raise ValueError(
                f"{len(matching)} files match {file!r}; fringe {k + 1}, along the {fringe.axis}s, "
                f"has {fringe.steps} steps"
            )
        return matching

    def _name(self, k: int, n: int, number: int) -> str:
        first = self.first[k] if isinstance(self.first, tuple) else self.first
        fringe, step = self.fringes[k], n + first
        values = {"axis": fringe.axis, "pitch": fringe.pitch, "step": step, "number": number}
        if isinstance(fringe, GrayCode):
            values |= {"pitch": "gray", "periods": "gray"}
        else:
            values["periods"] = self.width(fringe.axis) / fringe.pitch
        file = self.files if isinstance(self.files, str) else self.files[k]
        return FIELD.sub(lambda m: _formatted(values, *m.groups()), file)

    def _matching(self, names: Sequence[str], plain: list[Shot], needed: int):
        """Photographs in plain light, by name or the first of all, and names of the others."""
        plain_names = {shot.file for shot in plain}
        matching = _matches(names, self.files)
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


def _formatted(values: dict, name: str, digits: str | None) -> str:
    value = values[name]
    return value if isinstance(value, str) else format(value, (digits or "") + FORMATS[name])


def _matches(names: Sequence[str], pattern: str) -> list[str]:
    """Those names that match a pattern with ``*``, which stands for no folder; in natural order."""
    deep, pattern = pattern.count("/"), composed(pattern)
    fit = (n for n in names if n.count("/") == deep and fnmatchcase(n, pattern))
    return sorted(fit, key=natural)


def _paged(shots: list[Shot]) -> list[Shot]:
    """Shots of which those of one file take its pages one after the other."""
    seen: Counter[str] = Counter()
    paged = []
    for shot in shots:
        paged.append(shot._replace(page=seen[shot.file]))
        seen[shot.file] += 1
    return paged


def composed(name: str) -> str:
    r"""A name as others compare equal to it, whatever the system's encoding and way of accents.

    UTF-8 that was taken for another encoding is decoded, and accents join their letters.

    >>> composed("a\u0308") == composed("\udcc3\udca4") == "\xe4"
    True
    """
    data = name.encode("utf-8", "surrogateescape")
    return unicodedata.normalize("NFC", data.decode("utf-8", "surrogateescape"))


def natural(name: str) -> list:
    """Key that sorts step-2 before step-10."""
    return [(int(p), p) if p.isdecimal() else (0, p) for p in re.split(r"([0-9]+)", name)]


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
    entry = {**entry, "start": phase_of(entry.get("start", start))}
    if (periods := entry.pop("periods", None)) is not None:
        side = projector[0 if entry.get("axis", "column") == "column" else 1]
        entry["pitch"] = side / positive("periods", periods, "the projector's width or height")
    return Fringe(**entry)


def phase_of(start: str | float) -> float:
    """Phase, radians, of a first step that begins as a name of `STARTS` says, or at degrees.

    >>> phase_of("sine") == phase_of(-90) == phase_of("-90") == -np.pi / 2
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
