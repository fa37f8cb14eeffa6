"""Making a SynthFringe dataset: models to views, on one machine or many (chapter 7).

A *plan* says all that decides the content. One job makes one model whole and ends by writing its
*record*, so a run that stops at any moment loses the models in flight and no other; the *manifest*
takes in plan and records. Nothing that differs from run to run enters a file: the same call ends
with the same bytes, however often it was stopped.
"""

from __future__ import annotations

import json
import platform
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
from socket import gethostname

import numpy as np
from filelock import FileLock, Timeout
from tqdm.std import tqdm

from fpputil.checks import positive, seeded, whole
from fpputil.dataset import layout, parallel
from fpputil.dataset.models import Model, load_model
from fpputil.files import PARTIAL
from fpputil.optics.raycasting import bvh, raycast
from fpputil.optics.shapes import place, rotation
from fpputil.optics.system import System, preset, system_from_dict, system_to_dict

POSES = [(y, z) for y in range(0, 360, 60) for z in range(0, 360, 60)]
"""The paper's 36 poses: degrees about y and about z."""

ALBEDO = 0.9
RECORDS = "records"  # folder of the finished models' records, until the manifest takes them in

_PACKAGES = ("fpputil", "numpy", "zarr", "numcodecs", "embreex", "manifold3d", "trimesh")
_DECODERS = ("opencv-python-headless", "numba")


