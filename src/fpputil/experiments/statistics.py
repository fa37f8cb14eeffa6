"""How sure a measure of a run is, and the difference of two (chapters 10 and 11).

Two things make a mean uncertain: which models were measured, and which seed the network was
trained from. Models are drawn anew (all runs are measured on the same, so that a difference is
drawn pair by pair); how much a seed moves a measure is pooled over the rows of a method that have
several seeds, in parts of the measure, and counts for its rows with one seed, too.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import t as student

from fpputil.checks import seeded, whole
from fpputil.experiments.registry import SEEDS, seeded_name

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


def bootstrap(
    own: list[dict], measure: str, part=("splits", "test"), seed=0, draws=1000
) -> np.ndarray:
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


def seed_variation(runs: dict[str, dict], measure: str) -> Spread:
    """How much a seed moves a measure of a method, in parts of it.

    Pooled over the rows of the method that have several seeds; methods without one are left out.
    """
    squares, freedoms = {}, {}
    for name in SEEDS:
        own = [run for run in seeds_of(name, runs) if _has(run, measure)]
        values = [bootstrap([run], measure, draws=1)[0] for run in own]
        if len(values) > 1 and np.mean(values) > 0:
            method = _method(own)
            square = np.sum((np.array(values) / np.mean(values) - 1) ** 2)
            squares[method] = squares.get(method, 0.0) + square
            freedoms[method] = freedoms.get(method, 0) + len(values) - 1
    return {m: (math.sqrt(squares[m] / freedom), freedom) for m, freedom in freedoms.items()}


def _method(own: list[dict]) -> str:
    return own[0]["method"]["method"]


def seed_error(rows: list[tuple[list[dict], float]], spread: Spread) -> tuple[float, float]:
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


def measures_of(own: list[dict], spreads: dict, part=("splits", "test")) -> dict:
    """Each of `MEASURES` that a row has, value and interval; `seed_spread` of each is given."""
    found = {}
    for measure in MEASURES:
        if _has(own[0], measure):
            values = bootstrap(own, measure, part)
            moved = seed_error([(own, values[0])], spreads[measure])
            found[measure] = interval(values, *moved)
    return found


def _has(run: dict, measure: str) -> bool:
    return MEASURES[measure][0] in run["splits"]["test"]["sums"]


def difference(
    a: list[dict], b: list[dict], spreads: dict, measure="mae_rad", part=("splits", "test")
):
    """A measure of one row above that of another, value and interval."""
    one, other = (bootstrap(own, measure, part) for own in (a, b))
    moved = seed_error([(a, one[0]), (b, other[0])], spreads[measure])
    return interval(one - other, *moved)
