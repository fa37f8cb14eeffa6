"""Tables 3 to 6: the paper's values beside ours, out of the files of `results` (chapters 10, 11).

Intervals come from drawing test models anew, and, where there are several, seeds. All runs are
measured on the same models, so that a difference is drawn pair by pair.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import kendalltau

from fpputil.checks import seeded, whole
from fpputil.learning.experiments import ROWS, SEEDS, seeded_name
from fpputil.learning.results import RESULTS

MEASURES = {
    "mae_rad": ("rad", False),
    "rmse_rad": ("rad", True),
    "mae_mm": ("mm", False),
    "rmse_mm": ("mm", True),
    "order_errors": ("order", False),
    "spikes": ("spike", False),
}
"""Kind of the sums of each measure, and whether it is a root of squares."""

PAPER = {
    3: {
        "SFNet": (0.0527, 0.6543, 0.0790, 1.2359),
        "SIDO": (0.3610, 1.2945, 1.6966, 5.5933),
        "PSNet": (0.0754, 0.6759, 0.1600, 1.8549),
        "DLALNet": (0.0908, 1.3113, 0.1438, 1.8469),
    },
    4: {
        "A": (0.0744, 0.8241, 0.1589, 1.8864),
        "B": (0.0546, 0.6722, 0.0865, 1.2899),
        "C": (0.0527, 0.6543, 0.0790, 1.2359),
    },
    5: {
        "1 + 1": (0.0527, 0.6543, 0.0790, 1.2359),
        "2 + 2": (0.0482, 0.5581, 0.0571, 1.1621),
        "3 + 3": (0.0441, 0.5446, 0.0477, 1.1042),
    },
    6: {
        "1e-1, 1e-5": (0.0541, 0.6707, 0.0797, 1.2594),
        "1e-1, 1e-6": (0.0524, 0.6546, 0.0799, 1.3225),
        "1e-1, 1e-7": (0.0552, 0.6841, 0.0811, 1.3368),
        "1e-2, 1e-5": (0.0562, 0.7082, 0.0832, 1.2875),
        "1e-2, 1e-6": (0.0527, 0.6543, 0.0790, 1.2359),
        "1e-2, 1e-7": (0.0508, 0.6557, 0.0801, 1.2567),
        "1e-3, 1e-5": (0.0562, 0.6976, 0.0808, 1.2580),
        "1e-3, 1e-6": (0.0547, 0.6723, 0.0829, 1.2834),
        "1e-3, 1e-7": (0.0598, 0.7004, 0.0851, 1.2927),
    },
    "ours": {},
}
"""MAE and RMSE in rad, MAE and RMSE in mm, as printed in the paper."""


def read_runs(preset: str, path: str | Path = RESULTS) -> dict[str, dict]:
    """What all finished runs of a preset found, by name.

    Raises
    ------
    ValueError
        If they were made on different datasets.
    """
    files = sorted(f for f in (Path(path) / preset).glob("*.json") if f.stem != "rates")
    runs = {f.stem: json.loads(f.read_text()) for f in files}
    if len(found := {r["data"] for r in runs.values()}) > 1:
        raise ValueError(
            f"{Path(path) / preset} holds runs on {len(found)} datasets; a table is about one"
        )
    return runs


def seeds_of(name: str, runs: dict[str, dict]) -> list[dict]:
    """The finished runs of a row, one a seed."""
    names = [seeded_name(name, seed) for seed in SEEDS.get(name, (0,))]
    return [runs[n] for n in names if n in runs]


def drawn(own: list[dict], measure: str, seed: int = 0, draws: int = 2000) -> np.ndarray:
    """A measure of a row: its value, then that of each draw of models and seeds.

    Parameters
    ----------
    own : list of dict
        Runs of the row, one a seed.
    measure : str
        One of `MEASURES`.
    seed : int
        Of the draws. With the same seed, rows are drawn alike and may be subtracted.

    Returns
    -------
    (draws + 1,) array
    """
    kind, root = MEASURES[measure]
    sums = np.array([run["sums"][kind] for run in own], float)  # (seeds, models, sums)
    if len({tuple(run["models"]) for run in own}) != 1:
        raise ValueError("runs measured on different models given; they cannot be compared")
    rng, (count, models, _) = seeded(seed), sums.shape
    times = rng.multinomial(models, np.full(models, 1 / models), whole("draws", draws, 1))
    shares = rng.multinomial(count, np.full(count, 1 / count), draws) / count
    times, shares = (
        np.vstack([np.full(a.shape[1], first), a]) for a, first in ((times, 1), (shares, 1 / count))
    )
    pooled = np.einsum("dm,smk->dsk", times, sums)
    values = pooled[..., 2 if root else 1] / pooled[..., 0]
    return (shares * (np.sqrt(values) if root else values)).sum(axis=1)


def interval(values: np.ndarray) -> tuple[float, float, float]:
    """Value, and the 2.5 and 97.5 percentiles of its draws, of an array from `drawn`."""
    return float(values[0]), *(float(v) for v in np.percentile(values[1:], (2.5, 97.5)))


@dataclass(frozen=True)
class Row:
    """A row of a table.

    Parameters
    ----------
    label, name : str
        In the table, and of its run.
    seeds : int
        How many runs it is the mean of.
    measures : dict
        Of each of `MEASURES` (value, low, high).
    difference : (value, low, high) or None
        Of its MAE in radians and that of the row of SFNet, positive where SFNet is better.
    paper : tuple or None
        What the paper prints.
    """

    label: str
    name: str
    seeds: int
    measures: dict[str, tuple[float, float, float]]
    difference: tuple[float, float, float] | None
    paper: tuple[float, ...] | None


def table(number: int | str, runs: dict[str, dict]) -> list[Row]:
    """Rows of a table whose runs are finished.

    Parameters
    ----------
    number : int or str
        3 to 6, or "ours".
    runs : dict
        From `read_runs`.

    Raises
    ------
    ValueError
        If there is no such table.
    """
    if number not in ROWS:
        raise ValueError(f"table {number!r} given; the tables are {', '.join(map(str, ROWS))}")
    reference, rows = seeds_of("sfnet", runs), []
    for label, name in ROWS[number].items():
        if not (own := seeds_of(name, runs)):
            continue
        difference = None
        if name != "sfnet" and reference:
            same = min(len(own), len(reference))
            pair = (drawn(r[:same], "mae_rad") for r in (own, reference))
            difference = interval(next(pair) - next(pair))
        measures = {m: interval(drawn(own, m)) for m in MEASURES}
        paper = PAPER[number].get(label)
        rows.append(Row(label, name, len(own), measures, difference, paper))
    return rows


COLUMNS = {
    "mae_rad": ("MAE, rad", 1),
    "rmse_rad": ("RMSE, rad", 1),
    "mae_mm": ("MAE, mm", 1),
    "rmse_mm": ("RMSE, mm", 1),
    "order_errors": ("wrong orders, %", 100),
}
"""Title of each measure that is printed, and what it is multiplied with."""


def as_text(rows: list[Row], control: dict | None = None) -> str:
    """A table in columns: the paper's value above ours with its interval, row by row.

    Parameters
    ----------
    rows : list of Row
    control : dict, optional
        Measures of phi_h of SFNet alone, as ``run["splits"]["test"]["alone"]`` has them.
    """
    lines = [f"{'':32}" + "".join(f"{title:25}" for title, _ in COLUMNS.values())]
    for row in rows:
        lines.append(f"{row.label:32}" + "".join(_cells(row.measures)))
        if row.paper:
            lines.append(f"{'  in the paper':32}" + "".join(f"{x:<25.4f}" for x in row.paper))
    if control:
        lines.append(f"{'phi_h of SFNet alone':32}" + "".join(_cells(control)))
    return "\n".join(line.rstrip() for line in lines)


def _cells(measures: dict):
    for key, (_, scale) in COLUMNS.items():
        value, low, high = (scale * x for x in measures[key])
        yield f"{value:.4f} [{low:.3f}, {high:.3f}]".ljust(25)


def agreement(rows: list[Row]) -> tuple[float, float]:
    """Kendall's tau of the paper's MAE and ours over rows, and its p-value."""
    pairs = [(row.paper[0], row.measures["mae_rad"][0]) for row in rows if row.paper]
    found = kendalltau(*zip(*pairs, strict=True))
    return float(found.statistic), float(found.pvalue)
