"""`fpp decode`: a folder of photographs to phases, depth and points (chapter 12)."""

from __future__ import annotations

import json as jsons
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
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
    from fpputil.checks import positive
    from fpputil.optics.system import load_system

    exponent = None if gamma == "auto" else positive("gamma", _number(gamma))
    rig = None if system is None else load_system(system)
    patterns = _patterns(folder, names, fringes)
    out = out or folder.with_name(f"{folder.absolute().name}-decoded")
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


def decode_folder(
    folder,
    out,
    system=None,
    *,
    patterns,
    full,
    threshold,
    gamma,
    noise,
    accept,
    report,
    pictures,
    force,
    progress,
):
    """Measure a capture, judge it, and write what there is, whole or not at all."""
    import numpy as np
    from tqdm.std import tqdm

    from fpputil.capture import products
    from fpputil.capture.diagnosis import diagnose
    from fpputil.capture.measurement import measure
    from fpputil.capture.photographs import open_capture
    from fpputil.capture.report import page, report_numbers
    from fpputil.files import folder_whole, write_arrays

    start, capture = time.perf_counter(), open_capture(folder, patterns, full)
    how = {"threshold": threshold, "power": gamma and 1 / gamma, "noise": noise}
    with folder_whole(out, force) as partial:
        total = sum(f.steps for f in capture.patterns.fringes)
        with tqdm(
            total=total, unit="photo", leave=False, disable=None if progress else True
        ) as bar:
            scans = [
                measure(capture, axis, system=system, each=bar.update, **how)
                for axis in capture.patterns.axes
            ]
        findings = [d for s in scans for d in diagnose(s, capture)]
        wrong = any(d.severe for d in findings) and not accept
        summary = {
            "decoded": not wrong,
            "doubts": [d._asdict() for d in findings],
            "numbers": {s.axis: report_numbers(s) for s in scans},
        }
        depth = None
        if not wrong:
            arrays = {k: v for s in scans for k, v in products.arrays(s).items()}
            vertical = [s for s in scans if s.axis == "column"]
            if system is not None and vertical:
                points, depth, sigma = products.measured_points(vertical[0], system)
                colours = capture.colours()
                if colours is None:  # the average of the fringes stands in
                    grey = vertical[0].average.astype(np.uint8)
                    colours = np.repeat(grey[..., None], 3, axis=2)
                ply = partial / "points.ply"
                summary["points"] = products.save_points(ply, points, colours, sigma)
                arrays |= {"depth": depth.astype("f4"), "depth_sigma": sigma.astype("f4")}
            write_arrays(partial / "decoded.npz", arrays, compress=False)
            if pictures:
                summary["tiff"] = products.save_pictures(partial, arrays)
        if report:
            title = f"Decoding of {folder.absolute().name}"
            (partial / "report.html").write_text(page(title, scans, findings, depth))
        summary["seconds"] = round(time.perf_counter() - start, 2)
        (partial / "summary.json").write_text(jsons.dumps(summary, indent=1) + "\n")
    return SimpleNamespace(out=out, summary=summary, measurements=scans, findings=findings)


def _print(decoded, system) -> None:
    summary = decoded.summary
    for axis, numbers in summary["numbers"].items():
        print(
            f"{axis}s: {numbers['pixels in the mask']} in the mask, uncertainty "
            f"{numbers['uncertainty of the phase, median']} (median)"
        )
    for finding in decoded.findings:
        kind = "error" if finding.severe else "note"
        print(f"{kind}: {finding.found}; {finding.remedy}", file=sys.stderr)
    if "points" in summary:
        print(f"{summary['points']} points in {decoded.out / 'points.ply'}")
    elif system is None:
        print("no --system given: phases, but no depth and no points")
    if not summary["decoded"]:
        print("the phases are wrong and were not written; --accept writes them", file=sys.stderr)
    print(f"written to {decoded.out}")
