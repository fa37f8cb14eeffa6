"""`fpp patterns`: the pictures to project, and the file that tells how to decode them (ch. 12)."""

from __future__ import annotations

import json
import re
from argparse import ArgumentTypeError
from pathlib import Path


def size(text: str) -> tuple[int, int]:
    """The size "912x1140" as (width, height), for `argparse`."""
    found = re.fullmatch(r"([1-9][0-9]{0,5})x([1-9][0-9]{0,5})", text)
    if not found:
        raise ArgumentTypeError(f"size {text!r} given; WIDTHxHEIGHT is needed, as 912x1140")
    return int(found[1]), int(found[2])


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    patterns = commands.add_parser(
        "patterns",
        help="write the pictures to project",
        description="Writes a PNG for each pattern, numbered in the order in which to show them, "
        "and patterns.toml. Photograph each, keep the photographs under the same names in a folder "
        "beside a copy of patterns.toml, and `fpp decode` that folder.",
    )
    patterns.add_argument("out", metavar="OUT", type=Path, help="new folder")
    patterns.add_argument("--projector", type=size, default=(912, 1140), metavar="WxH",
                          help="pixels (default 912x1140)")  # fmt: skip
    add_fringes(patterns)
    patterns.add_argument("--no-plain", action="store_true", help="no white and black picture")
    patterns.add_argument("--force", action="store_true", help="replace OUT")
    patterns.add_argument("--json", action="store_true", help="print one JSON object")
    patterns.set_defaults(run=_patterns, go_on="nothing was written")


def add_fringes(parser) -> None:
    """Add the options that tell which fringes there are."""
    parser.add_argument("--pitches", type=float, nargs="+", metavar="P",
                        help="projector pixels a period, in the order of unwrapping (default for "
                        "mf: the longer side, an eighth and a forty-eighth of it)")  # fmt: skip
    parser.add_argument("--steps", type=int, nargs="+", default=[8], metavar="N",
                        help="of all pitches, or of each (default 8)")  # fmt: skip
    parser.add_argument("--axis", choices=("column", "row", "both"), default="column",
                        help="fringes along columns (vertical, default), rows, or both, which "
                        "calibration needs")  # fmt: skip
    parser.add_argument("--unwrap", default="mf", help="mf (default), mw, nt or minimum")
    parser.add_argument("--shift", type=int, default=1, choices=(1, -1),
                        help="sign of the phase shift (default 1)")  # fmt: skip


def chosen(options, **names):
    """`Patterns` of the options of `add_fringes`."""
    from fpputil.capture.measurement import unwrapper
    from fpputil.capture.patterns import Patterns
    from fpputil.optics.fringes import fringe_set

    side = max(options.projector)
    if options.pitches is None and options.unwrap not in ("mf", "minimum"):
        raise ValueError(f"unwrap {options.unwrap!r} without --pitches given; name them")
    pitches = options.pitches or [side, side / 8, side / 48]
    pitches = [int(p) if p == int(p) else p for p in pitches]
    axes = ("column", "row") if options.axis == "both" else (options.axis,)
    steps = options.steps[0] if len(options.steps) == 1 else options.steps
    fringes = sum((fringe_set(pitches, steps, axis=axis) for axis in axes), ())
    found = Patterns(options.projector, fringes, options.unwrap, options.shift, **names)
    if found.unwrap != "minimum":  # whose pitches the system decides on
        for axis in axes:
            try:
                unwrapper(found, axis)
            except ValueError as error:
                raise ValueError(f"fringes along {axis}s: {error}") from error
    return found


def _patterns(options) -> None:
    import cv2

    from fpputil.capture.patterns import NAME
    from fpputil.files import folder_whole, write_whole

    plain = {} if options.no_plain else {"white": "000-white.png", "black": "001-black.png"}
    patterns = chosen(options, files="{number:03}-{axis}-{pitch}-{step:02}.png", **plain)
    shots = patterns.shots()
    with folder_whole(options.out, options.force) as folder:
        for shot in shots:
            done, data = cv2.imencode(".png", patterns.picture(shot))
            write_whole(folder / shot.file, data.tobytes())
        patterns.save(folder / NAME)
    if options.json:
        print(json.dumps({"folder": str(options.out), "files": [s.file for s in shots]}))
    else:
        width, height = patterns.projector
        print(f"{len(shots)} pictures of {width} x {height} and {NAME} in {options.out}")
        print(f"to be shown in the order of their names, {shots[0].file} first")
