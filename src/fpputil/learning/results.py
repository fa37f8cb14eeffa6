"""Making the runs of `experiments`, one JSON file each, and reading them (chapter 10)."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch
from filelock import FileLock, Timeout

from fpputil.checks import write_whole
from fpputil.learning.batches import spread
from fpputil.learning.evaluation import evaluate, open_split
from fpputil.learning.experiments import budget, experiments
from fpputil.learning.inspection import Inspection
from fpputil.learning.methods import method_of, settings_of
from fpputil.learning.networks.measuring import cost
from fpputil.learning.rates import best_rates
from fpputil.learning.run import CHECKPOINT, plain
from fpputil.learning.store import open_store
from fpputil.learning.synthfringe import Augmentation, SynthFringe
from fpputil.learning.trainer import WEIGHTS
from fpputil.learning.training import fit
from fpputil.learning.weights import Trained, load_weights

RESULTS = Path("data/results")
VIEWS, TRUTH = "views.npz", ("mask", "Phi", "modulation", "depth")
PICTURES = 6  # test views whose errors are kept pixel by pixel
CONDITIONS = {
    "noise 4": {"noise": 4.0},
    "noise 8": {"noise": 8.0},
    "gamma 0.8": {"gamma": 0.8},
    "gamma 1.25": {"gamma": 1.25},
    "half as bright": {"gain": 0.5},
    "a quarter as bright": {"gain": 0.25},
    "texture 0.5": {"texture": 0.5},
}
"""Cameras and surfaces that no network was trained for."""

CONDITION_VIEWS = 100
SUMS = {"rad": 3, "mm": 3, "order": 2, "spike": 2, "own_spike": 2}
"""Of each kind of error how many of number, sum of |e| and sum of squares are kept a model."""


def run(
    name: str,
    preset: str,
    data: str | Path,
    work: str | Path,
    results: str | Path = RESULTS,
    **how,
) -> dict:
    """Make a run, or go on with it, unless it is finished; returns what it found.

    Parameters
    ----------
    name : str
        One of `experiments`.
    preset : str
    data : path
        A dataset of the preset.
    work : path
        Folder for the folders of runs under way.
    results : path
        Folder with tiny/rates.json, for the results of each preset in a folder of its own.
    **how
        Options of `fit`: workers, device, progress.

    Raises
    ------
    ValueError
        If there is no such run, or the dataset is of another preset.
    BlockingIOError
        If another process is making it.
    """
    known = experiments(preset)
    if name not in known:
        raise ValueError(f"run {name!r} given; the runs are {', '.join(known)}")
    store, work, results = open_store(data), Path(work) / preset / name, Path(results)
    if (made := store.manifest["settings"]["preset"]) != preset:
        raise ValueError(f"{data} was made with the preset {made}, and {preset} is asked for")
    one = known[name]
    rate = best_rates(results / "tiny" / "rates.json")[one.kind]
    settings = replace(budget(preset), rate=rate, seed=one.seed)
    about = {
        "name": name,
        "preset": preset,
        "seed": one.seed,
        "data": store.manifest["content"],
        "method": settings_of(one.method),
        "settings": plain(asdict(settings)),
    }
    path = results / preset / f"{name}.json"
    if (found := finished(path, about)) is not None:
        return found
    work.mkdir(parents=True, exist_ok=True)
    with _claim(work, name):
        resume = (work / CHECKPOINT).is_file()
        _, history = fit(one.method, data, settings, work, resume=resume, **how)
        trained = load_weights(work / WEIGHTS)
        found = {**about, **_facts(trained, history)}
        path.parent.mkdir(parents=True, exist_ok=True)
        found |= measured(trained, data, path.with_suffix(".npz"), **_loading(how))
        write_whole(path, f"{json.dumps(_short(found), separators=(',', ':'))}\n".encode())
    return json.loads(path.read_text())


def finished(path: Path, about: dict) -> dict | None:
    """What a run found, if it is the run `about` describes."""
    if not path.is_file():
        return None
    found = json.loads(path.read_text())
    same = {**found, "method": settings_of(method_of(found["method"]))}
    return found if all(same.get(k) == v for k, v in plain(about).items()) else None


@contextmanager
def _claim(work: Path, name: str) -> Iterator[None]:
    """Hold a run against other processes; the lock dies with its process."""
    try:
        with FileLock(work / ".lock", timeout=0):
            yield
    except Timeout:
        raise BlockingIOError(f"another process is making the run {name}") from None


def _facts(trained: Trained, history: list[dict]) -> dict:
    """What a run cost."""
    spent = cost(trained.network, tuple(trained.about["camera"]))
    return {
        "version": version("fpputil"),
        "hardware": trained.about["training"]["hardware"],
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


def measured(trained: Trained, data: str | Path, pictures: Path, **loading) -> dict:
    """Everything that is measured on a network: test views once, others, other cameras.

    Parameters
    ----------
    trained : Trained
    data : path
        The dataset.
    pictures : Path
        File for the errors (P,) of some test views, by number, at the pixels of their masks. Their
        masks, phases, modulation and depths go to `VIEWS` beside it.
    **loading
        Options of `predictions`.

    Returns
    -------
    dict
        splits: of "test" and "held-out" the measures of `Score.summary` with the second phase
        and "alone", without it; models and sums: of each model of the test split number, sum and
        sum of squares of its errors (`SUMS`); inspection: of `Inspection`; conditions: the
        measures, on some test views, under each of `CONDITIONS`.
    """
    found = {"splits": {}, "conditions": {}}
    for split in ("test", "held-out"):
        seen = _Seen(opened := open_split(trained, data, split))
        both, alone = evaluate(trained, opened, seen, **loading)
        measures = {"measures": both.summary(), "alone": alone.summary()}
        found["splits"][split] = {"views": len(opened), **measures}
        if split == "test":
            found |= {"models": list(both.models), "inspection": seen.inspection.summary()}
            found["sums"] = {
                kind: [own[kind][1 : 1 + number].tolist() for own in both.models.values()]
                for kind, number in SUMS.items()
            }
            _write_arrays(pictures, seen.kept)
            _write_arrays(pictures.with_name(VIEWS), seen.truth)
    for name, options in CONDITIONS.items():
        camera = Augmentation(**{k: (v, v) for k, v in options.items() if k != "texture"})
        other = open_split(trained, data, "test", camera, texture=options.get("texture", 0.0))
        both, _ = evaluate(trained, other, views=spread(other, CONDITION_VIEWS), **loading)
        found["conditions"][name] = both.summary()
    return found


class _Seen:
    """What is kept of views beside their errors by model."""

    def __init__(self, data: SynthFringe):
        self.inspection, self.kept, self.truth = Inspection(), {}, {}
        self.chosen = {int(data.indices[k]) for k in spread(data, PICTURES)}

    def __call__(self, item: dict, found) -> None:
        self.inspection.add(item, found)
        if int(item["index"]) in self.chosen:
            self.kept[f"{item['index']}"] = (found.Phi - item["Phi"])[item["mask"]]
            self.truth |= {f"{item['index']}-{k}": item[k] for k in TRUTH}


def _write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    write_whole(path, file.getvalue())


def _short(value):
    """The value with numbers of seven digits, and None for NaN, as JSON has it."""
    if isinstance(value, dict):
        return {k: _short(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_short(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.7g}") if np.isfinite(value) else None
    return value
