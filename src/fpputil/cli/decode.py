"""`fpp decode`: a folder of photographs to phases, depth and points (chapter 12)."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

from fpputil.cli.patterns import add_fringes, chosen, size


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    decode = commands.add_parser(
        "decode",
        help="decode a folder of photographs",
        description="Writes decoded.npz, TIFF files, report.html and summary.json, with "
        "--system also points.ply and the depth. If the capture is wrong in a way that would give "
        "wrong phases (direction of the shift, swapped or missing photographs, a saturated "
        "projector ...), only report and summary are written, and the exit code is 1.",
    )
    decode.add_argument("folder", metavar="FOLDER", type=Path)
    decode.add_argument("--out", type=Path, metavar="OUT",
                        help="new folder (default FOLDER-decoded)")  # fmt: skip
    decode.add_argument("--system", metavar="S", help="a calibrated system, for millimetres")
    decode.add_argument("--gamma", default="auto", metavar="G",
                        help="exponent of the response, which is taken back (default auto: where "
                        "some pitch has fewer than five steps and another tells it)")  # fmt: skip
    decode.add_argument("--threshold", type=float, default=8.0,
                        help="least modulation, grey levels of 255 (default 8)")  # fmt: skip
    decode.add_argument("--noise", type=float, help="grey levels of 255 (default: estimated)")
    decode.add_argument("--full", type=float,
                        help="grey level of a saturated pixel (default 255 or 65535)")  # fmt: skip
    decode.add_argument("--accept", action="store_true", help="write phases all the same")
    decode.add_argument("--no-report", action="store_true", help="no report.html")
    decode.add_argument("--no-pictures", action="store_true", help="no TIFF files")
    decode.add_argument("--force", action="store_true", help="replace OUT")
    decode.add_argument("--json", action="store_true", help="print summary.json")
    _patterns(decode)
    decode.set_defaults(run=_decode, go_on="nothing was written")


def _patterns(decode) -> None:
    given = decode.add_argument_group(
        "patterns", "what was projected, if FOLDER holds no patterns.toml"
    )
    given.add_argument("--patterns", type=Path, metavar="FILE", help="a pattern file elsewhere")
    given.add_argument("--files", metavar="NAMES",
                       help="names of the photographs, as '{axis}-{pitch}-{step:02}.png', or "
                       "'*.png' in order of time")  # fmt: skip
    given.add_argument("--projector", type=size, default=(912, 1140), metavar="WxH",
                       help="pixels (default 912x1140)")  # fmt: skip
    given.add_argument("--first", type=int, default=0, help="number of the first step in a name")
    given.add_argument("--order", default="fringe", help="fringe (default) or step comes first")
    given.add_argument("--white", default="", metavar="NAME", help="photograph in plain light")
    given.add_argument("--black", default="", metavar="NAME", help="photograph in no light")
    add_fringes(given)
    decode.set_defaults(steps=None, axis=None, unwrap=None, shift=None)


def _decode(options) -> int:
    from fpputil.capture.folder import decode_folder
    from fpputil.checks import positive
    from fpputil.optics.system import load_system

    gamma = None if options.gamma == "auto" else positive("gamma", _number(options.gamma))
    system = None if options.system is None else load_system(options.system)
    result = decode_folder(
        options.folder,
        options.out,
        system,
        patterns=_given(options),
        full=options.full,
        threshold=options.threshold,
        gamma=gamma,
        noise=options.noise,
        accept=options.accept,
        report=not options.no_report,
        pictures=not options.no_pictures,
        force=options.force,
        progress=not options.json,
    )
    _say(options, result)
    return 0 if result.summary["decoded"] else 1


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"gamma {text!r} given; a positive number or auto is needed") from None


def _given(options):
    """Patterns named on the command line, or of a file."""
    if options.patterns is not None and options.files is not None:
        raise ValueError("--patterns and --files given; one of them names the photographs")
    if options.files is None:
        return _of_file(options)
    names = {k: getattr(options, k) for k in ("files", "first", "order", "white", "black")}
    usual = {"steps": [8], "axis": "column", "unwrap": "mf", "shift": 1}
    for name, value in usual.items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    return chosen(options, **names)


def _of_file(options):
    """Patterns of a file; --shift may turn their direction, nothing else is taken beside it."""
    from fpputil.capture.patterns import Patterns
    from fpputil.capture.photographs import of_folder

    beside = [n for n in ("pitches", "steps", "axis", "unwrap") if getattr(options, n) is not None]
    if beside:
        raise ValueError(
            f"--{beside[0]} without --files given; a pattern file tells it, or --files and all "
            "the others do"
        )
    file = options.patterns
    found = of_folder(options.folder) if file is None else Patterns.load(file)
    return found if options.shift is None else replace(found, shift=options.shift)


def _say(options, result) -> None:
    if options.json:
        print(json.dumps(result.summary))
        return
    for axis, numbers in result.summary["numbers"].items():
        share, sigma = numbers["pixels in the mask"], numbers["uncertainty of the phase, median"]
        print(f"{axis}s: {share} in the mask, uncertainty {sigma} (median)")
    for finding in result.findings:
        kind = "error" if finding.severe else "note"
        print(f"{kind}: {finding.message}; {finding.remedy}", file=sys.stderr)
    if result.points is not None:
        print(f"{result.summary['points']} points in {result.out / 'points.ply'}")
    elif options.system is None:
        print("no --system given: phases, but no depth and no points")
    if not result.summary["decoded"]:
        print("the phases are wrong and were not written; --accept writes them", file=sys.stderr)
    print(f"written to {result.out}")
