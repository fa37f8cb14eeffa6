"""The same small search for a learning rate, for every method (chapter 10)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from fpputil.checks import anything, conform, not_negative, or_null, positive
from fpputil.dataset.store import open_store
from fpputil.experiments.registry import LEARNING_RATES, SEARCH_CONFIG, SEARCHED, methods
from fpputil.experiments.rows import read_stored
from fpputil.files import write_whole
from fpputil.learning.devices import device_of, hardware
from fpputil.learning.training import fit
from fpputil.learning.weights import plain
from fpputil.networks.methods import settings_of

MEASURES = ("mae", "rmse", "order_errors")


def search_learning_rate(
    data: str | Path, path: str | Path, kinds: Sequence[str] = (), **how
) -> dict[str, float]:
    """The learning rate with the least validation MAE (radians) of each of some kinds of runs.

    Parameters
    ----------
    data : path
        A dataset of the preset "tiny".
    path : path
        JSON file of what was tried; rates that it lacks are tried. It holds data (name of the
        dataset), settings, methods, hardware, and runs: by kind and rate mae, rmse and
        order_errors of validation views, and seconds; mae is None where the loss was not finite.
    kinds : sequence of str
        Of `SEARCHED`; by default all.
    **how
        Options of `fit`: workers, device, progress.
    """
    kinds = kinds or SEARCHED
    if wrong := [kind for kind in kinds if kind not in SEARCHED]:
        raise ValueError(f"{wrong[0]!r} given; rates are searched for {', '.join(SEARCHED)}")
    path, store, known = Path(path), open_store(data), methods("tiny")
    if (made := store.manifest["settings"]["preset"]) != "tiny":
        raise ValueError(f"{data} was made with the preset {made}; rates are searched at tiny")
    wanted = {
        "data": store.name,
        "settings": plain(asdict(SEARCH_CONFIG)),
        "methods": {kind: settings_of(known[kind]) for kind in SEARCHED},
    }
    search = read_rates(path) if path.is_file() else {**wanted, "runs": {}}
    if other := [k for k in wanted if search.get(k) != wanted[k]]:
        raise ValueError(f"{path} is a search with other {other[0]}; remove it to search anew")
    path.parent.mkdir(parents=True, exist_ok=True)
    for kind in kinds:
        tried = search["runs"].setdefault(kind, {})
        while (rate := _next_rate(tried)) is not None:
            config = replace(SEARCH_CONFIG, learning_rate=rate)
            try:
                last = fit(known[kind], data, config, **how)[1][-1]
                measured = {k: last[f"validation_{k}"] for k in MEASURES}
                tried[f"{rate:g}"] = measured | {"seconds": last["seconds"]}
            except FloatingPointError:
                tried[f"{rate:g}"] = {"mae": None}
            search["hardware"] = hardware(device_of(how.get("device")))
            write_whole(path, f"{json.dumps(search, indent=1)}\n".encode())
    return {kind: _best(search["runs"][kind]) for kind in kinds}


def _next_rate(tried: dict[str, dict]) -> float | None:
    """The next rate to try, or None if the best is known and none of the ends."""
    if left := [rate for rate in LEARNING_RATES if f"{rate:g}" not in tried]:
        return left[0]
    best, rates = _best(tried), [float(rate) for rate in tried]
    return {min(rates): best / 2, max(rates): best * 2}.get(best)


def _best(tried: dict[str, dict]) -> float:
    """The rate with the least MAE; one that diverged has none."""
    mae = {float(rate): result["mae"] for rate, result in tried.items()}
    return min(mae, key=lambda rate: (mae[rate] is None, mae[rate]))


def best_learning_rate(path: str | Path, kind: str) -> float:
    """The rate that `search_learning_rate` found for a kind; an error if it has not yet."""
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not there; search first: fpp results rates")
    tried = read_rates(path)["runs"].get(kind, {})
    if _next_rate(tried) is not None:
        raise ValueError(f"{path} lacks rates of {kind}; go on searching: fpp results rates {kind}")
    return _best(tried)


def _tried(name: str, value) -> None:
    conform(name, value, {...: {"mae": or_null(not_negative), ...: anything}})
    for rate in value:
        positive(f"rate in {name}", float(rate))


def read_rates(path: Path) -> dict:
    """What `search_learning_rate` wrote; ValueError with its path if it is cut or foreign."""
    return read_stored(path, {"runs": {...: _tried}, ...: anything})
