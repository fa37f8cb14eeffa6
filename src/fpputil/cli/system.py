"""`fpp system`: what a camera and a projector measure, in numbers and in a picture (chapter 2)."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np

CORNERS = {f"{v} {u}": (a, b) for v, a in (("top", 0), ("bottom", -1))
           for u, b in (("left", 0), ("right", -1))}  # fmt: skip
SAMPLES = 400  # of a side of the drawing


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    system = commands.add_parser("system", help="show, convert or draw a camera and its projector")
    verbs = system.add_subparsers(title="commands", required=True, metavar="COMMAND")
    show = verbs.add_parser(
        "show",
        help="sizes, poses, measuring range, and how many columns a millimetre of depth is",
        description="Lengths in millimetres, angles in degrees, the rest in pixels. Seen from the "
        "camera: x right, y down, z forward.",
    )
    show.add_argument("--json", action="store_true", help="the same as one JSON object")
    show.set_defaults(run=_show)
    convert = verbs.add_parser("convert", help="write it as .json, or as .yml for OpenCV")
    convert.set_defaults(run=_convert)
    draw = verbs.add_parser("draw", help="top view and side view, with fields of view, as PNG")
    draw.set_defaults(run=_draw)
    for verb in (show, convert, draw):
        verb.add_argument("system", metavar="SYSTEM", help="tiny, small, paper, or a file: .json, "
                          ".yml, .yaml")  # fmt: skip
    for verb, name in ((convert, "FILE"), (draw, "FILE.png")):
        verb.add_argument("file", metavar=name, type=Path)
        verb.add_argument("--force", action="store_true", help="replace a file that is there")


def _show(options) -> None:
    from fpputil.optics.system import load_system

    about = describe(load_system(options.system))
    if options.json:
        print(json.dumps(_finite(about), indent=1))
    else:
        print("\n".join(f"{name:32} {value}" for name, value in _rows(about)))


def _convert(options) -> None:
    from fpputil.optics.system import load_system

    system = load_system(options.system)
    _free(options.file, options.force)
    system.save(options.file)
    print(f"{options.system} is in {options.file}")


def _draw(options) -> None:
    from fpputil.files import write_whole
    from fpputil.optics.system import load_system

    if options.file.suffix != ".png":
        raise ValueError(f"{options.file.name} given; a picture ends in .png")
    system = load_system(options.system)
    _free(options.file, options.force)
    picture = io.BytesIO()
    draw(system).savefig(picture, format="png")
    write_whole(options.file, picture.getvalue())
    print(f"{options.system} is drawn in {options.file}")


def _free(file: Path, force: bool) -> None:
    if file.exists() and not force:
        raise ValueError(f"{file} given; it is there already, --force replaces it")


def describe(system) -> dict:
    """What `fpp system show` says, as plain numbers; NaN where there is no such number."""
    return {
        "camera": _lens(system.camera),
        "projector": _lens(system.projector),
        "projector_from_camera": _pose(system),
        "axes_nearest": _nearest(system),
        "measuring_range_mm": [system.z_min, system.z_max],
        "field_of_view_mm": {f"{z:g}": _field(system, z) for z in (system.z_min, system.z_max)},
        "columns_per_mm": _sensitivity(system),
    }


def _sensitivity(system) -> dict:
    """Columns a millimetre of depth in the middle of the range: centre, corners, share of few."""
    from fpputil.learning.metrics import LEAST_SENSITIVITY

    middle = (system.z_min + system.z_max) / 2
    columns = system.columns_per_mm(middle)
    places = {"centre": tuple(n // 2 for n in columns.shape), **CORNERS}
    known = columns[np.isfinite(columns)]
    return {
        "depth_mm": middle,
        **{name: float(columns[at]) for name, at in places.items()},
        "too_few": LEAST_SENSITIVITY,
        "share_of_too_few": float(np.mean(known < LEAST_SENSITIVITY)) if known.size else np.nan,
    }


def _lens(pinhole) -> dict:
    K = pinhole.K
    return {
        "size_px": [pinhole.width, pinhole.height],
        "focal_px": [K[0, 0], K[1, 1]],
        "principal_point_px": [K[0, 2], K[1, 2]],
        "distortion": pinhole.distortion.tolist(),
    }


def _axis(system):
    """Centre (mm) and direction of the projector's axis, seen from the camera."""
    camera, projector = system.camera, system.projector
    return camera.R @ projector.centre + camera.t, camera.R @ projector.R[2]


def _pose(system) -> dict:
    """Where the projector stands, and the turns about y, x and z, in this order, that it makes."""
    from scipy.spatial.transform import Rotation

    centre, _ = _axis(system)
    R = system.camera.R @ system.projector.R.T
    angles = Rotation.from_matrix(R).as_euler("YXZ", degrees=True).tolist()
    return {
        "position_mm": centre.tolist(),
        "baseline_mm": float(np.linalg.norm(centre)),
        **dict(zip(("yaw_deg", "pitch_deg", "roll_deg"), angles, strict=True)),
    }


def _nearest(system) -> dict:
    """Depth at which the optical axes come nearest, and how near; NaN if they are parallel."""
    centre, ahead = _axis(system)
    across = np.cross([0, 0, 1], ahead)
    if np.linalg.norm(across) < 1e-9:
        return {"depth_mm": np.nan, "gap_mm": float(np.hypot(*centre[:2]))}
    depth = np.linalg.det([centre, ahead, across]) / (across @ across)
    gap = abs(centre @ across) / np.linalg.norm(across)
    return {"depth_mm": float(depth), "gap_mm": float(gap)}


