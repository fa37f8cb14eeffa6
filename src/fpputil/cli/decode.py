"""`fpp decode`: a folder of photographs to phases, depth and points (chapter 12)."""

import json as jsons
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fpputil import capture, optics
from fpputil.cli.options import FRINGES, Force, Fringes, Json, Size, given, option

YES = {"negative_bool": "no-", "negative": None}


@Parameter(name="*", group="Photographs, if FOLDER holds no patterns.toml")
@dataclass(frozen=True)
class Files:
    """What was projected, and how the photographs are named."""

    patterns: Annotated[Path | None, option("A pattern file elsewhere.")] = None
    files: Annotated[
        str | None, option("Names, as '{axis}-{pitch}-{step:02}.png', or '*.png' in order of time.")
    ] = None
    projector: Annotated[Size | None, option("Pixels (default: the system's, or 912x1140).")] = None
    first: Annotated[int, option("Number of the first step in a name.")] = 0
    order: Annotated[Literal["fringe", "step"], option("Which comes first.")] = "fringe"
    white: Annotated[str, option("Photograph in plain light.")] = ""
    black: Annotated[str, option("Photograph in no light.")] = ""


FILES = Files()


def decode(
    folder: Annotated[Path, option("Of the photographs.")],
    /,
    *,
    out: Annotated[Path | None, option("New folder (default FOLDER-decoded).")] = None,
    system: Annotated[str | None, option("For millimetres: tiny, small, paper or a file.")] = None,
    gamma: Annotated[
        str, option("Exponent of the response, taken back; auto: where a pitch has under 5 steps.")
    ] = "auto",
    threshold: Annotated[float, option("Least modulation, grey levels of 255.")] = 8.0,
    noise: Annotated[float | None, option("Grey levels of 255 (default: estimated).")] = None,
    full: Annotated[float | None, option("Saturated grey level (default 255 or 65535).")] = None,
    accept: Annotated[bool, option("Write phases all the same.")] = False,
    report: Annotated[bool, option("Write report.html.", **YES)] = True,
    pictures: Annotated[bool, option("Write TIFF files.", **YES)] = True,
    force: Force = False,
    json: Json = False,
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
    from fpputil.checks import positive

    exponent = None if gamma == "auto" else positive("gamma", _number(gamma))
    rig = None if system is None else optics.load_system(system)
    if rig is not None and names.files is not None and names.projector is None:
        names = replace(names, projector=(rig.projector.width, rig.projector.height))
    patterns = _patterns(folder, names, fringes)
    how = {"full": full, "threshold": threshold, "gamma": exponent, "noise": noise}
    how |= {"accept": accept, "report": report, "pictures": pictures, "force": force}
    decoded = capture.decode_folder(folder, out, rig, patterns=patterns, progress=not json, **how)
    if json:
        print(jsons.dumps(decoded.summary))
    else:
        _print(decoded, rig)
    return 0 if decoded.summary["decoded"] else 1


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"gamma {text!r} given; a positive number or auto is needed") from None


def _patterns(folder: Path, names: Files, fringes: Fringes):
    """Patterns named on the command line, or of a file, whose direction --shift may turn."""
    from fpputil.capture.photographs import of_folder

    if names.patterns is not None and names.files is not None:
        raise ValueError("--patterns and --files given; one of them names the photographs")
    if names.files is not None:
        options = given(names)
        return fringes.patterns(options.pop("projector", (912, 1140)), **options)
    if beside := given(replace(fringes, shift=None)):
        reason = "a pattern file tells it, or --files and all the others do"
        raise ValueError(f"--{next(iter(beside))} without --files given; {reason}")
    patterns = (
        of_folder(folder) if names.patterns is None else capture.Patterns.load(names.patterns)
    )
    return patterns if fringes.shift is None else replace(patterns, shift=fringes.shift)


def _print(decoded, system) -> None:
    summary = decoded.summary
    for axis, numbers in summary["numbers"].items():
        sigma = f"uncertainty {numbers['uncertainty of the phase, median']} (median)"
        print(f"{axis}s: {numbers['pixels in the mask']} in the mask, {sigma}")
    for finding in decoded.findings:
        kind = "error" if finding.severe else "note"
        print(f"{kind}: {finding.message}; {finding.remedy}", file=sys.stderr)
    if "points" in summary:
        print(f"{summary['points']} points in {decoded.out / 'points.ply'}")
    elif system is None:
        print("no --system given: phases, but no depth and no points")
    if not summary["decoded"]:
        print("with errors only the report is written; --accept writes all", file=sys.stderr)
    print(f"{'written to' if summary['decoded'] else 'the report is in'} {decoded.out}")
