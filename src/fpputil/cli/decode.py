"""`fpp decode`: a folder of photographs to phases, depth and points (chapter 12)."""

from __future__ import annotations

import json as jsons
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fpputil.cli.options import FRINGES, Fringes, Size, given

Yes = Parameter(negative_bool="no-", negative=None)


@Parameter(name="*", group="Photographs, if FOLDER holds no patterns.toml")
@dataclass(frozen=True)
class Files:
    """What was projected, and how the photographs are named.

    Parameters
    ----------
    patterns
        A pattern file elsewhere.
    files
        Names of the photographs, as '{axis}-{pitch}-{step:02}.png', or '*.png' in order of time.
    projector
        Pixels.
    first
        Number of the first step in a name.
    order
        Which comes first.
    white
        Photograph in plain light.
    black
        Photograph in no light.
    """

    patterns: Path | None = None
    files: str | None = None
    projector: Size = (912, 1140)
    first: int = 0
    order: Literal["fringe", "step"] = "fringe"
    white: str = ""
    black: str = ""


FILES = Files()


def decode(
    folder: Path,
    /,
    *,
    out: Path | None = None,
    system: str | None = None,
    gamma: str = "auto",
    threshold: float = 8.0,
    noise: float | None = None,
    full: float | None = None,
    accept: bool = False,
    report: Annotated[bool, Yes] = True,
    pictures: Annotated[bool, Yes] = True,
    force: bool = False,
    json: bool = False,
    names: Files = FILES,
    fringes: Fringes = FRINGES,
) -> int:
    """Decode a folder of photographs.

    Writes decoded.npz, TIFF files, report.html and summary.json, with --system also points.ply and
    the depth. If the capture is wrong in a way that would give wrong phases (direction of the
    shift, swapped or missing photographs, a saturated projector ...), only report and summary are
    written, and the exit code is 1.

    Parameters
    ----------
    folder
        Of the photographs.
    out
        New folder (default FOLDER-decoded).
    system
        A calibrated system, for millimetres: tiny, small, paper or a file.
    gamma
        Exponent of the response, which is taken back; auto: where some pitch has fewer than five
        steps and another one tells it.
    threshold
        Least modulation, grey levels of 255.
    noise
        Grey levels of 255 (default: estimated).
    full
        Grey level of a saturated pixel (default 255 or 65535).
    accept
        Write phases all the same.
    report
        Write report.html.
    pictures
        Write TIFF files.
    force
        Replace OUT.
    json
        Print summary.json.
    """
    from fpputil.capture.folder import decode_folder
    from fpputil.checks import positive
    from fpputil.optics.system import load_system

    exponent = None if gamma == "auto" else positive("gamma", _number(gamma))
    rig = None if system is None else load_system(system)
    patterns = _patterns(folder, names, fringes)
    how = {
        "full": full,
        "threshold": threshold,
        "gamma": exponent,
        "noise": noise,
        "accept": accept,
    }
    how |= {"report": report, "pictures": pictures, "force": force, "progress": not json}
    decoded = decode_folder(folder, out, rig, patterns=patterns, **how)
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
    from fpputil.capture.patterns import Patterns
    from fpputil.capture.photographs import of_folder

    if names.patterns is not None and names.files is not None:
        raise ValueError("--patterns and --files given; one of them names the photographs")
    if names.files is not None:
        options = given(names)
        return fringes.patterns(options.pop("projector"), **options)
    if beside := given(replace(fringes, shift=None)):
        raise ValueError(
            f"--{next(iter(beside))} without --files given; a pattern file tells it, or --files "
            "and all the others do"
        )
    patterns = of_folder(folder) if names.patterns is None else Patterns.load(names.patterns)
    return patterns if fringes.shift is None else replace(patterns, shift=fringes.shift)


def _print(decoded, system) -> None:
    summary = decoded.summary
    for axis, numbers in summary["numbers"].items():
        print(
            f"{axis}s: {numbers['pixels in the mask']} in the mask, uncertainty "
            f"{numbers['uncertainty of the phase, median']} (median)"
        )
    for finding in decoded.findings:
        kind = "error" if finding.severe else "note"
        print(f"{kind}: {finding.message}; {finding.remedy}", file=sys.stderr)
    if "points" in summary:
        print(f"{summary['points']} points in {decoded.out / 'points.ply'}")
    elif system is None:
        print("no --system given: phases, but no depth and no points")
    if not summary["decoded"]:
        print("the phases are wrong and were not written; --accept writes them", file=sys.stderr)
    print(f"written to {decoded.out}")
