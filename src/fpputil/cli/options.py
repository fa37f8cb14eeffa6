"""Options that several commands share."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fpputil import capture, optics


def option(text: str, **how) -> Parameter:
    """An option of which the help says a text; `how` are others of `Parameter`."""
    return Parameter(help=text, **how)


def _size(type_, tokens) -> tuple[int, int]:
    numbers = re.fullmatch(r"([1-9][0-9]{0,5})x([1-9][0-9]{0,5})", tokens[0].value)
    if not numbers:
        raise ValueError(f"size {tokens[0].value!r} given; WIDTHxHEIGHT is needed, as 912x1140")
    return int(numbers[1]), int(numbers[2])


SEVERAL = {"consume_multiple": True}  # values after one option
Size = Annotated[tuple[int, int], Parameter(converter=_size, n_tokens=1, metavar="WxH")]
Out = Annotated[Path, option("New folder.")]
Force = Annotated[bool, option("Replace earlier results.")]
Json = Annotated[bool, option("Print one JSON object.")]
System = Annotated[str, option("tiny, small, paper, or a file: .json, .yml, .yaml.")]
Full = Annotated[
    float | None, option("Saturated grey level (default 255, or by the greatest level there is).")
]
Channel = Annotated[
    Literal["grey", "red", "green", "blue"], option("Of photographs in colour, which one.")
]
Data = Annotated[Path, option("The dataset.")]
Preset = Annotated[str, option("tiny, small, paper or near.")]
Weights = Annotated[Path, option("A .safetensors file.")]
Workers = Annotated[int, option("Processes that load.")]
Device = Annotated[str, option("cpu, cuda ...")]
Precision = Annotated[str, option("float32, bfloat16 or auto.")]


UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
Unit = Annotated[Literal["mm", "cm", "m", "inch"] | None, option("Of lengths (default mm).")]


def millimetres(unit: str | None, least: float, **lengths: float) -> list[float]:
    """Lengths that were given in a unit, in mm; ValueError if none is named and one is tiny."""
    for name, length in lengths.items():
        if unit is None and 0 < length < least:
            raise ValueError(
                f"--{name} {length:g} without --unit given; that is less than {least:g} mm: give "
                "--unit m, cm or inch, or --unit mm if it is right"
            )
    return [length * UNITS[unit or "mm"] for length in lengths.values()]


@Parameter(name="*", group="Board")
@dataclass(frozen=True)
class Target:
    """What is printed on a board."""

    square: Annotated[float, option("Distance of the board's points.")] = 25.0
    kind: Annotated[
        Literal["chessboard", "charuco", "circles", "asymmetric"],
        option(
            "chessboard (its inner corners count), charuco, circles (black on white or white on "
            "black), or asymmetric circles (their square is the distance of the rows)."
        ),
    ] = "chessboard"
    dictionary: Annotated[str, option("Of a charuco board: 5x5_100, apriltag_36h11 ...")] = (
        "4x4_250"
    )
    marker: Annotated[float, option("Of a charuco board: width, squares.")] = 0.75
    legacy: Annotated[bool, option("Of a charuco board: as OpenCV before 4.6 drew it.")] = False

    def board(self, columns: int, rows: int, square: float | None = None):
        """`Board` of so many points, whose square may be given in mm."""
        from fpputil.calibration import Board

        marks = {"dictionary": self.dictionary, "legacy": self.legacy, "marker": self.marker}
        return Board(columns, rows, square or self.square, self.kind, **marks)


TARGET = Target()


@Parameter(name="*", group="Fringes")
@dataclass(frozen=True)
class Fringes:
    """Which fringes there are."""

    pitches: Annotated[
        list[float] | None,
        option("Pixels a period, as photographed (default: longer side, / 8, / 48).", **SEVERAL),
    ] = None
    periods: Annotated[
        list[float] | None,
        option("In their place: periods over the projector, as 70 64 59 with mw.", **SEVERAL),
    ] = None
    steps: Annotated[list[int] | None, option("Of all, or of each (default 8).", **SEVERAL)] = None
    axis: Annotated[
        Literal["column", "row", "both"] | None,
        option("Fringes along columns (vertical, default), rows, or both, as calibration needs."),
    ] = None
    unwrap: Annotated[str | None, option("mf (default), mw, nt, minimum, gray or spatial.")] = None
    code: Annotated[
        Literal["complementary", "plain", "shifted", "alone"] | None,
        option(
            "Gray code of the longest pitch, after the fringes: two cells a period (default), one, "
            "one shifted by half a period; or no fringes at all, and cells of one pixel."
        ),
    ] = None
    code_first: Annotated[bool | None, option("Gray code before the fringes.", negative=())] = None
    inverse: Annotated[
        bool | None, option("After each picture of a Gray code its negative.", negative=())
    ] = None
    shift: Annotated[Literal[1, -1] | None, option("Sign of the phase shift (default 1).")] = None
    start: Annotated[
        list[str] | None,
        option(
            "How the first step begins at column 0: cosine (default), sine, black or degrees; of "
            "all, or of each.",
            **SEVERAL,
        ),
    ] = None

    def patterns(self, projector: tuple[int, int] | None, **names):
        """`Patterns` for a projector (width, height), refused if they do not unwrap.

        () is one of unknown size, None the usual one.
        """
        from fpputil.capture.unwrapping import unwrapper

        unwrap = self.unwrap or "mf"
        if self.pitches and self.periods:
            raise ValueError("--pitches and --periods given; one of them says what was projected")
        of_gray = [n for n in ("code", "code_first", "inverse") if getattr(self, n)]
        if of_gray and unwrap != "gray":
            name = of_gray[0].replace("_", "-")
            raise ValueError(f"--{name} with unwrap {unwrap!r} given; it is of gray")
        if self.code == "alone" and (self.pitches or self.periods):
            raise ValueError("--code alone with pitches given; it has no fringes")
        if not (self.pitches or self.periods) and unwrap not in USUALLY:
            raise ValueError(f"unwrap {unwrap!r} without --pitches given; name them")
        projector = self._usual(unwrap) if projector is None else projector
        axes = ("column", "row") if self.axis == "both" else (self.axis or "column",)
        steps = self.steps if len(self.steps or ()) > 1 else (self.steps or [8])[0]
        fringes = ()
        for axis in axes:
            pitches = self._pitches(projector, axis)
            sinusoids, code = self.begun(optics.fringe_set(pitches, steps, axis=axis)), ()
            if unwrap == "gray":
                code = (self._code(max(pitches), projector[axis == "row"], axis),)
            sinusoids = () if self.code == "alone" else sinusoids
            fringes += code + sinusoids if self.code_first else sinusoids + code
        patterns = capture.Patterns(projector, fringes, unwrap, self.shift or 1, **names)
        for axis in () if unwrap == "minimum" else axes:  # whose pitches the system decides on
            try:
                unwrapper(patterns, axis)
            except ValueError as error:
                raise ValueError(f"fringes along {axis}s: {error}") from error
        return patterns

    def begun(self, fringes: Sequence) -> tuple:
        """Fringes along an axis that begin as `start` says."""
        from fpputil.capture.patterns import start_angle

        if self.start is None:
            return tuple(fringes)
        starts = self.start * len(fringes) if len(self.start) == 1 else self.start
        if len(starts) != len(fringes):
            raise ValueError(
                f"{len(starts)} starts and {len(fringes)} pitches given; one of all, or of each"
            )
        pairs = zip(fringes, starts, strict=True)
        return tuple(replace(fringe, start=start_angle(start)) for fringe, start in pairs)

    def _usual(self, unwrap: str) -> tuple[int, int]:
        """Size of the book's projector, unless pitches or periods say that it is another one."""
        from fpputil.decoding.unwrap import TEMPORAL, reach

        if self.periods:
            raise ValueError("--periods without --projector given; they are parts of its width")
        if self.pitches and unwrap == "gray":
            raise ValueError("--pitches of a Gray code without --projector given; give its size")
        if self.pitches and unwrap in TEMPORAL:
            span = reach(unwrap, self.pitches)
            if span > 1.01 * USUAL[0] and span != USUAL[1]:
                raise ValueError(
                    f"pitches {self.pitches} without --projector given; they tell {span:g} pixels "
                    f"apart, so the projector is likely to be wider than {USUAL[0]} x {USUAL[1]}, "
                    "the default: give --projector WIDTHxHEIGHT"
                )
        return USUAL

    def _pitches(self, projector: tuple[int, int], axis: str) -> list[float]:
        from fpputil.checks import positive

        longer = max(projector, default=48)  # of a size unknown, pitch 1 counts the periods
        one = self.unwrap in ("gray", "spatial")
        pitches = self.pitches or ([longer / 48] if one else [longer, longer / 8, longer / 48])
        if self.periods:
            if not projector:
                raise ValueError("--periods without --projector given; they are parts of its width")
            side = projector[axis == "row"]
            pitches = [side / positive("periods", n, "the projector's width") for n in self.periods]
        return [int(p) if float(p).is_integer() else p for p in pitches]

    def _code(self, pitch: float, side: int, axis: str):
        """Gray code of a pitch along an axis of a projector with so many pixels."""
        from fpputil.optics.graycode import GrayCode, gray_code

        if self.code == "alone":
            bits = max(1, (side - 1).bit_length())
            return GrayCode(1, bits, axis, inverse=bool(self.inverse))
        return gray_code(pitch, side, self.code or "complementary", axis, bool(self.inverse))


