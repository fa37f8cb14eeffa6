"""Datasets as folders of PNG files, one folder a scene: for other programs, and from other rigs.

A folder holds ``scenes.json`` and a folder for each scene with its photographs, named after
frequency and step: ``high_00.png`` to ``high_14.png``, ``mid_00.png`` ... ``zmin_..``, ``unit_..``.
Chapter 7.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np

from fpputil.capture.files.images import grey, read_pixels
from fpputil.checks import anything, one_line, one_or_more, parse_json
from fpputil.dataset import layout
from fpputil.dataset.generation import fill, new_plan, portable, split_by_model
from fpputil.dataset.store import open_store
from fpputil.decoding.decoder import decode
from fpputil.decoding.geometric_constraint import minimum_phase
from fpputil.decoding.triangulation import column, depth_of, triangulate
from fpputil.files import PARTIAL
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import FORM as SYSTEM
from fpputil.optics.system import (
    FREQUENCIES,
    PITCHES,
    STEPS,
    System,
    system_from_dict,
    system_to_dict,
)

INDEX = "scenes.json"
FORM = {
    "system": SYSTEM,
    "pitches": PITCHES,
    "steps": dict.fromkeys(FREQUENCIES, one_or_more),
    ...: anything,
}
UNFINISHED = "unfinished.json"  # says what an export is of; gone once all of it is there
AT_ONCE = 12  # scenes that a worker holds in memory


def export_folder(
    path: str | Path, folder: str | Path, split: str | None = None, noise: float = 0.0
) -> int:
    """Write photographs of a dataset as PNG files, 15 steps of each frequency; number of scenes.

    Parameters
    ----------
    path : str or Path
        A finished dataset.
    folder : str or Path
        New, empty, or left by the same call, which then goes on.
    split : str, optional
        Of this split alone.
    noise : float
        Read noise, grey levels, with the seed of each view; none for an imported dataset.
    """
    data, folder = open_store(path), Path(folder)
    splits = [split] if split else data.splits()
    scenes = {f"scene-{i:06d}": (name, int(i)) for name in splits for i in data.indices(name)}
    fringes = data.fringes or [Fringe(data.manifest["pitches"][f], STEPS) for f in FREQUENCIES]
    names = _names(fringe.steps for fringe in fringes)
    made_of = {"content": data.checksum, "split": split, "noise": noise}
    _begin(folder, made_of)
    for scene, (_, index) in scenes.items():
        if not all((folder / scene / name).is_file() for name in names):
            shutil.rmtree(folder / scene, ignore_errors=True)  # what a kill left of it
            frames = data.photographs(index, fringes, noise)
            pictures = (cv2.imencode(".png", frame)[1].tobytes() for frame in frames)
            files = zip((f"{scene}/{name}" for name in names), pictures, strict=True)
            layout.put(folder, dict(files))
    table = {
        "system": system_to_dict(data.system),
        "pitches": data.manifest["pitches"],
        "steps": {name: fringe.steps for name, fringe in zip(FREQUENCIES, fringes, strict=True)},
        "scenes": {
            scene: {"object": data.describe(index)["name"], "split": name}
            for scene, (name, index) in scenes.items()
        },
        "made_of": made_of,
    }
    layout.put(folder, {INDEX: layout.dumps(table)})
    (folder / UNFINISHED).unlink(missing_ok=True)
    return len(scenes)


def _begin(folder: Path, made_of: dict) -> None:
    """Say in a folder what its export is of, if it is new, empty or left by the same export."""
    start = layout.dumps(made_of)
    for file in folder.glob(PARTIAL):
        file.unlink()
    mark = folder / UNFINISHED
    begun = mark.is_file() and mark.read_bytes() == start
    with suppress(ValueError):  # all there, whether or not its process came to its end
        begun |= _read_index(folder)[0].get("made_of") == made_of
    if not begun and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        place = "a new or empty folder, or goes on where the same command was stopped"
        raise ValueError(f"{folder} is not empty; an export goes to {place}")
    folder.mkdir(exist_ok=True)
    layout.put(folder, {UNFINISHED: start})


def _names(steps: Iterable[int]) -> list[str]:
    """File names of a scene's photographs, in the order of `FREQUENCIES`."""
    pairs = zip(FREQUENCIES, steps, strict=True)
    return [f"{name}_{n:02d}.png" for name, count in pairs for n in range(count)]


