"""The figures of several chapters that a reader plays with, held to the library by their checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import trimesh
from scipy.special import ndtr

from fpputil.decoding.geometric_constraint import minimum_phase
from fpputil.decoding.phase import modulation, numerator_denominator, wrapped_phase
from fpputil.decoding.pointcloud import fit_sphere
from fpputil.decoding.triangulation import triangulate
from fpputil.decoding.unwrap import wrap
from fpputil.interactive.live import Live, colours, explore, pack, slider, space
from fpputil.optics.fringes import Fringe
from fpputil.optics.pinhole import Pinhole
from fpputil.optics.system import Pitches, System, preset
from fpputil.plotting import frustum

HERE = Path(__file__).parent


def plan(instead_of: str = "", z: float = 660.0, u: float = 320.0) -> Live:
    """Camera, projector and a wall from above; the point on the wall can be dragged. Chapter 2."""
    system = preset("paper").system
    data = {name: _line(pinhole) for name, pinhole in _pair(system)}
    data |= {"ahead": round(float(system.projector.centre[2]), 6), "pitch": 57}
    data |= {"dead": 0.1, "red": [192, 57, 43] * 256}
    settings = [(660, 320, 45, 5), (500, 100, 45, 5), (800, 500, 120, 10), (600, 320, -80, -8)]
    keys = ("z", "u", "baseline", "angle")
    checks = [(dict(zip(keys, s, strict=True)), _planned(system, *s)) for s in settings]
    controls = [
        slider("z", "depth z", 300, 880, z, 1, "mm"),
        slider("u", "camera pixel u", 0, 639, u),
        slider("baseline", "projector at x", -200, 200, 45, 1, "mm"),
        slider("angle", "projector turned", -20, 20, 5, 0.5, "°"),
    ]
    return explore(controls, _formula("plan"), data, checks, instead_of)


def _pair(system: System) -> tuple[tuple[str, Pinhole], ...]:
    return ("camera", system.camera), ("projector", system.projector)


def _line(pinhole: Pinhole) -> dict:
    """A pinhole as one row of pixels."""
    return {"focal": pinhole.K[0, 0], "centre": pinhole.K[0, 2], "width": pinhole.width}


def _planned(system: System, z, u, baseline, angle) -> dict:
    """Numbers of `plan`, by the library."""
    a, centre = np.radians(angle), np.array([baseline, 0, system.projector.centre[2]])
    R = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    moved = replace(system, projector=replace(system.projector, R=R, t=-R @ centre))
    ray = system.camera.rays(np.array([u, system.camera.K[1, 2]]))
    near, here, far = (moved.projector.project(ray * d)[0] for d in (z - 0.1, z, z + 0.1))
    return {"column": here, "columns per mm": abs(far - near) / 0.2, "depth": z}


def phasor(instead_of: str = "") -> Live:
    """One pixel: its samples, their arrows head to tail, and their sum. Chapter 3."""
    keys = ("N", "phi", "ambient", "strength", "gamma")
    settings = [
        (4, 0.8, 20, 80, 1),
        (3, 2.5, 20, 80, 1.6),
        (15, 5.0, 60, 40, 1),
        (8, 4.0, 5, 90, 2),
    ]
    checks = [(dict(zip(keys, s, strict=True)) | {"sigma": 0}, _sampled(*s)) for s in settings]
    controls = [
        slider("N", "steps N", 3, 15, 4),
        slider("phi", "true phase", 0, 6.28, 0.8, 0.01, "rad"),
        slider("ambient", "ambient light", 0, 100, 20, 1, "levels"),
        slider("strength", "albedo x light", 0, 77, 60, 1, "levels"),
        slider("sigma", "noise", 0, 20, 2, 0.5, "levels"),
        slider("gamma", "gamma", 0.6, 2.4, 1, 0.05),
        slider("threshold", "threshold", 0, 60, 8, 1, "levels"),
        slider("seed", "another draw", 0, 99, 0, 1, play=400),
    ]
    return explore(controls, _formula("phasor"), {}, checks, instead_of)


def _sampled(N, phi, ambient, strength, gamma) -> dict:
    """Numbers of `phasor` without noise, by the library."""
    delta = 2 * np.pi * np.arange(N) / N
    light = ambient + strength * (1 + np.cos(phi + delta))
    levels = np.clip(np.floor(255 * (light / 255) ** gamma + 0.5), 0, 255)
    M, D = numerator_denominator(levels)
    return {"phase found": wrapped_phase(M, D), "modulation": modulation(M, D, N)}


LEVELS = ("256", "16", "4", "2")
FINE = (114, 76, 57, 38, 24, 15)  # pitches
BOX = (912, 304, 152, 114, 76)


def bench(instead_of: str = "") -> Live:
    """A fringe under pitch, step, grey levels, gamma and focus, column by column. Chapter 1."""
    keys = ("pitch", "n", "column", "gamma", "defocus", "levels")
    settings = [(114, 0, 431, 1, 0, 256), (15, 2, 200, 2.2, 0, 256), (60, 3, 77, 1, 4, 256)]
    settings += [(24, 5, 640, 1.8, 2, 16), (912, 7, 911, 1, 0, 2)]
    checks = [(dict(zip(keys, s, strict=True)), _lit(*s)) for s in settings]
    for values, _ in checks:
        values["levels"] = str(values["levels"])
    controls = [
        slider("pitch", "pitch (columns)", 4, 912, 114),
        slider("n", "step n", 0, 7, 0, play=500),
        slider("column", "column i", 0, 911, 431),
        slider("gamma", "gamma", 0.6, 2.4, 1, 0.05),
        slider("defocus", "blur (columns)", 0, 10, 0, 0.5),
        {
            "name": "levels",
            "label": "grey levels",
            "value": "256",
            "choices": ["256", "16", "4", "2"],
        },
    ]
    return explore(controls, _formula("bench"), {"steps": 8, "width": 912}, checks, instead_of)


def _lit(pitch, n, column, gamma, defocus, levels) -> dict:
    """Numbers of `bench`, by the library."""
    fringe = Fringe(pitch, 8, gamma=gamma, levels=levels, defocus=defocus)
    row, Phi = fringe.intensity(np.arange(912), n), np.asarray(fringe.phase(column))
    grey = np.floor(row + 0.5)
    found = {"light": row[column], "phase in its period": wrap(Phi[None])[0]}
    return found | {"absolute phase": Phi, "columns of this grey": (grey == grey[column]).sum()}


def vernier(instead_of: str = "") -> Live:
    """The order of a short pitch from a longer one, and how noise spoils it. Chapter 4."""
    settings = [(0.02, 5, False), (0.05, 5, True), (0.1, 3, True), (0.2, 1, False), (0.3, 0, True)]
    checks = [
        ({"sigma": s, "fine": k, "middle": m}, {"wrong, by the normal law": 100 * _rate(s, k, m)})
        for s, k, m in settings
    ]
    controls = [
        slider("column", "true column", 0, 911, 300),
        slider("sigma", "phase noise", 0.005, 0.3, 0.03, 0.005, "rad"),
        slider("fine", "short pitch", 0, len(FINE) - 1, 0, names=[str(p) for p in FINE]),
        {"name": "middle", "label": "pitch 114 between", "value": False},
        slider("seed", "another draw", 0, 99, 0, play=400),
    ]
    data = {"width": 912, "middle": 114, "fine": list(FINE)}
    return explore(controls, _formula("vernier"), data, checks, instead_of)


def _rate(sigma, fine, middle) -> float:
    """Share of wrong orders in `vernier` by the normal law: |ratio e_long - e_short| > pi."""
    pitches = np.array([912, *([114] if middle and FINE[fine] < 114 else []), FINE[fine]])
    spread = sigma * np.hypot(1, pitches[:-1] / pitches[1:])
    return float((2 * ndtr(-np.pi / spread)).sum())


COLOURED = ("stripes", "depth", "error")
ROOM = 5.0  # mm; what is further off counts as lost, and the colours of the error end there
STEPS = 15
PART = 1 / 64  # of a column


def cloud(
    mesh: trimesh.Trimesh,
    system: System,
    pitches: Pitches,
    look_from: Sequence[float],
    angle: float,
    stripe: float = 57.0,
    ball: bool = False,
    shown: Sequence[str] = (),
    alt: str = "",
    instead_of: str = "",
) -> Live:
    """A measured surface under sliding stripes, noise and a wrong focal length. Chapter 6.

    Parameters
    ----------
    mesh : Trimesh
        The surface as the camera sees it, mm; each vertex is one pixel's point.
    system, pitches
        What measures it.
    look_from, angle
        As of `space`, but from the middle of the surface on, which is looked at.
    stripe : float
        Pitch of the stripes that are shown, projector columns.
    ball : bool
        Whether the radius of a sphere through all points is told.
    shown : sequence of str
        The controls; empty for all.
    """
    camera, projector = system.camera, system.projector
    pixels = np.round(camera.project(mesh.vertices)).astype("u2")
    column = np.round(projector.project(mesh.vertices)[:, 0] / PART).astype("u2")
    middle = mesh.vertices.mean(axis=0)
    near, far = mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()
    data = {"u": pixels[:, 0], "v": pixels[:, 1], "pitches": list(pitches.descending)}
    data["column"] = pack(column, scale=PART)
    data["camera"] = {"f": camera.K[0, 0], "cx": camera.K[0, 2], "cy": camera.K[1, 2]}
    lens = {"f": projector.K[0, 0], "cx": projector.K[0, 2], "cy": projector.K[1, 2]}
    place = {"R": projector.R.round(12).tolist(), "t": projector.t.round(9).tolist()}
    data["projector"] = lens | place | {"height": projector.height}
    data |= {"near": round(near, 3), "far": round(far, 3), "room": ROOM, "ball": ball}
    data |= {"depths": colours("cividis_r"), "errors": colours("RdBu_r")}
    data |= {"stripe": stripe, "steps": STEPS}
    start = int(np.argmin(np.linalg.norm(mesh.vertices - middle, axis=1)))
    controls = [
        {"name": "colour", "label": "colours", "value": "stripes", "choices": list(COLOURED)},
        slider("step", "step of the stripes", 0, STEPS - 1, 0, play=120),
        slider("sigma", "phase noise", 0, 0.15, 0.01, 0.005, "rad"),
        {"name": "three", "label": f"pitch {pitches.mid:g} between", "value": True},
        slider("focal", "focal length of projector off", -1, 1, 0, 0.05, "%"),
        slider("over", "point", 0, len(mesh.vertices) - 1, start),
        slider("seed", "another draw", 0, 99, 0, play=400),
    ]
    data["fixed"] = {control["name"]: control["value"] for control in controls}
    controls = [control for control in controls if not shown or control["name"] in shown]
    settings = [{"sigma": 0, "focal": f, "over": k} for f, k in ((0, start), (0.5, 0), (-1, 99))]
    measured = partial(_pointed, pixels, PART * column, system, ball)
    checks = [(s, measured(s["focal"], s["over"])) for s in settings]
    rays = np.repeat([[0.0, 0, 0], middle], 5, axis=0)
    rays[:2] = [projector.centre, middle]
    bodies = [
        {"name": "surface", "mesh": mesh, "colour": "grey", "as_points": "points"},
        {"name": "ray and sheet of light", "points": rays, "lines": True, "colour": "darkorange"},
        {"name": "camera", "mesh": frustum(camera, 0.9 * near, 1.5), "colour": "grey"},
        {"name": "projector", "mesh": frustum(projector, 0.9 * near, 1.5), "colour": "goldenrod"},
    ]
    for body in bodies[1 if shown and "over" not in shown else 2 :]:
        body["visible"] = False
    return space(
        bodies,
        middle + look_from,
        middle,
        alt,
        angle,
        instead_of,
        controls,
        _formula("cloud"),
        data,
        checks,
        hover="over",
    )


def _pointed(pixels, column, system: System, ball, focal, over) -> dict:
    """Numbers of `cloud` without noise, by the library."""
    columns = np.full((system.camera.height, system.camera.width), np.nan)
    columns[pixels[:, 1], pixels[:, 0]] = column
    K = system.projector.K.copy()
    K[0, 0] *= 1 + focal / 100
    off = replace(system, projector=replace(system.projector, K=K))
    true, here = (triangulate(columns, s)[pixels[:, 1], pixels[:, 0]] for s in (system, off))
    away = np.linalg.norm(here - true, axis=1)
    near = away[away < ROOM]
    found = {"column": column[over], "depth": here[over, 2], "wrong orders": 0.0}
    found[f"RMS within {ROOM:g} mm"] = np.sqrt(np.mean(near**2)) if len(near) else 0.0
    return found | ({"radius": fit_sphere(here).radius} if ball else {})


def box(instead_of: str = "") -> Live:
    """What geometry says of the order: the phases between two planes of a pixel. Chapter 5."""
    system = preset("paper").system
    side, _, ahead = system.projector.centre
    data = {name: _line(pinhole) for name, pinhole in _pair(system)}
    data |= {"side": round(float(side), 6), "ahead": round(float(ahead), 6)}
    data |= {"angle": float(np.arcsin(system.projector.R[0, 2]).round(9)), "pitches": list(BOX)}
    settings = [(480, 820, 320, 1, True), (480, 820, 100, 0, False), (400, 900, 200, 2, True)]
    keys = ("near", "far", "u", "pitch", "centred")
    checks = [(dict(zip(keys, s, strict=True)), _boxed(system, *s)) for s in settings]
    controls = [
        slider("near", "near plane", 300, 880, 480, 5, "mm"),
        slider("far", "far plane", 300, 980, 820, 5, "mm"),
        slider("z", "surface at", 300, 980, 650, 1, "mm"),
        slider("u", "camera pixel u", 0, 600, 320),
        slider("pitch", "pitch", 0, len(BOX) - 1, 1, names=[str(pitch) for pitch in BOX]),
        slider("sigma", "phase noise", 0, 1, 0.1, 0.05, "rad"),
        {"name": "centred", "label": "centred", "value": True},
        slider("seed", "another draw", 0, 99, 0, play=400),
    ]
    return explore(controls, _formula("box"), data, checks, instead_of)


def _boxed(system: System, near, far, u, pitch, centred) -> dict:
    """Numbers of `box`, by the library."""
    shown = replace(system, z_min=float(near), z_max=float(far))
    lower = minimum_phase(shown, BOX[pitch], centred=centred, ambiguous=True)[240, u]
    columns = [shown.columns_at(float(z))[240, u] for z in (near, far)]
    return {"least phase": lower, "part of a period used": abs(np.diff(columns)[0]) / BOX[pitch]}


def _formula(name: str) -> str:
    return (HERE / f"{name}.js").read_text(encoding="utf-8")