FRINGES = Fringes()
USUAL = (912, 1140)  # pixels of the book's projector
USUALLY = ("mf", "minimum", "gray", "spatial")  # unwrappings that have usual pitches


@Parameter(name="*", group="Processes")
@dataclass(frozen=True)
class TrainingOptions:
    """With what to train."""

    workers: Workers = 1
    device: Annotated[str | None, option("cpu, cuda, cuda:1 ... (default: a GPU, if any).")] = None
    threads: Annotated[int | None, option("Of the processor (default: all).")] = None

    def begin(self) -> dict:
        """Use so many threads; returns options of `fit`."""
        from fpputil.learning.devices import use_threads

        use_threads(self.threads)
        return {"workers": self.workers, "device": self.device, "progress": True}


TRAINING = TrainingOptions()


def tell(as_json: bool, numbers: dict, *lines: str) -> None:
    """Print numbers as one JSON object, or lines for people."""
    print(json.dumps(numbers) if as_json else "\n".join(lines))


def given(options) -> dict:
    """Those of a dataclass of options that were given."""
    return {name: value for name, value in vars(options).items() if value is not None}


def free(file: Path, force: bool) -> None:
    """ValueError if a file is there, unless it is a system file and may be replaced."""
    from fpputil.optics.system import load_system

    if not file.exists():
        return
    if not force:
        raise ValueError(f"{file} is there already; name another file, or use --force")
    try:
        load_system(file)
    except ValueError as error:
        raise ValueError(f"--force replaces a system file alone: {error}") from error
