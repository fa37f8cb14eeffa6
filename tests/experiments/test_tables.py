"""Intervals, differences and agreement, on runs that are made up."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from fpputil.experiments import statistics as intervals
from fpputil.experiments import tables
from fpputil.experiments.rows import ROWS, SEEDS, seeded_name


def invented(values, models=100, seed=0, spread=0.1, method="sfnet"):
    """Runs of a row, one a value: each with that MAE, a little other in every model."""
    rng = np.random.default_rng(seed)
    runs = []
    for value in values:
        e = value * (1 + spread * rng.standard_normal(models))
        sums = np.stack([np.full(models, 100.0), 100 * e, 100 * e**2], 1)
        kinds = {kind: sums.tolist() for kind, _ in intervals.MEASURES.values()}
        test = SimpleNamespace(models=list(range(models)), sums=kinds)
        runs.append(SimpleNamespace(kind=method, parts={"test": test}))
    return runs


def named(name, runs):
    return {seeded_name(name, k): run for k, run in enumerate(runs)}


def test_an_interval_of_one_run_is_that_of_its_models():
    (one,) = invented([1.0])
    (row,) = tables.table(3, {"sfnet": one})
    e = np.array(one.parts["test"].sums["rad"])[:, 1] / 100
    value, low, high = row.measures["mae_rad"]
    assert value == pytest.approx(e.mean())
    assert (high - low) / 2 == pytest.approx(1.96 * e.std() / math.sqrt(len(e)), rel=0.1)
    assert row.measures["rmse_mm"][0] == pytest.approx(math.sqrt((e**2).mean()))


def test_intervals_hold_the_truth_as_often_as_they_say():
    """Seeds that move the MAE by 10 %, models that move it by 1 %: three seeds, every row."""
    held = 0
    rng = np.random.default_rng(1)
    for trial in range(60):
        runs = {}
        for name in SEEDS:
            values = 1 + 0.1 * rng.standard_normal(3)
            runs |= named(name, invented(values, seed=trial, spread=0.1))
        own = intervals.seeds_of("sfnet", runs)
        values = intervals.bootstrap(own, "mae_rad", draws=200)
        spread = intervals.seed_variation(runs, "mae_rad")
        moved = intervals.seed_error([(own, values[0])], spread)
        value, low, high = intervals.interval(values, *moved)
        held += low < 1 < high and moved[1] == pytest.approx(2 * len(SEEDS))
    assert held >= 53  # of 60; 57 are expected, and 53 or more in 98 of 100 cases


def test_a_row_with_one_seed_borrows_the_spread_of_its_method():
    runs = named("sfnet-a", invented([0.9, 1.0, 1.1], spread=0))
    runs |= {"sfnet": invented([1.0], spread=0)[0]}
    runs |= {"sido": invented([1.0], spread=0, method="sido")[0]}
    rows = {row.name: row for n in (3, 4) for row in tables.table(n, runs)}
    widths = {k: np.ptp(row.measures["mae_rad"][1:]) / 2 for k, row in rows.items()}
    assert widths["sfnet"] == pytest.approx(4.303 * 0.1, rel=0.05)
    assert widths["sfnet-a"] == pytest.approx(4.303 * 0.1 / math.sqrt(3), rel=0.05)
    assert widths["sido"] == pytest.approx(0, abs=1e-9)  # nothing is known of its seeds
    above = np.ptp(rows["sfnet-a"].difference[1:]) / 2
    assert above == pytest.approx(4.303 * 0.1 * math.sqrt(4 / 3), rel=0.05)


def test_runs_of_one_preset_borrow_the_seeds_of_another():
    others = named("sfnet", invented([0.9, 1.0, 1.1], spread=0))
    (row,) = tables.table(3, {"sfnet": invented([2.0], spread=0)[0]}, others)
    value, low, high = row.measures["mae_rad"]
    assert value == pytest.approx(2)
    assert (high - low) / 2 == pytest.approx(4.303 * 0.1 * 2, rel=0.05)


def test_a_difference_of_methods_is_as_sure_as_welch_says():
    """Seeds that move one method by 10 %, the other by 2 %; each keeps its own spread."""
    wide, narrow = [0.9, 1.0, 1.1], [0.98, 1.0, 1.02]
    runs = named("sido", invented(wide, spread=0, method="sido"))
    runs |= named("sfnet", invented(narrow, spread=0))
    rows = {row.name: row for row in tables.table(3, runs)}
    found = stats.ttest_ind(wide, narrow, equal_var=False).confidence_interval(0.95)
    assert rows["sido"].difference[1:] == pytest.approx((found.low, found.high), rel=0.01)
    assert np.ptp(rows["sfnet"].measures["mae_rad"][1:]) < 0.12


def test_differences_are_drawn_in_pairs():
    """Two rows alike in every model but for a constant: the difference has no spread."""
    a, b = invented([1.0])[0], invented([1.0])[0]
    sums = b.parts["test"].sums
    sums["rad"] = (np.array(sums["rad"]) + [0, 5, 0]).tolist()
    (row,) = (r for r in tables.table(3, {"sfnet": a, "sido": b}) if r.name == "sido")
    assert row.difference == pytest.approx((0.05, 0.05, 0.05))
    b.parts["test"].models.reverse()
    with pytest.raises(ValueError, match="different models"):
        intervals.bootstrap([a, b], "mae_rad")


def test_tables_of_one_seed_take_seed_0_of_every_row():
    runs = named("sfnet", invented([1.0, 2.0, 3.0])) | {"sfnet-2-frames": invented([0.5])[0]}
    row, more = tables.table(5, runs)
    assert (row.seeds, more.seeds) == (1, 1)
    assert row.measures["mae_rad"][0] == pytest.approx(1, rel=0.02)
    assert more.difference[0] == pytest.approx(-0.5, rel=0.05)
    assert tables.table(4, runs)[0].seeds == 3


def test_agreement_is_kendalls():
    runs = dict(zip(ROWS[6].values(), invented(range(1, 10)), strict=True))
    rows = tables.table(6, runs)
    assert len(rows) == 9 and rows[4].name == "sfnet" and rows[4].difference is None
    paper = np.array([row.paper[0] for row in rows])
    ours = np.array([row.measures["mae_rad"][0] for row in rows])
    pairs = [(i, j) for i in range(9) for j in range(i)]
    signs = [np.sign((paper[i] - paper[j]) * (ours[i] - ours[j])) for i, j in pairs]
    tied = sum(paper[i] == paper[j] for i, j in pairs)
    tau = sum(signs) / math.sqrt(36 * (36 - tied))
    assert tables.agreement(rows)[0] == pytest.approx(tau)


def test_differences_that_are_not_sure_are_named():
    runs = dict(zip(("sfnet", "sido", "psnet"), invented([1.0, 1.0, 9.0]), strict=True))
    shown = tables.differences_table(tables.table(3, runs))
    assert [row[0] for row in shown.rows] == ["SIDO", "PSNet"]
    assert [row[2] for row in shown.rows] == ["not told apart", ""]
    for alone in ("sfnet", "sido"):
        assert not tables.differences_table(tables.table(3, {alone: runs[alone]})).rows


def test_a_row_in_one_line():
    (row,) = tables.table(3, {"sfnet": invented([1.0])[0]})
    cells = row.line.split(", ")
    assert len(cells) == len(row.paper) == 4
    assert cells[0].startswith(f"{row.measures['mae_rad'].value:.3f}±")
    for value, printed in ((0.12346, "0.1235±"), (12.346, "12.35±"), (23456.7, "23457±")):
        (row,) = tables.table(3, {"sfnet": invented([value], spread=0)[0]})
        assert row.line.startswith(printed)


def test_a_measure_that_is_not_known_is_a_dash():
    (row,) = tables.table(3, {"sfnet": invented([1.0])[0]})
    control = dict.fromkeys(row.measures, (None, None, None))
    assert tables.as_table([row], control).rows[-1][-1] == "-"
