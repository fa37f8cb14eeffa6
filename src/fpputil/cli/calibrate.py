"""`fpp calibrate`: camera and projector from photographs of a board with fringes on it (ch. 12)."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from fpputil.cli.patterns import size
from fpputil.cli.render import add_board


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    calibrate = commands.add_parser(
        "calibrate",
        help="calibrate a camera and a projector",
        description="FOLDER holds a folder for each pose of the board, ten or more, tilted by 25 "
        "to 40 degrees in all directions, out to the picture's edges; in each the photographs of "
        "fringes along columns and rows (`fpp patterns --axis both`).",
    )
    calibrate.add_argument("folder", metavar="FOLDER", type=Path)
    calibrate.add_argument("out", metavar="SYSTEM", type=Path, help="a .json or .yml file, new")
    calibrate.add_argument("--board", type=size, required=True, metavar="CxR",
                           help="points across and down, as 11x8")  # fmt: skip
    add_board(calibrate)
    calibrate.add_argument("--range", type=float, nargs=2, required=True, metavar=("NEAR", "FAR"),
                           help="measuring range of the system, mm")  # fmt: skip
    calibrate.add_argument("--patterns", type=Path, metavar="FILE",
                           help="of all poses (default: one in each folder)")  # fmt: skip
    calibrate.add_argument("--lens", type=int, default=4, metavar="N",
                           help="distortion of the camera: 0, 1, 2, 4 (default) or 5 of "
                           "k1 k2 p1 p2 k3")  # fmt: skip
    calibrate.add_argument("--projector-lens", type=int, default=4, metavar="N", help="likewise")
    calibrate.add_argument("--force", action="store_true", help="replace SYSTEM")
    calibrate.add_argument("--json", action="store_true", help="print one JSON object")
    calibrate.set_defaults(run=_calibrate, go_on="nothing was written")


def _calibrate(options) -> None:
    from fpputil.calibration.board import Board
    from fpputil.calibration.zhang import calibrate
    from fpputil.capture.folder import board_pose
    from fpputil.capture.patterns import Patterns

    board = Board(*options.board, options.square, options.kind)
    if options.out.exists() and not options.force:
        raise ValueError(f"{options.out} is there already; name another file, or use --force")
    shared = None if options.patterns is None else Patterns.load(options.patterns)
    if not options.folder.is_dir():
        raise FileNotFoundError(f"{options.folder} given; there is no such folder")
    folders = sorted(p for p in options.folder.iterdir() if p.is_dir())
    read = [board_pose(folder, shared) for folder in folders]
    if not read:
        raise ValueError(f"{options.folder} given; it holds no folder, and a pose is a folder")
    projectors = {projector for _, projector in read}
    if len(projectors) > 1:
        raise ValueError(f"projectors of {sorted(projectors)} pixels given; all poses need one")
    found = calibrate(
        board, [pose for pose, _ in read], projectors.pop(), *options.range,
        lens=options.lens, projector_lens=options.projector_lens,
    )  # fmt: skip
    found.system.save(options.out)
    _say(options, found)


def _say(options, found) -> None:
    if options.json:
        names = ("camera_errors", "projector_errors", "rejected", "sigma", "warnings")
        print(json.dumps({name: getattr(found, name) for name in names}))
        return
    print(f"{'pose':20}{'camera, px':>12}{'projector, px':>15}")
    for name, error in found.camera_errors.items():
        print(f"{name:20}{error:12.3f}{found.projector_errors[name]:15.3f}")
    for name, reason in found.rejected.items():
        print(f"{name:20} left out: {reason}")
    for who in ("camera", "projector"):
        K = getattr(found.system, who).K
        shown = ("fx", K[0, 0]), ("fy", K[1, 1]), ("cx", K[0, 2]), ("cy", K[1, 2])
        values = (f"{n} {v:.2f} +-{found.sigma[f'{who} {n}']:.2f}" for n, v in shown)
        print(f"{who}: {', '.join(values)} px")
    baseline = float((found.system.projector.centre**2).sum() ** 0.5)
    print(f"baseline {baseline:.3f} +-{found.sigma['baseline']:.3f} mm")
    for warning in found.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    print(f"written to {options.out}")
