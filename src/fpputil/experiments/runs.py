"""Making the runs of `experiments`, one JSON file each, and reading them (chapter 10)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path

import torch
from filelock import FileLock, Timeout

from fpputil.dataset.store import open_store
from fpputil.experiments.assessment import SPLITS, assess
from fpputil.experiments.learning_rate import best_learning_rate, read_json
from fpputil.experiments.registry import Experiment, budget, experiments
from fpputil.files import write_whole
from fpputil.learning.training import CONFIG, WEIGHTS, fit
from fpputil.learning.weights import Trained, load_weights, plain, short
from fpputil.networks.complexity import cost
from fpputil.networks.methods import method_of, settings_of

RESULTS = Path("data/results")


def make_run(
    name: str,
    preset: str,
    data: str | Path,
    work: str | Path,
    results: str | Path = RESULTS,
    wait: bool = False,
    **how,
) -> dict:
    """Make a run, or go on with it, unless it is finished; returns what it found.

    It leaves NAME.json, NAME.npz (errors of some views) and NAME.png (its curve) in the folder of
    the preset.

    Parameters
    ----------
    name : str
        One of `experiments`.
    preset : str
    data : path
        A dataset of the preset.
    work : path
        Folder for the folders of runs under way, each named after all that decides on it.
    results : path
        Folder with tiny/rates.json, for the results of each preset in a folder of its own.
    wait : bool
        Wait while another process makes this run.
    **how
        Options of `fit`: workers, device, progress.

    Raises
    ------
    ValueError
        If there is no such run, or the dataset is of another preset or lacks a split.
    BlockingIOError
        If another process is making it, and `wait` is not given.
    """
    known, results = experiments(preset), Path(results)
    if name not in known:
        raise ValueError(f"run {name!r} given; the runs are {', '.join(known)}")
    settings, about = _wanted(name, preset, known[name], data, results)
    path = results / preset / f"{name}.json"
    mark = hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()[:8]
    folder = Path(work) / preset / f"{name}-{mark}"
    folder.mkdir(parents=True, exist_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    with _claim(folder, name, wait):
        if (found := finished(path, about)) is not None:
            return found
        resume = (folder / CONFIG).is_file()
        _, history = fit(known[name].method, data, settings, folder, resume=resume, **how)
        trained = load_weights(folder / WEIGHTS)
        found = {**about, "checksum": open_store(data).checksum, **_facts(trained, history)}
        found |= assess(trained, data, path.with_suffix(".npz"), **_loading(how))
        write_whole(path.with_suffix(".png"), (folder / "curve.png").read_bytes())
        write_whole(path, f"{json.dumps(short(found), separators=(',', ':'))}\n".encode())
    return read_result(path)


def _wanted(name: str, preset: str, one: Experiment, data, results: Path):
    """Settings of a run, and all that makes it what it is."""
    store = open_store(data)
    if (made := store.manifest["settings"]["preset"]) != preset:
        raise ValueError(f"{data} was made with the preset {made}, and {preset} is asked for")
    for split in ("training", "validation", *SPLITS):
        store.indices(split)  # which raises if it lacks one
    rate = best_learning_rate(results / "tiny" / "rates.json", one.kind)
    settings = replace(budget(preset), learning_rate=rate, seed=one.seed)
    return settings, {
        "name": name,
        "preset": preset,
        "seed": one.seed,
        "data": store.name,
        "method": settings_of(one.method),
        "settings": plain(asdict(settings)),
    }


def finished(path: Path, about: dict) -> dict | None:
    """What a run found, if it is the run `about` describes."""
    if not path.is_file():
        return None
    found = read_result(path)
    return found if all(found[k] == v for k, v in plain(about).items()) else None


def read_result(path: Path) -> dict:
    """What a run found; ValueError with the path if the file is cut or foreign."""
    needed = ("name", "preset", "seed", "data", "method", "settings", "splits", "conditions")
    found = read_json(path, *needed)
    try:
        found["method"] = settings_of(method_of(found["method"]))
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is of no method of this version ({error})") from error
    return found


def read_results(preset: str, path: str | Path = RESULTS) -> dict[str, dict]:
    """What all finished runs of a preset found, by name.

    Raises
    ------
    ValueError
        If one was made with another method or budget than `experiments` has, or if they were
        made on different datasets.
    """
    known, shared = experiments(preset), plain(asdict(budget(preset)))
    folder, runs = Path(path) / preset, {}
    for name, one in known.items():
        if not (file := folder / f"{name}.json").is_file():
            continue
        runs[name] = read_result(file)
        own = plain(
            {
                **shared,
                "seed": one.seed,
                "learning_rate": runs[name]["settings"].get("learning_rate"),
            }
        )
        for what, needed in (("method", settings_of(one.method)), ("settings", own)):
            if runs[name][what] != plain(needed):
                raise ValueError(
                    f"{file} was made with other {what} than this version's; make it again: "
                    f"fpp results run {name} --preset {preset}"
                )
    if len(found := {r["data"] for r in runs.values()}) > 1:
        raise ValueError(f"{folder} holds runs on {len(found)} datasets; a table is about one")
    return runs


@contextmanager
def _claim(folder: Path, name: str, wait: bool) -> Iterator[None]:
    """Hold a run against other processes; the lock dies with its process."""
    try:
        with FileLock(folder / ".lock", timeout=-1 if wait else 0):
            yield
    except Timeout:
        raise BlockingIOError(f"another process is making the run {name}") from None


def _facts(trained: Trained, history: list[dict]) -> dict:
    """What a run cost."""
    spent = cost(trained.network, tuple(trained.metadata["camera"]))
    return {
        "version": version("fpputil"),
        "hardware": trained.metadata["training"]["hardware"],
        "parameters": spent.parameters,
        "multiply_adds": spent.multiply_adds,
        "images": history[-1]["images"],
        "seconds": sum(row["seconds"] for row in history),
        "history": history,
    }


def _loading(how: dict) -> dict:
    device = how.get("device") or ("cuda" if torch.cuda.is_available() else "cpu")
    shared = {"workers": how.get("workers", 0), "progress": how.get("progress", False)}
    return {**shared, "device": device, "precision": "float32"}  # on every device alike
