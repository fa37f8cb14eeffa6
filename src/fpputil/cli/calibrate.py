"""`fpp calibrate`: camera and projector from photographs of a board with fringes on it (ch. 12)."""

import json as jsons
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from fpputil import calibration, capture
from fpputil.cli.options import (
    FRINGES,
    TARGET,
    Force,
    Fringes,
    Json,
    Size,
    Target,
    Unit,
    free,
    millimetres,
    option,
)
from fpputil.cli.photographs import FILES, LEVELS, Files, LevelOptions, patterns_of

LEAST = 1.0  # mm, below which a length without its unit is asked about


def calibrate(
    folder: Annotated[Path, option("Of the poses.")],
    system: Annotated[Path, option("A .json or .yml file, new.")],
    /,
    *,
    board: Annotated[Size, option("Points across and down, as 11x8.")],
    reach: Annotated[tuple[float, float], option("Measured, near and far.", name="--range")],
    unit: Unit = None,
    target: Target = TARGET,
    lens: Annotated[int, option("Camera's distortion: 0, 1, 2, 4 or 5 of k1 k2 p1 p2 k3.")] = 4,
    projector_lens: Annotated[int | None, option("Likewise; 0 of fringes along one axis.")] = None,
    accept: Annotated[bool, option("Take poses whose phases are wrong all the same.")] = False,
    force: Force = False,
    json: Json = False,
    levels: LevelOptions = LEVELS,
    names: Files = FILES,
    fringes: Fringes = FRINGES,
) -> None:
    """Calibrate a camera and a projector.

    FOLDER holds a folder for each pose of the board, ten or more, tilted by 25 to 40 degrees in
    all directions, out to the picture's edges; in each the photographs of fringes along columns
    and rows (`fpp patterns --axis both`), or along one of them, with which the system then
    measures. Hidden folders, and those that `fpp decode` wrote, are passed over; a bad pose is
    left out by name. The projector may hang in any way; decode with the --shift that was
    calibrated with. Lengths in the system are mm, whatever --unit says of those given.
    """
    square, *reach = millimetres(unit, LEAST, square=target.square, range=reach[0], far=reach[1])
    printed = target.board(*board, square)
    free(system, force)
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} given; there is no such folder")
    folders = [path for path in sorted(folder.iterdir()) if path.is_dir() and not foreign(path)]
    if not folders:
        raise ValueError(f"{folder} given; it holds no folder, and a pose is a folder")
    if names.files is not None and fringes.axis is None:
        fringes = replace(fringes, axis="both")
    how = {**levels.how(), "accept": accept}
    poses, sizes, unread = [], set(), {}
    for path in folders:
        try:
            pose, size = capture.board_pose(path, patterns_of(path, names, fringes), **how)
        except (ValueError, OSError) as error:  # one bad pose does not cost the others
            unread[path.name] = str(error)
            continue
        poses.append(pose)
        sizes.add(size)
    if len(sizes) > 1:
        raise ValueError(f"projectors of {sorted(sizes)} pixels given; all poses need one")
    lenses = {"lens": lens, "projector_lens": projector_lens}
    fit = calibration.calibrate(printed, poses, *sizes or [None], *reach, unread=unread, **lenses)
    free(system, force)  # once more: calibrating takes its time
    fit.system.save(system)
    if json:
        names = ("camera_errors", "projector_errors", "rejected", "sigma", "warnings")
        print(jsons.dumps({name: getattr(fit, name) for name in names}))
    else:
        _print(fit)
        taken = f"--square {target.square:g} was taken for {unit or 'mm'}"
        print(f"written to {system}, lengths in mm ({taken})")


def foreign(folder: Path) -> bool:
    """Whether a folder is no pose: hidden, another program's, or what `fpp decode` wrote."""
    from fpputil.capture.photographs import is_foreign

    return is_foreign(folder.name) or (folder / "summary.json").is_file()


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