def _field(system, z) -> list[float]:
    """Width and height of what the camera sees at depth z, mm, through its middle."""
    camera, w, h = system.camera, system.camera.width, system.camera.height
    u, v = (w - 1) / 2, (h - 1) / 2
    ends = np.array([(-0.5, v), (w - 0.5, v), (u, -0.5), (u, h - 0.5)])
    x0, x1, y0, y1 = z * (camera.rays(ends) @ camera.R.T)
    return [float(x1[0] - x0[0]), float(y1[1] - y0[1])]


def _finite(value):
    """The same with None for NaN, as JSON has it."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and np.isnan(value) else value


def _rows(about):
    """Name and value of each line that `fpp system show` prints."""
    for name in ("camera", "projector"):
        lens = about[name]
        yield f"{name}, pixels", "{} x {}".format(*lens["size_px"])
        yield "  focal lengths, pixels", "{:.2f}, {:.2f}".format(*lens["focal_px"])
        yield "  principal point, pixels", "{:.2f}, {:.2f}".format(*lens["principal_point_px"])
        yield "  distortion", " ".join(f"{k:.5g}" for k in lens["distortion"]) or "none"
    pose, near, slope = (
        about[k] for k in ("projector_from_camera", "axes_nearest", "columns_per_mm")
    )
    x, y, z = (round(length, 2) + 0.0 for length in pose["position_mm"])  # no -0.0
    yaw, tilt, roll = (round(pose[f"{k}_deg"], 3) + 0.0 for k in ("yaw", "pitch", "roll"))
    yield "projector seen from the camera", f"{x:g} right, {y:g} down, {z:g} mm forward"
    yield "  turned, degrees", f"{yaw:g} right, {tilt:g} up, {roll:g} clockwise"
    yield "  baseline, mm", f"{pose['baseline_mm']:.2f}"
    where = f"{near['depth_mm']:.1f} mm from the camera, {near['gap_mm']:.2f} mm apart"
    yield "optical axes nearest", where if np.isfinite(near["depth_mm"]) else "nowhere, parallel"
    yield "measuring range, mm", "{:g} to {:g}".format(*about["measuring_range_mm"])
    for z, (width, height) in about["field_of_view_mm"].items():
        yield f"field of view at {z} mm", f"{width:.1f} x {height:.1f} mm"
    yield "columns a mm of depth, at", f"{slope['depth_mm']:g} mm"
    for name in ("centre", *CORNERS):
        yield f"  {name}", f"{slope[name]:.4f}"
    yield f"  below {slope['too_few']}", f"{slope['share_of_too_few']:.1%} of the pixels"


def draw(system):
    """Top view and side view, mm, as a matplotlib Figure without a window."""
    from matplotlib.figure import Figure

    from fpputil import plotting  # noqa: F401  its style

    figure = Figure(figsize=(10, 5.5), layout="constrained")
    top, beside = figure.subplots(1, 2)
    _view(top, system, 0, lambda x, z: (x, z))
    _view(beside, system, 1, lambda y, z: (z, y))
    top.set(title="from above", xlabel="x (right), mm", ylabel="z (forward), mm")
    beside.set(title="from the left", xlabel="z (forward), mm", ylabel="y (down), mm")
    beside.invert_yaxis()
    figure.suptitle("grey: measuring range; green: seen and lit, in the plane of the camera's axis")
    return figure


def _view(ax, system, side, place) -> None:
    """All of a system projected along y (side 0) or x (side 1); `place` orders coordinates."""
    from fpputil.plotting import COLOURS

    camera, reach = system.camera, 1.1 * system.z_max
    for pinhole, name, colour in zip(
        (system.projector, camera), ("projector", "camera"), COLOURS[1::-1], strict=True
    ):
        centre = camera.R @ pinhole.centre + camera.t
        ends = _border(pinhole, camera, centre, reach)
        low, high = ends[np.nanargmin(ends[:, side])], ends[np.nanargmax(ends[:, side])]
        lines = np.array([low, centre, high])
        ax.plot(*place(lines[:, side], lines[:, 2]), "-", color=colour)
        ax.plot(*place(centre[side], centre[2]), "o", color=colour)
        ax.annotate(name, place(centre[side], centre[2]), (8, 4), textcoords="offset points")
    span = np.array([low[side], high[side]]) * 1.2
    (ax.axhspan, ax.axvspan)[side](system.z_min, system.z_max, color="0.7", alpha=0.3, lw=0)
    across, z = np.meshgrid(np.linspace(*span, SAMPLES), np.linspace(system.z_min, system.z_max))
    both = _shared(system, side, across, z)
    ax.contourf(*place(across, z), both, [0.5, 1.5], colors=[COLOURS[2]], alpha=0.4)
    ax.set_aspect("equal")


def _border(pinhole, camera, centre, reach) -> np.ndarray:
    """Where the rays of the corners end, (4, 3) mm, seen from the camera: at the depth `reach`."""
    w, h = pinhole.width - 0.5, pinhole.height - 0.5
    rays = pinhole.rays(np.array([(-0.5, -0.5), (w, -0.5), (-0.5, h), (w, h)])) @ camera.R.T
    ahead = rays[:, 2:] > 0.1 * np.linalg.norm(rays, axis=1, keepdims=True)
    scale = np.where(ahead, (reach - centre[2]) / rays[:, 2:], reach)
    return centre + scale * rays


def _shared(system, side, across, z) -> np.ndarray:
    """Which points of the plane through the camera's axis are both seen and lit, 0 or 1."""
    points = np.zeros((*z.shape, 3))
    points[..., side], points[..., 2] = across, z
    points = (points - system.camera.t) @ system.camera.R
    parts = system.camera, system.projector
    return np.all([p.inside(p.project(points)) for p in parts], axis=0).astype(float)