def generate(
    out: str | Path,
    preset_name: str,
    models: Sequence[Model],
    held_out: Sequence[Model] = (),
    *,
    root: str | Path | None = None,
    views: int = 36,
    seed: int = 0,
    size: float | None = None,
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
        System, pitches, and where the models stand: "tiny", "small", "paper" or "near".
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
    size : float, optional
        Diameter of the ball that a model fills, mm; models are scaled to it. By default of the
        preset.
    workers : int
        Processes; 1 works in this one. A script that asks for more needs the usual
        ``if __name__ == "__main__":``.
    scheduler : str, optional
        Address of a Dask scheduler, as ``tcp://host:8786``; its workers then do the work and must
        see `out` under the same path.
    progress : bool
        Show a bar.

    Returns
    -------
    dict
        The manifest.

    Raises
    ------
    ValueError
        If `out` holds something else or another dataset, or no model could be used.
    RuntimeError
        If another process generates into `out`, or a worker was ended from outside.

    Examples
    --------
    >>> from fpputil.dataset import seeded_models
    >>> manifest = generate("set", "tiny", *seeded_models(20), views=4)  # doctest: +SKIP
    """
    plan = plan_of(preset_name, models, held_out, views, seed, size)
    return fill(out, plan, see_model, root, workers, scheduler, progress)


def plan_of(preset_name, models, held_out, views, seed, size) -> dict:
    """Plan of a dataset of a preset's views; parameters and errors as for `generate`."""
    chosen = preset(preset_name)
    whole("views", views, 1)
    if views > len(POSES):
        raise ValueError(f"{views} views given; the paper turns each model into {len(POSES)} poses")
    camera, (x, y, z) = chosen.system.camera, chosen.centre
    across = np.arctan([camera.width / camera.K[0, 0] / 2, camera.height / camera.K[1, 1] / 2])
    sides = z * np.sin(across) - np.abs([x, y]) * np.cos(across)  # distances to the view's edges
    room = z - chosen.system.z_min, chosen.system.z_max - z, *sides
    size = chosen.size if size is None else size
    if positive("size", size, "mm") > (largest := 2 * min(room)):
        raise ValueError(
            f"size {size} mm given; a ball of more than {largest:.0f} mm does not fit in the "
            "camera's view and the measuring range"
        )
    if not models:
        raise ValueError("no model given; a dataset needs at least one")
    splits = [*split_by_model(len(models), seed), *["held-out"] * len(held_out)]
    entries = [{**asdict(m), "split": s} for m, s in zip([*models, *held_out], splits, strict=True)]
    settings = {"preset": preset_name, "views": views, "seed": seed, "size": size, "albedo": ALBEDO}
    return new_plan(settings, chosen.system, chosen.pitches._asdict(), entries)


def new_plan(settings: dict, system: System, pitches: dict, models: list[dict], frames=()) -> dict:
    """All that decides the content of a dataset, as its manifest begins.

    `settings` hold at least ``views``, of each model; `models` name, split and whatever their
    maker needs; `frames` pitch and steps of stored photographs.
    """
    names = [m["name"] for m in models]
    if len(set(names)) < len(names):
        twice = sorted({n for n in names if names.count(n) > 1})
        raise ValueError(f"models {twice} given twice; a model belongs to one split")
    least = max(1, system.camera.width * system.camera.height // 1000)
    packages = _PACKAGES + (_DECODERS if frames else ())
    return {
        "format": layout.FORMAT,
        "version": layout.VERSION,
        "complete": False,
        "settings": {**settings, "models": len(models), "least": least},
        "system": system_to_dict(system),
        "pitches": pitches,
        "frames": list(frames),
        "models": models,
        "versions": {"python": platform.python_version()} | {p: version(p) for p in packages},
    }


def split_by_model(number: int, seed: int) -> list[str]:
    """Split of each model, 8:1:1, drawn at random; from three models on none is empty.

    >>> split_by_model(3, seed=0)
    ['test', 'training', 'validation']
    """
    tenth = max(1, round(number / 10)) if number >= 3 else 0
    names = np.array(["training"] * number, object)
    order = seeded(seed).permutation(number)
    names[order[:tenth]], names[order[tenth : 2 * tenth]] = "validation", "test"
    return names.tolist()


def see_model(shared: dict, model: dict, number: int, root: str | None) -> tuple[dict, dict]:
    """Record of a model, and its arrays (V, H, W) by name: all its poses, or why there are none."""
    system, settings = system_from_dict(shared["system"]), shared["settings"]
    record, stacks = {**poses_of(settings, number), "notes": []}, layout.empty_stacks(shared)
    try:
        mesh, notes = load_model(Model(**{k: v for k, v in model.items() if k != "split"}), root)
        chosen = preset(settings["preset"])
        tree = bvh(place(mesh, settings["size"], chosen.centre))
    except (ValueError, FileNotFoundError) as error:
        return {**record, "skipped": portable(error, root)}, stacks
    record["notes"] += notes
    for k, pose in enumerate(record["pose"]):
        try:
            view = raycast(
                tree,
                turned_system(system, rotation(*pose), chosen.centre),
                albedo=settings["albedo"],
            )
        except ValueError as error:  # seen edge on, or from behind
            record["notes"].append(f"view {k}: {error}")
            continue
        for name, stack in stacks.items():
            stack[k] = getattr(view, name)
    return record, stacks


def poses_of(settings: dict, number: int) -> dict[str, list]:
    """Poses, degrees about y and z, of a model's views, and the seed of each view's noise."""
    rng = np.random.default_rng((settings["seed"], number))
    drawn = np.sort(rng.permutation(len(POSES))[: settings["views"]])
    seeds = rng.integers(2**53, size=len(drawn)).tolist()
    return {"pose": [list(POSES[k]) for k in drawn], "noise_seed": seeds}


def turned_system(system: System, R: np.ndarray, centre) -> System:
    """The system moved round a model that stays, whose tree serves all poses: it looks turned."""
    shift = np.asarray(centre) - R @ centre
    camera, projector = (
        replace(pinhole, R=pinhole.R @ R, t=pinhole.t + pinhole.R @ shift)
        for pinhole in (system.camera, system.projector)
    )
    return replace(system, camera=camera, projector=projector)


def portable(error: Exception, root: str | None) -> str:
    """An error's message without the folder, which differs from one machine to the next."""
    return str(error).replace(f"{root}/", "").replace(str(root), ".") if root else str(error)


def fill(out, plan: dict, make, root=None, workers=1, scheduler=None, progress=False) -> dict:
    """Make each model of a plan that has no record; the manifest, once all have.

    ``make(shared, model, number, root)`` gives a model's record and arrays, as `see_model` does;
    ``shared`` is the plan but for the models. Other parameters and errors are those of `generate`.
    """
    executor = parallel.executor(workers, scheduler)
    out = Path(out).absolute()
    root = None if root is None else str(Path(root).absolute())
    shared = {k: plan[k] for k in ("settings", "system", "pitches", "frames")}
    models, views = plan["models"], plan["settings"]["views"]
    with _claim(out), executor as pool:
        records = _finished(out, plan)
        if len(records) < len(models):
            lacking = (n for n in records if not (out / _record(n)).exists())
            layout.put(out, {_record(n): layout.dumps(records[n]) for n in lacking})
            layout.put(out, {layout.MANIFEST: layout.dumps(plan)})
        layout.put(out, layout.metadata_files(plan))
        missing = (number for number in range(len(models)) if number not in records)
        jobs = [(make, str(out), shared, models[n], n, root) for n in missing]
        start = {"initial": len(records) * views, "unit": "view", "disable": not progress}
        with tqdm(total=len(models) * views, **start) as bar:
            for number, record in parallel.run(make_model, jobs, pool):
                records[number] = record
                bar.update(views)
        manifest = complete(out, plan, [records[n] for n in range(len(models))])
        layout.put(out, {layout.MANIFEST: layout.dumps(manifest)})
        shutil.rmtree(out / RECORDS, ignore_errors=True)
        for file in out.rglob(PARTIAL):  # of runs and workers that were killed
            file.unlink(missing_ok=True)
        return manifest


@contextmanager
def _claim(out: Path) -> Iterator[None]:
    """Hold the folder against other generators; the lock dies with its process."""
    if not out.parent.is_dir():
        raise ValueError(f"{out} given; its folder {out.parent} does not exist")
    if not out.is_dir() and (out.exists() or out.is_symlink()):
        raise ValueError(f"{out} is no folder; a dataset is a folder")
    out.mkdir(exist_ok=True)
    names = sorted(f.name for f in out.iterdir() if not f.match(PARTIAL))
    if layout.MANIFEST not in names and names not in ([], [layout.LOCK]):
        place = "a dataset goes to a new or empty folder"
        raise ValueError(f"{out} holds something else ({', '.join(names[:3])}); {place}")
    try:
        with FileLock(out / layout.LOCK, timeout=0):
            yield
    except Timeout:
        raise RuntimeError(f"another process is generating into {out}; wait for it") from None


def _finished(out: Path, plan: dict) -> dict[int, dict]:
    """Records, by number, of the undamaged models of this plan; ValueError if `out` has another."""
    plan = json.loads(layout.dumps(plan))
    manifest = layout.read_manifest(out) if (out / layout.MANIFEST).exists() else plan
    for key, needed in plan.items():
        held = manifest.get(key)
        if key == "complete" or held == needed:
            continue
        change = f"its {key} differ"
        if isinstance(held, dict):
            names = sorted(k for k in held | needed if held.get(k) != needed.get(k))
            pairs = (f"{key} {k} is {held.get(k)} there and {needed.get(k)} here" for k in names)
            change = "; ".join(pairs)
        raise ValueError(f"{out} holds another dataset: {change}")
    records = {}
    for number in range(len(plan["models"])):
        with suppress(OSError, LookupError, TypeError, AttributeError, ValueError):  # none, damaged
            kept = manifest["records"][number] if "records" in manifest else None
            record = kept or json.loads((out / _record(number)).read_bytes())
            if not faults(out, plan, number, record):
                records[number] = record
    return records


def faults(path: Path, manifest: dict, number: int, record: dict) -> list[str]:
    """What is wrong with the shards of a model, or with what its record says of them."""
    known = {layout.shard_name(manifest, name, number) for name in layout.arrays(manifest)}
    wrong = [f"{name}: not part of the dataset" for name in record["shards"] if name not in known]
    for name, shard in record["shards"].items() if not wrong else ():
        try:
            data = (path / name).read_bytes()
            if (layout.digest(data), len(data)) != (shard["sha256"], shard["bytes"]):
                wrong.append(f"{name}: not as it was written")
        except FileNotFoundError:
            wrong.append(f"{name}: missing")
        except OSError as error:
            wrong.append(f"{name}: cannot be read ({error.strerror})")
    if wrong:
        return wrong
    settings, stacks = manifest["settings"], layout.empty_stacks(manifest)
    for name in {k.partition("/")[0] for k in record["shards"]} & {"frames", "mask", "shade"}:
        for view, image in enumerate(stacks[name]):
            image[:] = layout.read_array(path, manifest, name, number, view)
    facts = layout.lit_and_white(stacks, settings["least"])
    facts |= poses_of(settings, number) if "pose" in record else {}
    changed = (name for name in facts if record[name] != facts[name])
    return [f"{layout.MANIFEST}: {n} of model {number} is not as it was written" for n in changed]


def _record(number: int) -> str:
    return f"{RECORDS}/{number:06d}.json"


def make_model(make, out: str, shared: dict, model: dict, number: int, root: str | None):
    """Make a model on a worker, write its shards, then its record; number and record."""
    folder = Path(out)
    if not (folder / layout.MANIFEST).is_file():
        raise RuntimeError(f"worker {gethostname()} does not see {out}; all workers must")
    record, stacks = make(shared, model, number, root)
    files = layout.view_files(shared, number, stacks)
    layout.put(folder, files)
    shards = {n: {"bytes": len(d), "sha256": layout.digest(d)} for n, d in files.items()}
    facts = layout.lit_and_white(stacks, shared["settings"]["least"])
    data = layout.dumps({**record, **facts, "shards": shards})
    layout.put(folder, {_record(number): data})
    return number, json.loads(data)


def complete(out: Path, plan: dict, records: list[dict]) -> dict:
    """The manifest of a dataset all of whose models have a record."""
    pairs = zip(records, plan["models"], strict=True)
    white = [r["white"] for r, m in pairs if m["split"] == "training"]
    if not any(white or [r["white"] for r in records]):
        why = next((r["skipped"] for r in records if "skipped" in r), "nothing of it is lit")
        raise ValueError(f"no training model for {out} could be used; the first: {why}")
    manifest = {
        **plan,
        "complete": True,
        "records": records,
        # Black, and the brightest pixel of a training model in white light.
        "extremes": [0, max(white)] if white else None,
        "content": layout.content(records),
    }
    return json.loads(layout.dumps(manifest))
