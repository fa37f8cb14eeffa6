"""Datasets as folders of PNG files, one folder a scene: for other programs, and from other rigs.

A folder holds ``scenes.json`` and a folder for each scene with its photographs, named after
frequency and step: ``high_00.png`` to ``high_14.png``, ``mid_00.png`` ... ``zmin_..``, ``unit_..``.
Chapter 7.
"""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

from fpputil.checks import write_whole
from fpputil.decoding.decoder import decode
from fpputil.decoding.depth import column, depth_of, triangulate
from fpputil.decoding.phase import THRESHOLD
from fpputil.decoding.reference import minimum_phase
from fpputil.learning import layout
from fpputil.learning.fill import fill, finish_model, portable
from fpputil.learning.layout import FREQUENCIES, STEPS
from fpputil.learning.plan import new_plan, split_by_model
from fpputil.learning.store import open_store
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import from_dict, to_dict

INDEX = "scenes.json"


def export_folder(
    path: str | Path, folder: str | Path, split: str | None = None, noise: float = 0.0
) -> int:
    """Write photographs of a dataset as PNG files, four frequencies of 15 steps a scene.

    Parameters
    ----------
    path : str or Path
        A finished dataset.
    folder : str or Path
        New or empty.
    split : str, optional
        Of this split alone.
    noise : float
        Read noise, grey levels, with the seed of each view.

    Returns
    -------
    int
        Number of scenes.
    """
    data, folder = open_store(path), Path(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ValueError(f"{folder} is not empty; an export goes to a new or empty folder")
    folder.mkdir(exist_ok=True)
    pitches, scenes = data.manifest["pitches"], {}
    for name in [split] if split else data.splits():
        for index in data.indices(name):
            about = data.about(index)
            scene = f"scene-{index:06d}"
            scenes[scene] = {"object": about["name"], "split": name}
            frames = data.photographs(
                index, [Fringe(pitches[f], STEPS) for f in FREQUENCIES], noise
            )
            _write_scene(folder / scene, frames)
    about = {
        "system": to_dict(data.system),
        "pitches": pitches,
        "steps": dict.fromkeys(FREQUENCIES, STEPS),
    }
    write_whole(folder / INDEX, layout.dumps({**about, "scenes": scenes}))
    return len(scenes)


def _write_scene(folder: Path, frames: np.ndarray) -> None:
    folder.mkdir()
    for n, frame in enumerate(frames):
        name = f"{FREQUENCIES[n // STEPS]}_{n % STEPS:02d}.png"
        write_whole(folder / name, cv2.imencode(".png", frame)[1].tobytes())


def import_folder(
    folder: str | Path, out: str | Path, *, seed: int = 0, workers: int = 1, progress: bool = False
) -> dict:
    """Make a dataset out of photographs; what is decoded from them stands in for the truth.

    ``scenes.json`` holds the ``system`` (as `System.save` writes it), the ``pitches`` and the
    number of ``steps`` of high, mid, zmin and unit, and may hold ``scenes``: for a scene's folder
    its ``object`` (scenes of one object stay in one split) and its ``split``. Without that every
    folder is a scene of an object of its own, and objects are divided 8:1:1.

    Returns
    -------
    dict
        The manifest. A scene that cannot be used is skipped, and its record says why.

    Raises
    ------
    ValueError
        If ``scenes.json`` is missing or not whole, the folder holds no scene, or none can be used.
    """
    folder = Path(folder)
    about = _read_index(folder)
    system, pitches, steps = from_dict(about["system"]), about["pitches"], about["steps"]
    minimum_phase(system, pitches["zmin"])  # raises where the range is too long for the method
    scenes = about.get("scenes") or {f.name: {} for f in sorted(folder.iterdir()) if f.is_dir()}
    if not scenes:
        raise ValueError(f"{folder} holds no scene; each is a folder of PNG files")
    objects: dict[str, list[str]] = {}
    for scene in sorted(scenes):
        objects.setdefault(scenes[scene].get("object", scene), []).append(scene)
    drawn = split_by_model(len(objects), seed)
    models = [
        {"name": name, "scenes": own, "split": scenes[own[0]].get("split", split)}
        for (name, own), split in zip(objects.items(), drawn, strict=True)
    ]
    settings = {"preset": "imported", "views": max(map(len, objects.values())), "seed": seed}
    frames = [{"pitch": pitches[f], "steps": steps[f]} for f in FREQUENCIES]
    plan = new_plan(settings, system, pitches, models, frames)
    return fill(out, plan, import_model, folder, workers, progress=progress)


def _read_index(folder: Path) -> dict:
    try:
        about = json.loads((folder / INDEX).read_bytes())
        from_dict(about["system"])
        [Fringe(about["pitches"][f], about["steps"][f]) for f in FREQUENCIES]
    except FileNotFoundError:
        raise ValueError(f"{folder} holds no {INDEX}; it names system, pitches and steps") from None
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(
            f"{folder / INDEX} is not whole ({type(error).__name__}: {error}); it names the "
            f"system, and pitches and steps of {', '.join(FREQUENCIES)}"
        ) from error
    return about


def import_model(out: str, shared: dict, model: dict, number: int, root: str) -> dict:
    """Decode the scenes of one object and write its shards, then its record."""
    views = shared["settings"]["views"]
    record = {"lit": [0] * views, "white": 0, "notes": []}
    stacks = layout.empty_stacks(shared)
    for k, scene in enumerate(model["scenes"]):
        try:
            arrays = _decoded(shared, _read_scene(Path(root) / scene, shared))
        except (ValueError, FileNotFoundError) as error:
            record["notes"].append(f"{scene}: {portable(error, root)}")
            continue
        for name, values in arrays.items():
            stacks[name][k] = values
        record["lit"][k] = int(arrays["mask"].sum())
        record["white"] = max(record["white"], int(arrays["frames"].max()))
    if not any(record["lit"]):
        record["skipped"] = "; ".join(record["notes"])
    return finish_model(out, shared, number, record, stacks)


def _read_scene(folder: Path, shared: dict) -> np.ndarray:
    """All photographs of a scene, (F, H, W) uint8, in the order of `FREQUENCIES`."""
    camera = shared["system"]["camera"]
    steps = zip(FREQUENCIES, shared["frames"], strict=True)
    names = [f"{name}_{n:02d}.png" for name, f in steps for n in range(f["steps"])]
    missing = [n for n in names if not (folder / n).is_file()]
    if missing:
        raise ValueError(f"{len(missing)} of {len(names)} photographs are missing: {missing[:3]}")
    frames = []
    for name in names:
        frame = cv2.imread(str(folder / name), cv2.IMREAD_UNCHANGED)
        if frame is not None and frame.ndim == 3:
            frame = cv2.cvtColor(frame[..., :3], cv2.COLOR_BGR2GRAY)
        if frame is None or frame.dtype != np.uint8:
            raise ValueError(f"{name} is no whole 8-bit PNG file")
        if frame.shape != (camera["height"], camera["width"]):
            raise ValueError(
                f"{name} has {frame.shape[1]} x {frame.shape[0]} pixels; the camera of {INDEX} "
                f"has {camera['width']} x {camera['height']}"
            )
        frames.append(frame)
    return np.stack(frames)


def _decoded(shared: dict, frames: np.ndarray) -> dict[str, np.ndarray]:
    """Column, shade, depth and mask as the photographs show them."""
    system = from_dict(shared["system"])
    fringes = [Fringe(f["pitch"], f["steps"]) for f in shared["frames"]]
    parts = dict(
        zip(FREQUENCIES, np.split(frames, np.cumsum([f.steps for f in fringes])[:-1]), strict=True)
    )
    order = ("unit", "mid", "high")
    chosen = [fringes[FREQUENCIES.index(k)] for k in order]
    found = decode(
        np.concatenate([parts[k] for k in order]), chosen, system.projector.width, THRESHOLD
    )
    columns = column(found.Phi, chosen[-1].pitch)
    z = depth_of(triangulate(columns, system), system)
    mask = found.mask & np.isfinite(z)
    shade = np.where(mask, 2 / 255 * found.modulation[-1], 0)
    kept = {"column": columns, "depth": z}
    kept = {k: np.where(mask, v, np.nan).astype(np.float32) for k, v in kept.items()}
    return {**kept, "shade": shade.astype(np.float16), "mask": mask, "frames": frames}
