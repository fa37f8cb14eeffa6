"""`fpp system`: what a camera and a projector measure, in numbers (chapter 2)."""

import json as jsons
from pathlib import Path
from typing import Annotated

from cyclopts import App

from fpputil import optics
from fpputil.cli.options import (
    SEVERAL,
    UNITS,
    Force,
    Json,
    Size,
    System,
    Unit,
    free,
    millimetres,
    option,
)

LEAST = 1.0  # mm, below which a length without its unit is asked about
New = Annotated[Path, option("New.")]
app = App("system", help_format="markdown", help="Show or convert a camera and its projector.")


@app.command
def show(system: System, /, *, json: Json = False) -> None:
    """Sizes, poses, measuring range, and how many columns a millimetre of depth is.

    Lengths in millimetres, angles in degrees, the rest in pixels. Seen from the camera: x right,
    y down, z forward; yaw turns to the right, pitch up, roll clockwise.
    """
    numbers = describe(optics.load_system(system))
    if json:
        print(jsons.dumps(numbers, indent=1))
        return
    for part, values in numbers.items():
        for name, value in (values if isinstance(values, dict) else {"": values}).items():
            cells = value if isinstance(value, list) else [value]
            texts = ["none" if c is None else f"{round(c, 4) + 0.0:g}" for c in cells]  # no -0
            print(f"{f'{part} {name}'.replace('_', ' '):38} {', '.join(texts) or 'none'}")


@app.command
def convert(
    system: System,
    file: New,
    /,
    *,
    reach: Annotated[
        tuple[float, float] | None, option("Measured, near and far.", name="--range")
    ] = None,
    camera: Annotated[Size | None, option("Pixels of the photographs.")] = None,
    projector: Annotated[Size | None, option("Pixels.")] = None,
    more: Annotated[list[Path], option("Further files, as extrinsics.yml.", **SEVERAL)] = (),
    unit: Unit = None,
    force: Force = False,
) -> None:
    """Write it as .json, or as .yml for OpenCV.

    With --range SYSTEM is a file of another program, as OpenCV's samples write it (YAML, XML) or
    plain JSON: K and D of camera and projector, and R and T from the first to the second, under
    any usual name (M1 D1 M2 D2 R T, cam_K cam_kc proj_K proj_kc, cam1_intrinsics ...). What it
    lacks is given: the sizes of the pictures, the measuring range, the unit of T and range.
    """
    if reach is None:
        if others := given_names(camera=camera, projector=projector, more=more, unit=unit):
            raise ValueError(f"--{others[0]} without --range given; a file of another needs both")
        rig = optics.load_system(system)
    else:
        rig = _of_others([Path(system), *more], camera, projector, reach, unit)
    free(file, force)
    rig.save(file)
    print(f"{system} is in {file}")


def given_names(**options) -> list[str]:
    """Names of the options that were given."""
    return [name for name, value in options.items() if value]


def _of_others(files: list[Path], camera, projector, reach, unit: str | None):
    from fpputil.checks import one_line
    from fpputil.optics.opencv_files import matrices_of, read_entries
    from fpputil.optics.system import assemble_system

    near, far = millimetres(unit, LEAST, range=reach[0], far=reach[1])
    entries: dict = {}
    for file in files:
        if not file.is_file():
            raise FileNotFoundError(f"{file} given; there is no such system file")
        try:
            entries |= read_entries(file)
        except Exception as error:  # OpenCV's parser has errors of its own
            reason = one_line(error)
            raise ValueError(f"{file} is cut, or no YAML, XML or JSON ({reason})") from error
    if "z_min" in entries:
        raise ValueError(f"--range given; {files[0]} is a system already and has one")
    try:
        return assemble_system(
            matrices_of(entries), camera, projector, near, far, UNITS[unit or "mm"]
        )
    except ValueError as error:
        raise ValueError(f"{', '.join(map(str, files))}: {error}") from error


def describe(system) -> dict:
    """What `fpp system show` says, as plain numbers; None where there is no such number."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    from fpputil.learning.metrics import LEAST_SENSITIVITY

    camera, projector, depths = system.camera, system.projector, (system.z_min, system.z_max)
    to_camera = camera.R @ projector.R.T
    centre, ahead = camera.R @ projector.centre + camera.t, to_camera[:, 2]
    angles = Rotation.from_matrix(to_camera).as_euler("YXZ", degrees=True).tolist()
    across = np.cross([0, 0, 1], ahead)
    if np.linalg.norm(across) > 1e-9:  # where the optical axes come nearest
        nearest = float(np.linalg.det([centre, ahead, across]) / (across @ across))
        gap = float(abs(centre @ across) / np.linalg.norm(across))
    else:  # nowhere: they are parallel
        nearest, gap = None, float(np.hypot(*centre[:2]))
    w, h, u, v = camera.width, camera.height, (camera.width - 1) / 2, (camera.height - 1) / 2
    middles = np.array([(-0.5, v), (w - 0.5, v), (u, -0.5), (u, h - 0.5)])
    left, right, top, bottom = camera.rays(middles) @ camera.R.T
    width, height = right[0] - left[0], bottom[1] - top[1]
    columns = system.columns_per_mm(sum(depths) / 2)
    corners = {"top left": (0, 0), "top right": (0, -1), "bottom left": (-1, 0)}
    places = {"centre": (h // 2, w // 2), **corners, "bottom right": (-1, -1)}
    lit = columns[np.isfinite(columns)]

    def number(value):
        return float(value) if np.isfinite(value) else None

    return {
        "camera": _lens(camera),
        "projector": _lens(projector),
        "projector_from_camera": {
            "position_mm": centre.tolist(),
            "baseline_mm": float(np.linalg.norm(centre)),
            **dict(zip(("yaw_deg", "pitch_deg", "roll_deg"), angles, strict=True)),
        },
        "axes_nearest": {"depth_mm": nearest, "gap_mm": gap},
        "measuring_range_mm": list(depths),
        "field_of_view_mm": {f"{z:g}": [float(z * abs(width)), float(z * height)] for z in depths},
        "columns_per_mm": {
            "depth_mm": sum(depths) / 2,
            **{name: number(columns[place]) for name, place in places.items()},
            "too_few": LEAST_SENSITIVITY,
            "share_of_too_few": float(np.mean(lit < LEAST_SENSITIVITY)) if lit.size else None,
        },
    }


def _lens(pinhole) -> dict:
    return {
        "size_px": [pinhole.width, pinhole.height],
        "focal_px": pinhole.K.diagonal()[:2].tolist(),
        "principal_point_px": pinhole.K[:2, 2].tolist(),
        "distortion": pinhole.distortion.tolist(),
    }
