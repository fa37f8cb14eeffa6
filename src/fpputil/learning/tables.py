"""Tables 3 to 6: the paper's values beside ours, out of the files of `results` (chapters 10, 11).

Two things make a mean uncertain: which models were measured, and which seed the network was
trained from. Models are drawn anew (all runs are measured on the same, so that a difference is
drawn pair by pair); how much a seed moves a measure is pooled over the rows of a method that have
several seeds, in parts of the measure, and counts for its rows with one seed, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import kendalltau
from scipy.stats import t as student

from fpputil.checks import seeded, whole
from fpputil.learning.experiments import ROWS, SEEDS, seeded_name
from fpputil.learning.paper import PAPER

MEASURES = {
    "mae_rad": ("rad", False),
    "rmse_rad": ("rad", True),
    "mae_mm": ("mm", False),
    "rmse_mm": ("mm", True),
    "order_errors": ("order", False),
    "spikes": ("spike", False),
    "mae_high": ("high", False),
    "mae_low": ("low", False),
}
"""Kind of the sums of each measure, and whether it is a root of squares."""

Interval = tuple[float, float, float]
"""A value and the ends of its 95 % interval."""

Spread = dict[str, tuple[float, int]]
"""By method: standard deviation that a seed gives a measure, in parts of it; degrees of freedom."""


def seeds_of(name: str, runs: dict[str, dict], several: bool = True) -> list[dict]:
    """The finished runs of a row, one a seed, or that of seed 0 alone."""
    seeds = SEEDS.get(name, (0,)) if several else (0,)
    names = [seeded_name(name, seed) for seed in seeds]
    return [runs[n] for n in names if n in runs]


def drawn(own: list[dict], measure: str, part=("splits", "test"), seed=0, draws=1000) -> np.ndarray:
    """A measure of a row, the mean over its seeds, for all models and for each draw of models.

    Parameters
    ----------
    own : list of dict
        Runs of the row, one a seed.
    measure : str
        One of `MEASURES`.
    part : (str, str)
        ("splits", "test"), ("splits", "held-out") or ("conditions", name).
    seed : int
        Of the draws. With the same seed, rows are drawn alike and may be subtracted.

    Returns
    -------
    (draws + 1,) array

    Raises
    ------
    ValueError
        If the runs were measured on different models.
    """
    kind, root = MEASURES[measure]
    parts = [run[part[0]][part[1]] for run in own]
    if len({tuple(p["models"]) for p in parts}) != 1:
        raise ValueError("runs measured on different models given; they cannot be compared")
    sums = np.array([p["sums"][kind] for p in parts], float)  # (seeds, models, 3)
    number = sums.shape[1]
    times = seeded(seed).multinomial(number, np.full(number, 1 / number), whole("draws", draws, 1))
    pooled = np.einsum("dm,smk->dsk", np.vstack([np.ones(number), times]), sums)
    values = pooled[..., 2 if root else 1] / pooled[..., 0]
    return (np.sqrt(values) if root else values).mean(axis=1)


def seed_spread(runs: dict[str, dict], measure: str) -> Spread:
    """How much a seed moves a measure of a method, in parts of it.

    Pooled over the rows of the method that have several seeds; methods without one are left out.
    """
    squares, freedoms = {}, {}
    for name in SEEDS:
        own = [run for run in seeds_of(name, runs) if _has(run, measure)]
        values = [drawn([run], measure, draws=1)[0] for run in own]
        if len(values) > 1 and np.mean(values) > 0:
            method = _method(own)
            square = np.sum((np.array(values) / np.mean(values) - 1) ** 2)
            squares[method] = squares.get(method, 0.0) + square
            freedoms[method] = freedoms.get(method, 0) + len(values) - 1
    return {m: (math.sqrt(squares[m] / freedom), freedom) for m, freedom in freedoms.items()}


def _method(own: list[dict]) -> str:
    return own[0]["method"]["method"]


def moved_by_seeds(rows: list[tuple[list[dict], float]], spread: Spread) -> tuple[float, float]:
    """Standard deviation that seeds give to a row, or to the difference of two; degrees of freedom.

    Where two methods meet, these are those of Welch and Satterthwaite.

    Parameters
    ----------
    rows : list of (runs, value)
        The runs of each row, one a seed, and the mean of the measure.
    spread : dict
        From `seed_spread`.
    """
    weights = {}
    for own, value in rows:
        weights[_method(own)] = weights.get(_method(own), 0.0) + value**2 / len(own)
    parts = [
        (spread[m][0] ** 2 * weight, spread[m][1]) for m, weight in weights.items() if m in spread
    ]
    total = sum(square for square, _ in parts)
    if total == 0:
        return 0.0, 0.0
    return math.sqrt(total), total**2 / sum(square**2 / freedom for square, freedom in parts)


def interval(values: np.ndarray, moved: float, freedom: float) -> Interval:
    """Value and 95 % interval, from its draws of models and from how far seeds move it.

    Parameters
    ----------
    values : (draws + 1,) array
        From `drawn`, or a difference of two.
    moved : float
        Standard deviation that seeds give it.
    freedom : float
        Degrees of freedom behind `moved`; 0 if nothing is known about seeds.
    """
    by_seeds = student.ppf(0.975, freedom) * moved if freedom else 0.0
    half = math.hypot(1.96 * values[1:].std(), by_seeds)
    return float(values[0]), float(values[0] - half), float(values[0] + half)


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
        Of each of `MEASURES` that it has, value and interval.
    difference : (value, low, high) or None
        MAE in radians above that of the row of SFNet.
    paper : tuple or None
        What the paper prints.
    """

    label: str
    name: str
    seeds: int
    measures: dict[str, Interval]
    difference: Interval | None
    paper: tuple[float, ...] | None


