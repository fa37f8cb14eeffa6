"""Runs that tell what our readings of SFNet are worth, by name (chapter 8).

``python -m fpputil.experiments.choices PATH`` trains the runs of `CHOICES` that are not in
``data/results/sfnet-choices.json`` yet, on the training split of the dataset in PATH.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

import torch

from fpputil.dataset.store import open_store
from fpputil.experiments.recipes import recipe
from fpputil.files import write_whole
from fpputil.learning.devices import hardware
from fpputil.learning.training import fit
from fpputil.learning.weights import plain
from fpputil.networks.losses import Weights
from fpputil.networks.methods import SFNetMethod, method_of, settings_of

PAPER = SFNetMethod()
OURS = replace(PAPER, mixing="every level", weights=Weights(order=False, mean=True))
CHOICES = {
    "losses as the paper's, joined deepest": (PAPER, 0),
    "absolute phase modulo 2 pi": (replace(PAPER, weights=Weights(order=False)), 0),
    "mean, not sum, in Eq. 14": (replace(PAPER, weights=Weights(mean=True)), 0),
    "both": (replace(PAPER, weights=Weights(order=False, mean=True)), 0),
    "both, joined at every level": (OURS, 0),
    "both, joined at every level, seed 1": (OURS, 1),
    "both, joined nowhere": (replace(OURS, mixing="none"), 0),
    "both, every level, phase predicted": (replace(OURS, target="phase"), 0),
}
"""Method and seed of each run."""

SHORT = replace(recipe("tiny")[1], epochs=1, training_views=2880, validation_views=200)
RESULTS = Path("data/results/sfnet-choices.json")


def run_choices(data: str | Path, path: str | Path = RESULTS, *, workers: int = 1) -> dict:
    """Train what is missing in the JSON file `path`, one run after the other.

    Returns
    -------
    dict
        data (checksum), views, hardware, and runs: of each name mae, rmse (radians),
        order_errors (0 to 1) on validation views, seconds and seed.

    A run of another method or other settings than these is made anew.

    Raises
    ------
    ValueError
        If the file holds runs on another dataset.
    """
    path, content = Path(path), open_store(data).name
    found = {"data": content, "views": SHORT.training_views, "runs": {}}
    if path.is_file():
        found = json.loads(path.read_text())
        if found["data"] != content:
            raise ValueError(f"{path} holds runs on the dataset {found['data']}, not {content}")
    for name, (method, seed) in CHOICES.items():
        wanted = {"seed": seed, "method": settings_of(method), "settings": plain(asdict(SHORT))}
        if (done := found["runs"].get(name)) and _as_plain(done) == wanted:
            continue
        _, history = fit(method, data, replace(SHORT, seed=seed), workers=workers, progress=True)
        last = history[-1]
        found["runs"][name] = {
            "mae": last["validation_mae"],
            "rmse": last["validation_rmse"],
            "order_errors": last["validation_order_errors"],
            "seconds": last["seconds"],
            **wanted,
        }
        found["hardware"] = hardware(torch.device("cpu"))
        write_whole(path, f"{json.dumps(found, indent=1)}\n".encode())
    return found


def _as_plain(done: dict) -> dict:
    """Seed, method and settings of a run that was recorded, as this version writes them."""
    return {
        "seed": done["seed"],
        "method": settings_of(method_of(done["method"])),
        "settings": done["settings"],
    }


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m fpputil.experiments.choices PATH, a dataset of the preset tiny")
    run_choices(sys.argv[1])
