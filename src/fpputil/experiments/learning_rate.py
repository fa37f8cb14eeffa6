"""The same small search for a learning rate, for every method (chapter 10)."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from fpputil.dataset.store import open_store
from fpputil.experiments.registry import LEARNING_RATES, SEARCH_CONFIG, SEARCHED, methods
from fpputil.files import write_whole
from fpputil.learning.devices import device_of, hardware
from fpputil.learning.training import fit
from fpputil.networks.methods import settings_of

MEASURES = ("mae", "rmse", "order_errors")


def search_learning_rate(
    data: str | Path, path: str | Path, kinds: Sequence[str] = (), **how
) -> dict[str, float]:
    """Try learning rates for each of some kinds of runs, those that a JSON file lacks.

    Parameters
    ----------
    data : path
        A dataset of the preset "tiny".
    path : path
        Of the file: data (name of the dataset), settings, methods, hardware, and runs: of each
        kind and rate mae, rmse (radians) and order_errors (0 to 1) on validation views, and
        seconds; mae is None where the loss was not finite.
    kinds : sequence of str
        Of `SEARCHED`; by default all.
    **how
        Options of `fit`: workers, device, progress.

    Returns
    -------
    dict of str to float
        The rate with the least validation MAE of each kind.

    Raises
    ------
    ValueError
        If there is no such kind, the dataset is of another preset, or the file is of another
        search.
    """
    kinds = kinds or SEARCHED
    if wrong := [kind for kind in kinds if kind not in SEARCHED]:
        raise ValueError(f"{wrong[0]!r} given; rates are searched for {', '.join(SEARCHED)}")
    path, store, known = Path(path), open_store(data), methods("tiny")
    if (made := store.manifest["settings"]["preset"]) != "tiny":
        raise ValueError(f"{data} was made with the preset {made}; rates are searched at tiny")
    wanted = {
        "data": store.name,
        "settings": as_json(asdict(SEARCH_CONFIG)),
        "methods": {kind: settings_of(known[kind]) for kind in SEARCHED},
    }
    search = read_json(path, *wanted, "runs") if path.is_file() else {**wanted, "runs": {}}
    if other := [k for k in wanted if search[k] != wanted[k]]:
        raise ValueError(f"{path} is a search with other {other[0]}; remove it to search anew")
    path.parent.mkdir(parents=True, exist_ok=True)
    for kind in kinds:
        tried = search["runs"].setdefault(kind, {})
        while (rate := _next_rate(tried)) is not None:
            tried[f"{rate:g}"] = _try(known[kind], data, rate, how)
            search["hardware"] = hardware(device_of(how.get("device") or "cpu"))
            write_whole(path, f"{json.dumps(search, indent=1)}\n".encode())
    return {kind: _best(search["runs"][kind]) for kind in kinds}


def _try(method, data, rate: float, how: dict) -> dict:
    try:
        _, history = fit(method, data, replace(SEARCH_CONFIG, learning_rate=rate), **how)
    except FloatingPointError:
        return {"mae": None}
    last = history[-1]
    return {**{k: last[f"validation_{k}"] for k in MEASURES}, "seconds": last["seconds"]}


def _next_rate(tried: dict[str, dict]) -> float | None:
    """The next rate to try, or None if the best is known and none of the ends."""
    for rate in LEARNING_RATES:
        if f"{rate:g}" not in tried:
            return rate
    rates, best = sorted(map(float, tried)), _best(tried)
    if best == rates[0]:
        return best / 2
    return best * 2 if best == rates[-1] else None


def _best(tried: dict[str, dict]) -> float:
    """The rate with the least MAE; one that diverged has none."""
    mae = {float(rate): result["mae"] for rate, result in tried.items()}
    return min(mae, key=lambda rate: math.inf if mae[rate] is None else mae[rate])


def best_learning_rate(path: str | Path, kind: str) -> float:
    """The rate with the least validation MAE of a kind, as `search_learning_rate` found it.

    Raises
    ------
    FileNotFoundError, ValueError
        If nothing was searched yet, or not enough for this kind.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not there; search first: fpp results rates")
    tried = read_json(path, "runs")["runs"].get(kind, {})
    if _next_rate(tried) is not None:
        raise ValueError(f"{path} lacks rates of {kind}; go on searching: fpp results rates {kind}")
    return _best(tried)


def read_json(path: Path, *needed: str) -> dict:
    """A JSON file of results; ValueError with its path if it is cut or lacks what is needed."""
    try:
        values = json.loads(path.read_text())
        if lacking := [name for name in needed if name not in values]:
            raise ValueError(f"no {lacking[0]} in it")
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path} is no file of results ({error}); remove it") from error
    return values


def as_json(value):
    """The value as it comes back from JSON: tuples as lists, keys as text."""
    return json.loads(json.dumps(value))
