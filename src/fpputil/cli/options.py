"""Options that several commands share."""

import json
import re
from dataclasses import dataclass
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
Gamma = Annotated[
    str, option("Exponent of the response, taken back; auto: where a pitch has under 5 steps.")
]
Threshold = Annotated[float, option("Least modulation, grey levels of 255.")]
Noise = Annotated[float | None, option("Grey levels of 255 (default: estimated).")]
Full = Annotated[
    float | None, option("Saturated grey level (default 255, or by the greatest level there is).")
]
Channel = Annotated[
    Literal["grey", "red", "green", "blue"], option("Of photographs in colour, which one.")
]
Data = Annotated[Path, option("The dataset.")]
Preset = Annotated[str, option("tiny, small or paper.")]
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
        option("Pixels a period, in order (default of mf: longer side, / 8, / 48).", **SEVERAL),
    ] = None
    steps: Annotated[list[int] | None, option("Of all, or of each (default 8).", **SEVERAL)] = None
    axis: Annotated[
        Literal["column", "row", "both"] | None,
        option("Fringes along columns (vertical, default), rows, or both, as calibration needs."),
    ] = None
    unwrap: Annotated[str | None, option("mf (default), mw, nt or minimum.")] = None
    shift: Annotated[Literal[1, -1] | None, option("Sign of the phase shift (default 1).")] = None

    def patterns(self, projector: tuple[int, int], **names):
        """`Patterns` for a projector (width, height), refused if they do not unwrap."""
        from fpputil.capture.measurement import unwrapper

        side, unwrap = max(projector), self.unwrap or "mf"
        if self.pitches is None and unwrap not in ("mf", "minimum"):
            raise ValueError(f"unwrap {unwrap!r} without --pitches given; name them")
        pitches = self.pitches or [side, side / 8, side / 48]
        pitches = [int(p) if float(p).is_integer() else p for p in pitches]
        axes = ("column", "row") if self.axis == "both" else (self.axis or "column",)
        steps = self.steps if len(self.steps or ()) > 1 else (self.steps or [8])[0]
        fringes = sum((optics.fringe_set(pitches, steps, axis=axis) for axis in axes), ())
        patterns = capture.Patterns(projector, fringes, unwrap, self.shift or 1, **names)
        for axis in () if unwrap == "minimum" else axes:  # whose pitches the system decides on
            try:
                unwrapper(patterns, axis)
            except ValueError as error:
                raise ValueError(f"fringes along {axis}s: {error}") from error
        return patterns


FRINGES = Fringes()


@Parameter(name="*", group="Processes")
@dataclass(frozen=True)
class Training:
    """With what to train."""

    workers: Workers = 1
    device: Annotated[str | None, option("cpu, cuda, cuda:1 ... (default: a GPU, if any).")] = None
    threads: Annotated[int | None, option("Of the processor (default: all).")] = None

    def begin(self) -> dict:
        """Use so many threads; returns options of `fit`."""
        from fpputil.learning.devices import use_threads

        use_threads(self.threads)
        return {"workers": self.workers, "device": self.device, "progress": True}


TRAINING = Training()


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
