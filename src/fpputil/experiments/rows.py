"""Rows of Tables 3 to 6 and of our own, the runs behind them by name, and which are finished."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from fpputil.checks import Form, anything, finite, not_negative, read_json

CONSISTENCY, GEOMETRIC = ("1e-1", "1e-2", "1e-3"), ("1e-5", "1e-6", "1e-7")
BY_WEIGHTS = {(c, g): f"sfnet-{c}-{g}" for c in CONSISTENCY for g in GEOMETRIC}
BY_WEIGHTS["1e-2", "1e-6"] = "sfnet"
"""Name of the run with each pair of weights of the losses (Table 6)."""

ROWS = {
    3: {"SFNet": "sfnet", "SIDO": "sido", "PSNet": "psnet", "DLALNet": "dlalnet"},
    4: {"A": "sfnet-a", "B": "sfnet-b", "C": "sfnet"},
    5: {"1 + 1": "sfnet", "2 + 2": "sfnet-2-frames", "3 + 3": "sfnet-3-frames"},
    6: {f"{c}, {g}": name for (c, g), name in BY_WEIGHTS.items()},
    "ours": {
        "best": "best",
        "best, normalised": "best-normalised",
        "losses as printed": "sfnet-printed",
        "joined at every level": "sfnet-every-level",
        "row B, joined at every level": "sfnet-b-every-level",
        "reference unrefined": "sfnet-zmin",
        "reference at pitch 114": "sfnet-mid",
        "reference at pitch 912": "sfnet-unit",
        "PSNet, errors in fringes": "psnet-fringe",
        "the same, unit pitch at step 4": "psnet-step-4",
        "the same, normalised": "psnet-normalised",
        "SIDO, errors in fringes": "sido-fringe",
        "SIDO without the plane": "sido-no-plane",
        "DLALNet, SFNet's losses": "dlalnet-losses",
        "DLALNet, normalised": "dlalnet-normalised",
    },
}
"""Name of the run of each row of each table; "ours" are rows that the paper does not have."""

SEEDS = {name: (0, 1, 2) for table in (3, 4) for name in ROWS[table].values()}
MORE = ("best", "sfnet-every-level", "sfnet-b-every-level", "psnet-normalised")
SEEDS |= dict.fromkeys(MORE, (0, 1, 2))
"""Seeds of the runs that have more than seed 0."""

DRAWN = frozenset(name for table in (3, 4) for name in ROWS[table].values())
"""Runs of which chapters 10 and 11 draw single views: those of seed 0, but not of "near"."""

NEAR = (*ROWS[3].values(), "sfnet-mid")
"""Runs of the preset "near", one seed each."""


class Finished(NamedTuple):
    """What a list says of a finished run: MAE of the test views, radians, and seconds to train."""

    mae: float
    seconds: float


MEASURES = {"mae_rad": (finite,) * 3, ...: anything}
FORM = {
    "seconds": not_negative,
    "splits": {"test": {"measures": MEASURES, ...: anything}, ...: anything},
    ...: anything,
}


def seeded_name(name: str, seed: int) -> str:
    """Name of the run of a row with a seed: "sfnet", "sfnet-seed-1"."""
    return f"{name}-seed-{seed}" if seed else name


def run_names(preset: str) -> dict[str, tuple[str, int]]:
    """Row and seed of all runs of a preset by their names, in the order in which they are made.

    Seed 0 of every row comes first, so that a table is whole before its intervals are.

    >>> len(run_names("tiny")), run_names("tiny")["sfnet-seed-1"]
    (51, ('sfnet', 1))
    """
    if preset == "near":
        return {name: (name, 0) for name in NEAR}
    names = dict.fromkeys(name for table in ROWS.values() for name in table.values())
    seeded = {seeded_name(name, seed): (name, seed) for seed in (1, 2) for name in SEEDS}
    return {name: (name, 0) for name in names} | seeded


def finished(preset: str, path: str | Path) -> dict[str, Finished]:
    """The runs of a preset that are finished, from the folder of the results.

    Whether they were made as this version would make them is for `read_results` to tell.
    ValueError with the path if a file is cut or foreign.
    """
    runs = {}
    for name in run_names(preset):
        if (file := Path(path) / preset / f"{name}.json").is_file():
            stored = read_stored(file, FORM)
            mae, _, _ = stored["splits"]["test"]["measures"]["mae_rad"]
            runs[name] = Finished(mae, stored["seconds"])
    return runs


def read_stored(path: Path, form: Form) -> dict:
    """A JSON file of results; ValueError with its path if it is cut or has another form."""
    try:
        return read_json(path, form, "file of results")
    except ValueError as error:
        raise ValueError(f"{error}; remove it") from error
