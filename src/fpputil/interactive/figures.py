"""The figures of several chapters that a reader plays with, held to the library by their checks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from fpputil.decoding.phase import modulation, numerator_denominator, wrapped_phase
from fpputil.interactive.live import Live, explore, slider
from fpputil.optics.system import System, preset

HERE = Path(__file__).parent


def plan(instead_of: str = "", z: float = 660.0, u: float = 320.0) -> Live:
    """Camera, projector and a wall from above; the point on the wall can be dragged. Chapter 2."""
    system = preset("paper").system
    camera, projector = system.camera, system.projector
    _, _, ahead = projector.centre
    names = ("focal", "centre", "width")
    data = {
        "camera": dict(zip(names, (camera.K[0, 0], camera.K[0, 2], camera.width), strict=True)),
        "projector": dict(
            zip(names, (projector.K[0, 0], projector.K[0, 2], projector.width), strict=True)
        ),
        "ahead": round(float(ahead), 6),
        "pitch": 57,
        "dead": 0.1,
        "red": [192, 57, 43] * 256,
    }
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


def _formula(name: str) -> str:
    return (HERE / f"{name}.js").read_text(encoding="utf-8")
