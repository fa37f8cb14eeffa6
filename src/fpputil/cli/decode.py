"""`fpp decode`: a folder of photographs to phases, depth and points (chapter 12)."""

import json as jsons
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fpputil import capture, optics
from fpputil.cli.options import (
    FRINGES,
    SEVERAL,
    Channel,
    Force,
    Fringes,
    Full,
    Gamma,
    Json,
    Noise,
    Size,
    Threshold,
    given,
    option,
)

YES = {"negative_bool": "no-", "negative": None}


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


@Parameter(name="*", group="Points")
@dataclass(frozen=True)
class Cloud:
    """Which points are written, and as what."""

    min_area: Annotated[
        int, option("Pixels; smaller parts of the picture are specks and left out, 0: none.")
    ] = 25
    max_sigma: Annotated[
        float | None, option("Leave out points whose depth is less certain than this, mm.")
    ] = None
    lone: Annotated[
        float | None,
        option("Leave out points so many standard deviations farther from their neighbours, as 3."),
    ] = None
    mesh: Annotated[bool, option("Write mesh.ply, triangles with normals.")] = False


CLOUD = Cloud()


def decode(
    folder: Annotated[Path, option("Of the photographs.")],
    /,
    *,
    out: Annotated[Path | None, option("New folder (default FOLDER-decoded).")] = None,
    system: Annotated[str | None, option("For millimetres: tiny, small, paper or a file.")] = None,
    gamma: Gamma = "auto",
    threshold: Threshold = 8.0,
    noise: Noise = None,
    full: Full = None,
    channel: Channel = "grey",
    accept: Annotated[bool, option("Write phases all the same.")] = False,
    reference: Annotated[
        Path | None, option("Photographs of a plane, likewise named; its phase is taken away.")
    ] = None,
    relief: Annotated[
        Literal["plane", "cubic"] | None,
        option("A shape without --system: the phase less such a ground, as picture and mesh."),
    ] = None,
    report: Annotated[bool, option("Write report.html.", **YES)] = True,
    pictures: Annotated[bool, option("Write TIFF files.", **YES)] = True,
    force: Force = False,
    json: Json = False,
    cloud: Cloud = CLOUD,
    names: Files = FILES,
    fringes: Fringes = FRINGES,
) -> int:
    """Decode a folder of photographs.

    Writes decoded.npz, TIFF files, report.html and summary.json, with --system also points.ply and
    the depth: of columns, rows or both, as each pixel's geometry makes them sharp. How the
    projector hangs (beside the camera, above it, on its head or side) is what the system says. If
    the capture is wrong in a way that would give wrong phases (direction of the shift, swapped or
    missing photographs, a saturated projector ...), or the system looks like another rig's, only
    report and summary are written, and the exit code is 1.
    """
    exponent = _exponent(gamma)
    rig = None if system is None else optics.load_system(system)
    if rig is None and cloud != CLOUD:
        name = next(k for k, v in vars(cloud).items() if v != getattr(CLOUD, k))
        raise ValueError(f"--{name.replace('_', '-')} without --system given; points need one")
    if rig is not None and names.files is not None and names.projector is None:
        names = replace(names, projector=(rig.projector.width, rig.projector.height))
    patterns = _patterns(folder, names, fringes)
    how = {"full": full, "threshold": threshold, "gamma": exponent, "noise": noise}
    how |= {"reference": reference, "relief": relief}
    how |= {"accept": accept, "report": report, "pictures": pictures, "force": force}
    how |= {"channel": channel, **vars(cloud)}
    decoded = capture.decode_folder(folder, out, rig, patterns=patterns, progress=not json, **how)
    if json:
        print(jsons.dumps(decoded.summary))
    else:
        _print(decoded, rig)
    return 0 if decoded.summary["decoded"] else 1


def _exponent(gamma: str) -> float | None:
    from fpputil.checks import positive

    if gamma == "auto":
        return None
    try:
        number = float(gamma)
    except ValueError:
        raise ValueError(f"gamma {gamma!r} given; a positive number or auto is needed") from None
    return positive("gamma", number)


def _patterns(folder: Path, names: Files, fringes: Fringes):
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
    from fpputil.capture.patterns import composed

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


def _print(decoded, system) -> None:
    summary = decoded.summary
    for axis, numbers in summary["numbers"].items():
        sigma = f"uncertainty {numbers['uncertainty of the phase, median']} (median)"
        print(f"{axis}s: {numbers['pixels in the mask']} in the mask, {sigma}")
        if "by" in numbers["gamma"]:
            print(f"{axis}s: response of gamma {numbers['gamma']}, taken back")
    for finding in decoded.findings:
        kind = "error" if finding.severe else "note"
        said = f"{kind}: {finding.where}{finding.message}; {finding.remedy}"
        print(said, file=sys.stderr)
    if "points" in summary:
        lost = ", ".join(f"{n} {why}" for why, n in summary["removed"].items() if n)
        left = f" ({lost} left out)" if lost else ""
        print(f"{summary['points']} points in {decoded.out / 'points.ply'}{left}")
    elif system is None:
        shape = "" if "relief" in summary else "; --relief cubic makes a picture and a mesh of them"
        print(f"no --system given: phases, but no depth and no points{shape}")
    for file in summary.get("relief", ()):
        print(f"{decoded.out / file}: heights in radians, which way is up is not known")
    if not summary["decoded"]:
        print("with errors only the report is written; --accept writes all", file=sys.stderr)
    print(f"{'written to' if summary['decoded'] else 'the report is in'} {decoded.out}")