def measures_of(own: list[dict], spreads: dict, part=("splits", "test")) -> dict:
    """Each of `MEASURES` that a row has, value and interval; `seed_spread` of each is given."""
    found = {}
    for measure in MEASURES:
        if _has(own[0], measure):
            values = drawn(own, measure, part)
            moved = moved_by_seeds([(own, values[0])], spreads[measure])
            found[measure] = interval(values, *moved)
    return found


def _has(run: dict, measure: str) -> bool:
    return MEASURES[measure][0] in run["splits"]["test"]["sums"]


def difference(
    a: list[dict], b: list[dict], spreads: dict, measure="mae_rad", part=("splits", "test")
):
    """A measure of one row above that of another, value and interval."""
    one, other = (drawn(own, measure, part) for own in (a, b))
    moved = moved_by_seeds([(a, one[0]), (b, other[0])], spreads[measure])
    return interval(one - other, *moved)


def table(number: int | str, runs: dict[str, dict]) -> list[Row]:
    """Rows of a table whose runs are finished; Tables 3 and 4 over all seeds, the others seed 0.

    Parameters
    ----------
    number : int or str
        3 to 6, or "ours".
    runs : dict
        From `read_results`.

    Raises
    ------
    ValueError
        If there is no such table.
    """
    if number not in ROWS:
        raise ValueError(f"table {number!r} given; the tables are {', '.join(map(str, ROWS))}")
    several, rows = number in (3, 4), []
    reference = seeds_of("sfnet", runs, several)
    spreads = {measure: seed_spread(runs, measure) for measure in MEASURES}
    for label, name in ROWS[number].items():
        if not (own := seeds_of(name, runs, several)):
            continue
        above = difference(own, reference, spreads) if reference and name != "sfnet" else None
        found = measures_of(own, spreads)
        rows.append(Row(label, name, len(own), found, above, PAPER[number].get(label)))
    return rows


COLUMNS = {
    "mae_rad": ("MAE, rad", 1, 4, 13),
    "rmse_rad": ("RMSE, rad", 1, 3, 11),
    "mae_mm": ("MAE, mm", 1, 2, 10),
    "rmse_mm": ("RMSE, mm", 1, 1, 9),
    "order_errors": ("orders, %", 100, 2, 10),
    "spikes": ("spikes, %", 100, 2, 10),
}
"""Title of each measure that is printed, what it is multiplied with, decimals, characters."""


def as_text(rows: list[Row], control: dict[str, Interval] | None = None) -> str:
    """A table in columns: ours with half its interval, the paper's values below, row by row.

    Parameters
    ----------
    rows : list of Row
    control : dict, optional
        Measures of phi_h of SFNet alone, as ``run["splits"]["test"]["alone"]`` has them.
    """
    first = max(14, *(len(row.label) for row in rows))
    widths = [width for *_, width in COLUMNS.values()]
    titles = (title for title, *_ in COLUMNS.values())
    lines = [f"{'seeds':>{first + 3}} {_joined(titles, widths)}"]
    for row in rows:
        lines.append(f"{row.label:{first}}{row.seeds:3} {_joined(_cells(row.measures), widths)}")
        if row.paper:
            values = (f"{x:.4f}" for x in row.paper)
            lines.append(f"{'  in the paper':{first + 3}} {_joined(values, widths)}")
    if control:
        lines.append(f"{'phi_h alone':{first + 3}} {_joined(_cells(control), widths)}")
    return "\n".join(line.rstrip() for line in lines)


def _joined(cells, widths) -> str:
    return " ".join(f"{cell:{width}}" for cell, width in zip(cells, widths, strict=False))


def _cells(measures: dict[str, Interval]) -> list[str]:
    return [_plus_minus(measures[key], *how) for key, (_, *how, _) in COLUMNS.items()]


def _plus_minus(found: Interval, scale: float, decimals: int) -> str:
    if None in found:
        return "-"
    value, low, high = (scale * x for x in found)
    return f"{value:.{decimals}f}±{(high - low) / 2:.{decimals}f}"


def as_line(name: str, rows: list[Row]) -> str:
    """What the paper prints of a row, ours, in one line; or that its run is not made yet."""
    found = [row.measures for row in rows if row.name == name]
    return ", ".join(cell for m in found for cell in _cells(m)[:4]) or "not made yet"


def differences_as_text(rows: list[Row]) -> str:
    """By how much the MAE of each row lies above SFNet's, with its interval, row by row."""
    lines = ["MAE above that of SFNet, rad"]
    for row in rows:
        if row.difference:
            value, low, high = row.difference
            apart = "" if low * high > 0 else "   not told apart"
            lines.append(f"  {row.label:24} {value:+.4f} [{low:+.4f}, {high:+.4f}]{apart}")
    return "\n".join(lines)


def agreement(rows: list[Row]) -> tuple[float, float]:
    """Kendall's tau of the paper's MAE and ours over rows, and its p-value."""
    pairs = [(row.paper[0], row.measures["mae_rad"][0]) for row in rows if row.paper]
    found = kendalltau(*zip(*pairs, strict=True))
    return float(found.statistic), float(found.pvalue)
