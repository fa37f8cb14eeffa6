"""`fpp decode`: a folder of photographs to phases, depth and points (chapter 12)."""

import json as jsons
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fpputil import capture, optics
from fpputil.cli.options import FRINGES, Force, Fringes, Json, option
from fpputil.cli.photographs import FILES, LEVELS, Files, LevelOptions, patterns_of

YES = {"negative_bool": "no-", "negative": None}


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
    levels: LevelOptions = LEVELS,
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
    how = levels.how()
    rig = None if system is None else optics.load_system(system)
    if rig is None and cloud != CLOUD:
        name = next(k for k, v in vars(cloud).items() if v != getattr(CLOUD, k))
        raise ValueError(f"--{name.replace('_', '-')} without --system given; points need one")
    if rig is not None and names.files is not None and names.projector is None:
        names = replace(names, projector=(rig.projector.width, rig.projector.height))
    patterns = patterns_of(folder, names, fringes)
    how |= {"reference": reference, "relief": relief}
    how |= {"accept": accept, "report": report, "pictures": pictures, "force": force}
    how |= vars(cloud)
    decoded = capture.decode_folder(folder, out, rig, patterns=patterns, progress=not json, **how)
    if json:
        print(jsons.dumps(decoded.summary))
    else:
        _print(decoded, rig)
    return 0 if decoded.summary["decoded"] else 1


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
