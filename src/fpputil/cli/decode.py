"""`fpp decode`: a folder of photographs to phases, depth and points (chapter 12)."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import replace
from pathlib import Path

from fpputil.cli.patterns import add_fringes, chosen, size


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    decode = commands.add_parser(
        "decode",
        help="decode a folder of photographs",
        description="Writes decoded.npz, 16-bit TIFF files, report.html and summary.json, with "
        "--system also points.ply and the depth. If the capture is wrong in a way that would give "
        "wrong phases (direction of the shift, swapped or missing photographs, a saturated "
        "projector ...), only report and summary are written, and the exit code is 1.",
    )
    decode.add_argument("folder", metavar="FOLDER", type=Path)
    decode.add_argument("--out", type=Path, metavar="OUT",
                        help="new folder (default FOLDER-decoded)")  # fmt: skip
    decode.add_argument("--system", metavar="S", help="a calibrated system, for millimetres")
    decode.add_argument("--power", default="auto", metavar="G",
                        help="raise the grey levels to it, to make the response linear (default "
                        "auto: where some pitch has fewer than five steps and another one tells "
                        "it)")  # fmt: skip
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
    from tqdm.std import tqdm

    from fpputil.capture.diagnosis import diagnose
    from fpputil.capture.measurement import measure
    from fpputil.capture.photographs import open_capture
    from fpputil.checks import positive
    from fpputil.files import folder_whole
    from fpputil.optics.system import load_system

    start = time.perf_counter()
    power = None if options.power == "auto" else positive("power", _number(options.power))
    system = None if options.system is None else load_system(options.system)
    capture = open_capture(options.folder, _given(options), options.full)
    out = options.out or options.folder.with_name(f"{options.folder.absolute().name}-decoded")
    how = {"threshold": options.threshold, "power": power, "noise": options.noise}
    with folder_whole(out, options.force) as folder:
        total = sum(f.steps for f in capture.patterns.fringes)
        with tqdm(total=total, unit="photo", leave=False, disable=options.json or None) as bar:
            scans = [measure(capture, axis, system=system, each=bar.update, **how)
                     for axis in capture.patterns.axes]  # fmt: skip
        found = [d for s in scans for d in diagnose(s, capture)]
        wrong = any(d.severe for d in found) and not options.accept
        about = _write(folder, options, capture, scans, found, None if wrong else system, wrong)
        about["seconds"] = round(time.perf_counter() - start, 2)
        (folder / "summary.json").write_text(json.dumps(about, indent=1) + "\n")
    _say(options, out, about, found)
    return 1 if wrong else 0


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"power {text!r} given; a positive number or auto is needed") from None


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


def _write(folder, options, capture, scans, found, system, wrong) -> dict:
    """Write all products of a decoding; returns what summary.json says."""
    import numpy as np

    from fpputil.capture import products
    from fpputil.capture.report import page, report_numbers
    from fpputil.files import write_arrays

    about = {
        "decoded": not wrong,
        "doubts": [d._asdict() for d in found],
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
                colours = np.repeat(vertical[0].average.astype(np.uint8)[..., None], 3, axis=2)
            about["points"] = products.save_points(folder / "points.ply", points, colours, sigma)
            arrays |= {"depth": depth.astype("f4"), "depth_sigma": sigma.astype("f4")}
        write_arrays(folder / "decoded.npz", arrays, compress=False)
        if not options.no_pictures:
            about["tiff"] = products.save_pictures(folder, arrays)
    if not options.no_report:
        title = f"Decoding of {options.folder.absolute().name}"
        (folder / "report.html").write_text(page(title, scans, found, depth))
    return about


def _say(options, out, about, found) -> None:
    if options.json:
        print(json.dumps(about))
        return
    for axis, numbers in about["numbers"].items():
        print(f"{axis}s: {numbers['pixels in the mask']} in the mask, uncertainty "
              f"{numbers['uncertainty of the phase, median']} (median)")  # fmt: skip
    for doubt in found:
        kind = "error" if doubt.severe else "note"
        print(f"{kind}: {doubt.found}; {doubt.remedy}", file=sys.stderr)
    if "points" in about:
        print(f"{about['points']} points in {out / 'points.ply'}")
    elif options.system is None:
        print("no --system given: phases, but no depth and no points")
    if not about["decoded"]:
        print("the phases are wrong and were not written; --accept writes them", file=sys.stderr)
    print(f"written to {out}")
