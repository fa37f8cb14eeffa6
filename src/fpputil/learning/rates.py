"""The same small search for a learning rate, for every method (chapter 10)."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

from fpputil.checks import write_whole
from fpputil.learning.devices import device_of, hardware
from fpputil.learning.experiments import RATES, SEARCH, methods
from fpputil.learning.methods import METHODS, settings_of
from fpputil.learning.run import plain
from fpputil.learning.store import open_store
from fpputil.learning.training import fit

MEASURES = ("mae", "rmse", "order_errors")


def search(data: str | Path, path: str | Path, **how) -> dict:
    """Try the learning rates of every method, those that are missing in a JSON file.

    Parameters
    ----------
    data : path
        A dataset of the preset "tiny".
    path : path
        Of the file: data (checksum), settings, methods, hardware, and runs: of each method and
        rate mae, rmse (radians) and order_errors (0 to 1) on validation views, and seconds.
    **how
        Options of `fit`: workers, device, progress.

    Returns
    -------
    dict of str to float
        The rate with the least validation MAE of each method.
    """
    path, store = Path(path), open_store(data)
    about = {
        "data": store.manifest["content"],
        "settings": plain(asdict(SEARCH)),
        "methods": {kind: settings_of(methods("tiny")[kind]) for kind in METHODS},
    }
    found = {**about, "runs": {}}
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_file():
        found = json.loads(path.read_text())
        if other := [k for k in about if found.get(k) != about[k]]:
            raise ValueError(f"{path} is a search with other {other[0]}; remove it to search anew")
    for kind in METHODS:
        tried = found["runs"].setdefault(kind, {})
        for rate in RATES:
            if f"{rate:g}" in tried:
                continue
            _, history = fit(methods("tiny")[kind], data, replace(SEARCH, rate=rate), **how)
            last = history[-1]
            errors = {k: last[f"validation_{k}"] for k in MEASURES}
            tried[f"{rate:g}"] = {**errors, "seconds": last["seconds"]}
            found["hardware"] = hardware(device_of(how.get("device") or "cpu"))
            write_whole(path, f"{json.dumps(found, indent=1)}\n".encode())
    return best_rates(path)


def best_rates(path: str | Path) -> dict[str, float]:
    """The rate with the least validation MAE of each method, as `search` found them.

    Raises
    ------
    FileNotFoundError, ValueError
        If nothing was searched yet, or not everything.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not there; search first: fpp results rates")
    runs = json.loads(path.read_text())["runs"]
    wanted = {f"{rate:g}" for rate in RATES}
    if lacking := [kind for kind in METHODS if runs.get(kind, {}).keys() < wanted]:
        raise ValueError(f"{path} lacks rates of {lacking[0]}; go on searching: fpp results rates")
    return {k: float(min(tried, key=lambda r: tried[r]["mae"])) for k, tried in runs.items()}
