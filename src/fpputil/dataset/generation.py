"""Making a SynthFringe dataset: models to views, on one machine or many (chapter 7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fpputil.dataset import layout
from fpputil.dataset import models as sources
from fpputil.dataset.fill import fill, finish_model, portable
from fpputil.dataset.plan import POSES, plan_of
from fpputil.optics.pinhole import Pinhole
from fpputil.optics.raycasting import bvh, raycast
from fpputil.optics.shapes import CENTRE, SIZE, place, rotation
from fpputil.optics.system import System, system_from_dict


def generate(
    out: str | Path,
    preset_name: str,
    models: Sequence[sources.Model],
    held_out: Sequence[sources.Model] = (),
    *,
    root: str | Path | None = None,
    views: int = 36,
    seed: int = 0,
    size: float = SIZE,
    workers: int = 1,
    scheduler: str | None = None,
    progress: bool = False,
) -> dict:
    """Make a dataset, or go on with one that was stopped. Chapter 7.

    Parameters
    ----------
    out : str or Path
        Folder of the dataset; new, empty, or left by the same call.
    preset_name : str
        System and pitches: "tiny", "small" or "paper".
    models : sequence of Model
        Divided 8:1:1 into training, validation and test, each model in one of them.
    held_out : sequence of Model
        A split of their own, for families that no other split has.
    root : str or Path, optional
        Folder of the models that are files; every worker must see it.
    views : int
        Poses of each model: all 36 of the paper, or so many of them drawn at random.
    seed : int
        Of the splits, the choice of poses and the noise that readers add.
    size : float
        Diameter of the ball that a model fills, mm; models are scaled to it.
    workers : int
        Processes; 1 works in this one. A script that asks for more needs the usual
        ``if __name__ == "__main__":``.
    scheduler : str, optional
        Address of a Dask scheduler; its workers then do the work and must see `out` under the
        same path.
    progress : bool
        Show a bar with rate and time left.

    Returns
    -------
    dict
        The manifest.

    Raises
    ------
    ValueError
        If a parameter is out of range, `out` holds something else or another dataset, or no
        model could be used.
    RuntimeError
        If another process generates into `out`, or a worker was ended from outside.
    OSError
        If a file cannot be written. What is finished stays, and the same call goes on.
    """
    plan = plan_of(preset_name, models, held_out, views, seed, size)
    return fill(out, plan, make_model, root, workers, scheduler, progress)


def make_model(out: str, shared: dict, model: dict, number: int, root: str | None) -> dict:
    """See one model in all its poses, write its shards, then its record, which is returned."""
    settings = shared["settings"]
    rng = np.random.default_rng((settings["seed"], number))
    drawn = np.sort(rng.permutation(len(POSES))[: settings["views"]])
    record = {
        "pose": [POSES[k] for k in drawn],
        "noise_seed": rng.integers(2**53, size=len(drawn)).tolist(),
        "lit": [0] * len(drawn),
        "white": 0,
        "notes": [],
    }
    try:
        mesh, notes = sources.load_model(_model(model), root)
        record["notes"] += notes
        stacks = _see(mesh, shared, record)
    except (ValueError, FileNotFoundError) as error:
        record["skipped"] = portable(error, root)
        stacks = None
    return finish_model(out, shared, number, record, stacks)


def _model(entry: dict) -> sources.Model:
    return sources.Model(**{k: v for k, v in entry.items() if k != "split"})


def _see(mesh, shared: dict, record: dict) -> dict[str, np.ndarray]:
    """Arrays (V, H, W) of a model's views; counts lit pixels and the brightest grey level."""
    system, settings = system_from_dict(shared["system"]), shared["settings"]
    stacks = layout.empty_stacks(shared)
    tree = bvh(place(mesh, settings["size"]))
    for k, pose in enumerate(record["pose"]):
        try:
            view = raycast(tree, turned(system, rotation(*pose)), albedo=settings["albedo"])
        except ValueError as error:  # seen edge on, or from behind
            record["notes"].append(f"view {k}: {error}")
            continue
        for name, stack in stacks.items():
            stack[k] = getattr(view, name)
        record["lit"][k] = int(view.mask.sum())
        if record["lit"][k] >= settings["least"]:
            white = int(min(np.rint(255 * stacks["shade"][k].max().astype(float)), 255))
            record["white"] = max(record["white"], white)
    return stacks


def turned(system: System, R: np.ndarray, centre=CENTRE) -> System:
    """The system moved round a model that stays, so that it looks turned by R about `centre`.

    A tree of the model then serves all poses.
    """

    def moved(pinhole: Pinhole) -> Pinhole:
        c = np.asarray(centre)
        return replace(pinhole, R=pinhole.R @ R, t=pinhole.t + pinhole.R @ (c - R @ c))

    return replace(system, camera=moved(system.camera), projector=moved(system.projector))
