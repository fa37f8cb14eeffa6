"""How sure a measure of a run is, and the difference of two (chapters 10 and 11).

Two things make a mean uncertain: the models that were measured, and the seed that the network was
trained from. Models are drawn anew, the same for all runs; how much a seed moves a measure is
pooled over the rows of a method that have several seeds, and counts for its other rows, too.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from fpputil.experiments.rows import SEEDS, seeded_name
from fpputil.learning.metrics import draws_of_models

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

IN_RANGE = ", range given"
"""After the name of a part: the same views, with the measuring range given to every method."""

Spread = dict[str, tuple[float, int]]
"""By method: standard deviation that a seed gives a measure, in parts of it; degrees of freedom."""


class Interval(NamedTuple):
    """A value and the ends of its 95 % interval.

    >>> f"{-Interval(-0.0267, -0.0338, -0.0195):.3f rad}"
    '0.027 rad [0.019, 0.034]'
    """

    value: float
    low: float
    high: float

    def __neg__(self) -> Interval:
        return Interval(-self.value, -self.high, -self.low)

    def __format__(self, spec: str) -> str:
        """``.3f rad``: value with its unit, then the ends, each by the format of a number."""
        number, _, unit = spec.partition(" ")
        value, low, high = (format(x, number) for x in self)
        return f"{value}{unit and ' '}{unit} [{low}, {high}]"


def seeds_of(name: str, runs: Mapping, several: bool = True) -> list:
    """The finished runs of a row, one a seed, or that of seed 0 alone."""
    seeds = SEEDS.get(name, (0,)) if several else (0,)
    names = [seeded_name(name, seed) for seed in seeds]
    return [runs[n] for n in names if n in runs]


def bootstrap(runs: Sequence, measure: str, part="test", draws=1000) -> np.ndarray:
    """A measure of a row, the mean over its seeds: of all models, then of each draw of models.

    All rows are drawn alike, so that they may be subtracted.

    Parameters
    ----------
    runs : sequence of Run
        Of the row, one a seed, measured on the same models.
    measure, part : str
        One of `MEASURES` and of `Run.parts`: "test", "held-out", or the name of a condition.

    Returns
    -------
    (draws + 1,) array
    """
    kind, root = MEASURES[measure]
    parts = [run.parts[part] for run in runs]
    if len({tuple(p.models) for p in parts}) != 1 or not all(kind in p.sums for p in parts):
        raise ValueError("runs measured on different models given; they cannot be compared")
    sums = np.array([p.sums[kind] for p in parts], float)  # (seeds, models, 3)
    pooled = np.einsum("dm,smk->dsk", draws_of_models(sums.shape[1], draws), sums)
    values = pooled[..., 2 if root else 1] / pooled[..., 0]
    return (np.sqrt(values) if root else values).mean(axis=1)


def seed_variation(runs: Mapping, measure: str) -> Spread:
    """How much a seed moves a measure of a method, in parts of it.

    Pooled over the rows of the method that have several seeds; methods without one are left out.
    """
    squares, freedoms = Counter(), Counter()
    for name in SEEDS:
        row = [run for run in seeds_of(name, runs) if _has(run, measure)]
        values = np.array([bootstrap([run], measure, draws=1)[0] for run in row])
        if len(values) > 1 and values.mean() > 0:
            squares[row[0].kind] += np.sum((values / values.mean() - 1) ** 2)
            freedoms[row[0].kind] += len(values) - 1
    return {k: (math.sqrt(squares[k] / freedom), freedom) for k, freedom in freedoms.items()}


def seed_error(rows: Sequence[tuple[Sequence, float]], spread: Spread) -> tuple[float, float]:
    """Standard deviation that seeds give to a row, or to the difference of two; degrees of freedom.

    Where two methods meet, these are those of Welch and Satterthwaite. Of each row there are the
    runs, one a seed, and the mean of the measure.
    """
    weights = Counter()
    for runs, value in rows:
        weights[runs[0].kind] += value**2 / len(runs)
    parts = [(spread[k][0] ** 2 * w, spread[k][1]) for k, w in weights.items() if k in spread]
    total = sum(square for square, _ in parts)
    if total == 0:
        return 0.0, 0.0
    return math.sqrt(total), total**2 / sum(square**2 / freedom for square, freedom in parts)


def interval(values: np.ndarray, by_seeds: float, freedom: float) -> Interval:
    """Value and 95 % interval, from `bootstrap` or a difference of two, and from `seed_error`.

    Without degrees of freedom models alone count.
    """
    moved = stdtrit(freedom, 0.975) * by_seeds if freedom else 0.0
    half = math.hypot(1.96 * values[1:].std(), moved)
    return Interval(float(values[0]), float(values[0] - half), float(values[0] + half))


def measures_of(
    runs: Sequence, spreads: Mapping[str, Spread], part: str = "test"
) -> dict[str, Interval]:
    """Each of `MEASURES` that a row has in a part; `seed_variation` of each is given.

    Nothing is told of a part that one of the runs lacks.
    """
    if not all(part in run.parts for run in runs):
        return {}
    draws = {m: bootstrap(runs, m, part) for m in MEASURES if _has(runs[0], m, part)}
    return {
        measure: interval(values, *seed_error([(runs, values[0])], spreads[measure]))
        for measure, values in draws.items()
    }


def _has(run, measure: str, part: str = "test") -> bool:
    return MEASURES[measure][0] in run.parts[part].sums


def difference(a: Sequence, b: Sequence, spread: Spread, measure="mae_rad") -> Interval:
    """A measure of the runs of one row above that of another; `seed_variation` of it is given."""
    one, other = (bootstrap(runs, measure) for runs in (a, b))
    return interval(one - other, *seed_error([(a, one[0]), (b, other[0])], spread))


def power_law(images: Sequence[float], errors: Sequence[float]) -> Callable:
    """Error as a power of the images seen, by least squares of the logarithms. Chapter 10.

    Returned is a function of a number of images, which tells an `Interval`: of the law's mean, as
    far as a law it is, which no interval knows.

    Parameters
    ----------
    images, errors : sequence of N float
        Of each training; three or more, of at least two numbers of images.

    Raises
    ------
    ValueError
        If there are too few, or a number is not above 0.

    Examples
    --------
    >>> law = power_law([1e3, 4e3, 16e3, 64e3], [0.4, 0.2, 0.1, 0.05])
    >>> f"{law(256e3):.3f}"
    '0.025 [0.025, 0.025]'
    """
    for name, values in (("images", images), ("errors", errors)):
        if not np.all(np.asarray(values, float) > 0):
            raise ValueError(f"{name} {list(values)} given; numbers above 0 are needed")
    if len(images) < 3 or len(set(images)) < 2:
        raise ValueError(
            f"trainings on {list(images)} images given; three or more are needed, of at least two "
            "numbers of images"
        )
    x, y = np.log(images), np.log(errors)
    A = np.stack([np.ones_like(x), x], axis=-1)
    factors = np.linalg.lstsq(A, y, rcond=None)[0]
    freedom = len(x) - 2
    covariance = np.linalg.inv(A.T @ A) * np.sum((y - A @ factors) ** 2) / freedom

    def law(number: float) -> Interval:
        at = np.array([1.0, np.log(number)])
        half = stdtrit(freedom, 0.975) * np.sqrt(at @ covariance @ at)
        return Interval(*(float(np.exp(at @ factors + side * half)) for side in (0, -1, 1)))

    return law
