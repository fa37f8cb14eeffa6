"""What `fpp decode` and `fpp calibrate` are told of photographs: their names and levels."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fpputil import capture
from fpputil.cli.options import SEVERAL, Channel, Fringes, Full, Size, given, option


@Parameter(name="*")
@dataclass(frozen=True)
class LevelOptions:
    """How grey levels are read."""

    gamma: Annotated[
        str,
        option(
            "Exponent of the response, taken back; auto: where a pitch has under 5 steps, by the "
            "longest, the plain photographs, or three and four steps themselves."
        ),
    ] = "auto"
    threshold: Annotated[float, option("Least modulation, grey levels of 255.")] = 8.0
    noise: Annotated[float | None, option("Grey levels of 255 (default: estimated).")] = None
    full: Full = None
    channel: Channel = "grey"

    def how(self) -> dict:
        """Options of `measure` and `open_capture`."""
        return {**vars(self), "gamma": _exponent(self.gamma)}


LEVELS = LevelOptions()


def _exponent(gamma: str) -> float | None:
    """A number, or None of "auto"."""
    from fpputil.checks import positive

    if gamma == "auto":
        return None
    try:
        number = float(gamma)
    except ValueError:
        raise ValueError(f"gamma {gamma!r} given; a positive number or auto is needed") from None
    return positive("gamma", number)


@Parameter(name="*", group="Photographs, if FOLDER holds no patterns.toml")
@dataclass(frozen=True)
class Files:
    """What was projected, and how the photographs are named."""

    patterns: Annotated[Path | None, option("A pattern file elsewhere.")] = None
    files: Annotated[
        list[str] | None,
        option(
            "Names, as `{axis}-{pitch}-{step:02}.png`, or `*.png` in order of time; one name for "
            "each pitch, as `long/*.png`; or all names. A TIFF or NPY file may hold many.",
            **SEVERAL,
        ),
    ] = None
    projector: Annotated[
        Size | None, option("Pixels (default: the system's; 912x1140 if the pitches fit that).")
    ] = None
    first: Annotated[
        list[int],
        option("Number of the first step in a name; of all pitches, or of each.", **SEVERAL),
    ] = field(default_factory=lambda: [0])
    order: Annotated[Literal["fringe", "step"], option("Which comes first.")] = "fringe"
    white: Annotated[str, option("Photograph in plain light.")] = ""
    black: Annotated[
        str, option("Photograph in no light: with gamma, it is taken from the others.")
    ] = ""


FILES = Files()


def patterns_of(folder: Path, names: Files, fringes: Fringes):
    """Patterns named on the command line, or of a file, which --shift and --start may turn."""
    from fpputil.capture.photographs import of_folder

    if names.patterns is not None and names.files is not None:
        raise ValueError("--patterns and --files given; one of them names the photographs")
    if names.files is not None:
        options = {k: _composed(v) for k, v in given(names).items()}
        unknown = () if fringes.unwrap == "spatial" else None
        return fringes.patterns(options.pop("projector", unknown), **options)
    if beside := given(replace(fringes, shift=None, start=None)):
        reason = "a pattern file tells it, or --files and all the others do"
        raise ValueError(f"--{next(iter(beside))} without --files given; {reason}")
    patterns = (
        of_folder(folder) if names.patterns is None else capture.Patterns.load(names.patterns)
    )
    if fringes.shift is not None:
        patterns = replace(patterns, shift=fringes.shift)
    if fringes.start is not None:
        patterns = replace(patterns, fringes=_begun(patterns, fringes))
    return patterns


def _composed(value):
    """Names in whatever encoding the terminal has."""
    from fpputil.capture.files.names import composed

    if isinstance(value, list):
        return [_composed(one) for one in value]
    return composed(value) if isinstance(value, str) else value


def _begun(patterns, fringes: Fringes) -> tuple:
    """The fringes of a file, which begin as --start says; a Gray code has no start."""
    begun = list(patterns.fringes)
    for axis in patterns.axes:
        sinusoids = [k for k, f in enumerate(begun) if f in patterns.along(axis).values()]
        for k, fringe in zip(sinusoids, fringes.begun([begun[k] for k in sinusoids]), strict=True):
            begun[k] = fringe
    return tuple(begun)
