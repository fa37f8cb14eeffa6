"""`fpp calibrate`: camera and projector from photographs of a board with fringes on it (ch. 12)."""

import json as jsons
import sys
from pathlib import Path
from typing import Annotated

from fpputil import calibration, capture
from fpputil.cli.options import Force, Json, Kind, Size, Square, free, option


def calibrate(
    folder: Annotated[Path, option("Of the poses.")],
    system: Annotated[Path, option("A .json or .yml file, new.")],
    /,
    *,
    board: Annotated[Size, option("Points across and down, as 11x8.")],
    reach: Annotated[tuple[float, float], option("Measured, near and far, mm.", name="--range")],
    square: Square = 25.0,
    kind: Kind = "chessboard",
    patterns: Annotated[Path | None, option("Of all poses (default: one in each folder).")] = None,
    lens: Annotated[int, option("Camera's distortion: 0, 1, 2, 4 or 5 of k1 k2 p1 p2 k3.")] = 4,
    projector_lens: Annotated[int, option("Likewise.")] = 4,
    force: Force = False,
    json: Json = False,
) -> None:
    """Calibrate a camera and a projector.

    FOLDER holds a folder for each pose of the board, ten or more, tilted by 25 to 40 degrees in
    all directions, out to the picture's edges; in each the photographs of fringes along columns
    and rows (`fpp patterns --axis both`). The projector may hang in any way; decode with the
    --shift that was calibrated with. A bad pose is left out by name.
    """
    target = calibration.Board(*board, square, kind)
    free(system, force)
    shared = None if patterns is None else capture.Patterns.load(patterns)
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} given; there is no such folder")
    folders = [path for path in sorted(folder.iterdir()) if path.is_dir()]
    if not folders:
        raise ValueError(f"{folder} given; it holds no folder, and a pose is a folder")
    poses, sizes, unread = [], set(), {}
    for path in folders:
        try:
            pose, size = capture.board_pose(path, shared)
        except (ValueError, OSError) as error:  # one bad pose does not cost the others
            unread[path.name] = str(error)
            continue
        poses.append(pose)
        sizes.add(size)
    if len(sizes) > 1:
        raise ValueError(f"projectors of {sorted(sizes)} pixels given; all poses need one")
    lenses = {"lens": lens, "projector_lens": projector_lens}
    fit = calibration.calibrate(target, poses, *sizes or [None], *reach, unread=unread, **lenses)
    free(system, force)  # once more: calibrating takes its time
    fit.system.save(system)
    if json:
        names = ("camera_errors", "projector_errors", "rejected", "sigma", "warnings")
        print(jsons.dumps({name: getattr(fit, name) for name in names}))
    else:
        _print(fit)
        print(f"written to {system}")


def _print(fit) -> None:
    print(f"{'pose':20}{'camera, px':>12}{'projector, px':>15}")
    for name, error in fit.camera_errors.items():
        print(f"{name:20}{error:12.3f}{fit.projector_errors[name]:15.3f}")
    for name, reason in fit.rejected.items():
        print(f"{name:20} left out: {reason}")
    for who in ("camera", "projector"):
        K = getattr(fit.system, who).K
        numbers = {"fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2]}
        texts = (f"{n} {v:.2f} +-{fit.sigma[f'{who} {n}']:.2f}" for n, v in numbers.items())
        print(f"{who}: {', '.join(texts)} px")
    baseline = float((fit.system.projector.centre**2).sum() ** 0.5)
    print(f"baseline {baseline:.3f} +-{fit.sigma['baseline']:.3f} mm")
    for warning in fit.warnings:
        print(f"warning: {warning}", file=sys.stderr)