def import_folder(
    folder: str | Path, out: str | Path, *, seed: int = 0, workers: int = 1, progress: bool = False
) -> dict:
    """Make a dataset out of photographs; what is decoded from them stands in for the truth.

    ``scenes.json`` holds the ``system`` (as `System.save` writes it), the ``pitches`` and the
    number of ``steps`` of high, mid, zmin and unit, and may hold ``scenes``: for a scene's folder
    its ``object`` (scenes of one object stay in one split) and its ``split``. Without that every
    folder is a scene of an object of its own, and objects are divided 8:1:1.

    Returns the manifest. A scene that cannot be used is skipped, and its record says why; it is a
    ValueError if none can, or ``scenes.json`` is missing or not whole.
    """
    folder = Path(folder)
    index, system, fringes = _read_index(folder)
    models = _models(folder, _objects(folder, index.get("scenes")), seed)
    views = max(len(m["scenes"]) for m in models)
    settings = {"preset": "imported", "views": views, "seed": seed}
    frames = [{"pitch": f.pitch, "steps": f.steps} for f in fringes]
    plan = new_plan(settings, system, index["pitches"], models, frames)
    return fill(out, plan, import_scenes, folder, workers, progress=progress)


def _read_index(folder: Path) -> tuple[dict, System, list[Fringe]]:
    """What ``scenes.json`` holds, and system and fringes out of it."""
    try:
        index = parse_json((folder / INDEX).read_bytes(), FORM)
        fringes = [Fringe(index["pitches"][f], index["steps"][f]) for f in FREQUENCIES]
        system = system_from_dict(index["system"])
        minimum_phase(system, index["pitches"]["zmin"])  # raises if the range is too long for it
        return index, system, fringes
    except FileNotFoundError:
        raise ValueError(f"{folder} holds no {INDEX}; it names system, pitches and steps") from None
    except ValueError as error:
        raise ValueError(
            f"{folder / INDEX} is not whole ({one_line(error)}); it names the system, and pitches "
            f"and steps of {', '.join(FREQUENCIES)}"
        ) from error


def _objects(folder: Path, scenes: dict | None) -> dict[str, tuple[list[str], str | None]]:
    """Scenes and split, if one is given, of each object."""
    if scenes is None:
        scenes = {f.name: {} for f in sorted(folder.iterdir()) if any(f.glob("*.png"))}
    if not isinstance(scenes, dict) or not all(isinstance(v, dict) for v in scenes.values()):
        raise ValueError(
            f"scenes in {folder / INDEX} is no table; it gives each folder's object and split"
        )
    objects: dict[str, tuple[list[str], str | None]] = {}
    for scene, entry in sorted(scenes.items()):
        split, where = entry.get("split"), f"in {folder / INDEX}"
        if scene != Path(scene).name or not scene.isprintable():
            raise ValueError(f"scene {scene!r} given {where}; a folder beside it is needed")
        if split not in (None, *layout.SPLITS):
            splits = ", ".join(layout.SPLITS)
            raise ValueError(f"split {split!r} given for {scene} {where}; the splits are {splits}")
        folders, before = objects.setdefault(str(entry.get("object", scene)), ([], split))
        if split != before:
            names = f"{folders[0]} and {scene} {where}"
            raise ValueError(f"{names} show one object; they belong in one split")
        folders.append(scene)
    if not objects:
        raise ValueError(f"{folder} holds no scene; each is a folder of PNG files")
    return objects


