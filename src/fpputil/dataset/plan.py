"""What decides the content of a SynthFringe dataset, before any of it is made (chapter 7)."""

from __future__ import annotations

import platform
from dataclasses import asdict
from importlib.metadata import version

import numpy as np

from fpputil.checks import positive, seeded, whole
from fpputil.dataset import layout
from fpputil.dataset import models as sources
from fpputil.optics.parts import FAMILIES
from fpputil.optics.shapes import CENTRE
from fpputil.optics.system import System, preset, system_to_dict

POSES = [(y, z) for y in range(0, 360, 60) for z in range(0, 360, 60)]
"""The paper's 36 poses: degrees about y and about z."""

HELD_OUT = ("camshaft", "fan", "lattice")
"""Families of parts that only the held-out split has."""

ALBEDO = 0.9
_PACKAGES = ("fpputil", "numpy", "zarr", "numcodecs", "embreex", "manifold3d", "trimesh")
_DECODERS = ("opencv-python-headless", "numba")


def seeded_models(number: int = 500, held_out: int | None = None, seed: int = 0):
    """Parts for `generate`: `number` of the common families, a tenth more of those held out.

    Returns
    -------
    models, held_out : tuples of Model
    """
    rest = whole("models", number, 1) // 10 if held_out is None else whole("held_out", held_out, 0)
    first = 1_000_000 * whole("seed", seed, 0)
    common = [f for f in FAMILIES if f not in HELD_OUT]
    strange = sources.parts(rest, HELD_OUT, first) if rest else ()
    return sources.parts(number, common, first), strange


def plan_of(preset_name, models, held_out, views, seed, size) -> dict:
    """Plan of a dataset of a preset's views; parameters and errors as for `generate`."""
    chosen = preset(preset_name)
    whole("views", views, 1)
    if views > len(POSES):
        raise ValueError(f"{views} views given; the paper turns each model into {len(POSES)} poses")
    _check_room(chosen.system, positive("size", size, "mm"))
    if not models:
        raise ValueError("no model given; a dataset needs at least one")
    splits = [*split_by_model(len(models), seed), *["held-out"] * len(held_out)]
    listed = [{**asdict(m), "split": s} for m, s in zip([*models, *held_out], splits, strict=True)]
    settings = {"preset": preset_name, "views": views, "seed": seed, "size": size, "albedo": ALBEDO}
    return new_plan(settings, chosen.system, chosen.pitches._asdict(), listed)


def new_plan(settings: dict, system: System, pitches: dict, models: list[dict], frames=()) -> dict:
    """All that decides the content of a dataset, as its manifest begins.

    Parameters
    ----------
    settings : dict
        What else decides it; at least ``views``, the views of each model.
    system : System
        Of all views.
    pitches : dict
        Pitch of the frequencies high, mid, zmin and unit.
    models : list of dict
        Name and split of each model, and whatever its maker needs.
    frames : sequence of dict
        Pitch and steps of stored photographs.
    """
    names = [m["name"] for m in models]
    if len(set(names)) < len(names):
        twice = sorted({n for n in names if names.count(n) > 1})
        raise ValueError(f"models {twice} given twice; a model belongs to one split")
    least = max(1, system.camera.width * system.camera.height // 1000)
    return {
        "format": layout.FORMAT,
        "version": layout.VERSION,
        "complete": False,
        "settings": {**settings, "models": len(models), "least": least},
        "system": system_to_dict(system),
        "pitches": pitches,
        "frames": list(frames),
        "models": models,
        "versions": versions(bool(frames)),
    }


def versions(decoding: bool = False) -> dict[str, str]:
    """Versions of all that decides the bytes of a dataset."""
    packages = _PACKAGES + (_DECODERS if decoding else ())
    return {"python": platform.python_version()} | {p: version(p) for p in packages}


def _check_room(system: System, size: float) -> None:
    camera, z = system.camera, CENTRE[2]
    slope = min(camera.width / camera.K[0, 0], camera.height / camera.K[1, 1]) / 2
    most = 2 * min(z - system.z_min, system.z_max - z, z * np.sin(np.arctan(slope)))
    if size > most:
        raise ValueError(
            f"size {size} mm given; a ball of more than {most:.0f} mm does not fit in the camera's "
            f"view and the measuring range of {system.z_min:.0f} to {system.z_max:.0f} mm"
        )


def split_by_model(number: int, seed: int) -> list[str]:
    """Split of each model, 8:1:1, drawn at random; from three models on none is empty."""
    tenth = max(1, round(number / 10)) if number >= 3 else 0
    names = np.array(["training"] * number, object)
    order = seeded(seed).permutation(number)
    names[order[:tenth]], names[order[tenth : 2 * tenth]] = "validation", "test"
    return names.tolist()