def _models(folder: Path, objects: dict, seed: int) -> list[dict]:
    """Objects as models of a plan; one of many scenes is several, in the same split."""
    drawn = split_by_model(len(objects), seed)
    models = []
    for (name, (scenes, named)), split in zip(objects.items(), drawn, strict=True):
        for first in range(0, len(scenes), AT_ONCE):
            group = scenes[first : first + AT_ONCE]
            part = f"{name} ({first // AT_ONCE + 1})" if len(scenes) > AT_ONCE else name
            # Changed photographs are another dataset.
            files = [sorted((folder / scene).glob("*.png")) for scene in group]
            lines = ["".join(f.name + layout.digest(f.read_bytes()) for f in fs) for fs in files]
            sha256 = layout.digest("".join(layout.digest(s.encode()) for s in lines).encode())
            models.append(
                {"name": part, "scenes": group, "split": named or split, "sha256": sha256}
            )
    return models


def import_scenes(shared: dict, model: dict, number: int, root: str) -> tuple[dict, dict]:
    """Record of an object, and its arrays (V, ...) by name, as its scenes show it."""
    record, stacks = {"notes": []}, layout.empty_stacks(shared)
    for k, scene in enumerate(model["scenes"]):
        try:
            arrays = _decoded(shared, _read_scene(Path(root) / scene, shared))
        except (ValueError, FileNotFoundError) as error:
            record["notes"].append(f"{scene}: {portable(error, root)}")
            continue
        for name, values in arrays.items():
            stacks[name][k] = values
    if not stacks["mask"].any():
        record["skipped"] = "; ".join(record["notes"])
    return record, stacks


def _read_scene(folder: Path, shared: dict) -> np.ndarray:
    """All photographs of a scene, (F, H, W) uint8, in the order of `FREQUENCIES`."""
    camera = shared["system"]["camera"]
    size = camera["height"], camera["width"]
    names = _names(f["steps"] for f in shared["frames"])
    if missing := [n for n in names if not (folder / n).is_file()]:
        raise ValueError(f"{len(missing)} of {len(names)} photographs are missing: {missing[:3]}")
    frames = [_whole_levels(read_pixels(folder / name)) for name in names]
    for name, frame in zip(names, frames, strict=True):
        if frame.dtype != np.uint8 or frame.shape != size:
            raise ValueError(
                f"{name} is {frame.shape[1]} x {frame.shape[0]} of {frame.dtype}; the camera of "
                f"{INDEX} has {size[1]} x {size[0]}, and 8 bit are needed"
            )
    return np.stack(frames)


def _whole_levels(image: np.ndarray) -> np.ndarray:
    """Grey of a photograph; of 8 bits in colour it is rounded, for a dataset stores 8 bits."""
    levels = grey(image)
    return np.floor(levels + 0.5).astype(np.uint8) if image.dtype == np.uint8 else levels


def _decoded(shared: dict, frames: np.ndarray) -> dict[str, np.ndarray]:
    """Column, shade, depth and mask as the photographs show them."""
    system = system_from_dict(shared["system"])
    high, mid, zmin, unit = fringes = [Fringe(f["pitch"], f["steps"]) for f in shared["frames"]]
    of_high, of_mid, _, of_unit = np.split(frames, np.cumsum([f.steps for f in fringes])[:-1])
    stack = np.concatenate([of_unit, of_mid, of_high])
    decoded = decode(stack, [unit, mid, high], system.projector.width)
    columns = column(decoded.Phi, high.pitch)
    z = depth_of(triangulate(columns, system), system)
    mask = decoded.mask & np.isfinite(z)
    return {
        "column": np.where(mask, columns, np.nan).astype(np.float32),
        "shade": np.where(mask, 2 / 255 * decoded.modulation[-1], 0).astype(np.float16),
        "depth": np.where(mask, z, np.nan).astype(np.float32),
        "mask": mask,
        "frames": frames,
    }
