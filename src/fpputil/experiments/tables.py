"""Tables 3 to 6: the paper's values beside ours, from the files of the runs (chapters 10, 11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fpputil.experiments import statistics
from fpputil.experiments.rows import ROWS
from fpputil.experiments.statistics import IN_RANGE, MEASURES, Interval, seeds_of
from fpputil.notebook import Table

PAPER = {
    "sfnet": (0.0527, 0.6543, 0.0790, 1.2359),
    "sido": (0.3610, 1.2945, 1.6966, 5.5933),
    "psnet": (0.0754, 0.6759, 0.1600, 1.8549),
    "dlalnet": (0.0908, 1.3113, 0.1438, 1.8469),
    "sfnet-a": (0.0744, 0.8241, 0.1589, 1.8864),
    "sfnet-b": (0.0546, 0.6722, 0.0865, 1.2899),
    "sfnet-2-frames": (0.0482, 0.5581, 0.0571, 1.1621),
    "sfnet-3-frames": (0.0441, 0.5446, 0.0477, 1.1042),
    "sfnet-1e-1-1e-5": (0.0541, 0.6707, 0.0797, 1.2594),
    "sfnet-1e-1-1e-6": (0.0524, 0.6546, 0.0799, 1.3225),
    "sfnet-1e-1-1e-7": (0.0552, 0.6841, 0.0811, 1.3368),
    "sfnet-1e-2-1e-5": (0.0562, 0.7082, 0.0832, 1.2875),
    "sfnet-1e-2-1e-7": (0.0508, 0.6557, 0.0801, 1.2567),
    "sfnet-1e-3-1e-5": (0.0562, 0.6976, 0.0808, 1.2580),
    "sfnet-1e-3-1e-6": (0.0547, 0.6723, 0.0829, 1.2834),
    "sfnet-1e-3-1e-7": (0.0598, 0.7004, 0.0851, 1.2927),
}
"""MAE and RMSE in rad, MAE and RMSE in mm, as printed in the paper, by name of the run."""

PRINTED = ("mae_rad", "rmse_rad", "mae_mm", "rmse_mm")

COLUMNS = {
    "mae_rad": ("MAE, rad", 1, 4),
    "rmse_rad": ("RMSE, rad", 1, 3),
    "mae_mm": ("MAE, mm", 1, 2),
    "rmse_mm": ("RMSE, mm", 1, 1),
    "order_errors": ("orders, %", 100, 2),
    "spikes": ("spikes, %", 100, 2),
}
RANGE_COLUMNS = {
    "mae_rad": ("MAE in range, rad", 1, 4),
    "order_errors": ("orders in range, %", 100, 2),
    "mae_mm": ("MAE in range, mm", 1, 2),
    "rmse_mm": ("RMSE in range, mm", 1, 1),
}
"""Title of each measure that is printed, what it is multiplied with, decimals: of phases as the
paper of a method decodes them, and of a method that is told the measuring range. Beside the
latter's millimetres the former's, of points that may lie kilometres away, say nothing."""


@dataclass(frozen=True)
class Row:
    """A row of a table."""

    label: str
    name: str  # of its run
    seeds: int  # how many runs it is the mean of
    measures: dict[str, Interval]  # each of `MEASURES` that it has
    in_range: dict[str, Interval]  # those with the measuring range given, {} if not measured
    difference: Interval | None  # MAE in radians above that of the row of SFNet
    paper: tuple[float, ...] | None  # what the paper prints

    @property
    def line(self) -> str:
        """Our values of what the paper prints, in one line."""
        return ", ".join(_cells(self.measures)[:4])


def table(number: int | str, runs: Mapping, seeded: Mapping | None = None) -> list[Row]:
    """Rows of a table, 3 to 6 or "ours", whose runs are finished.

    Tables 3 and 4 are means over all seeds, the others of seed 0. How far a seed moves a measure
    is told from the runs of `seeded`, by default from `runs`.
    """
    if number not in ROWS:
        raise ValueError(f"table {number!r} given; the tables are {', '.join(map(str, ROWS))}")
    several, rows = number in (3, 4), []
    reference = seeds_of("sfnet", runs, several)
    spreads = {m: statistics.seed_variation(seeded or runs, m) for m in MEASURES}
    for label, name in ROWS[number].items():
        if row := seeds_of(name, runs, several):
            pair = reference and name != "sfnet"
            apart = statistics.difference(row, reference, spreads["mae_rad"]) if pair else None
            measures = statistics.measures_of(row, spreads)
            told = statistics.measures_of(row, spreads, "test" + IN_RANGE)
            rows.append(Row(label, name, len(row), measures, told, apart, PAPER.get(name)))
    return rows


def as_table(rows: Sequence[Row], control: Mapping | None = None) -> Table:
    """Ours with half its interval, the paper's values below, row by row.

    Where all rows were measured with the range given, too, those measures follow, millimetres
    among them. At the end the control: measures of phi_h of SFNet alone, as
    ``run.alone.measures`` has them.
    """
    told = all(row.in_range for row in rows)
    own = {k: how for k, how in COLUMNS.items() if not (told and k.endswith("mm"))}
    columns = [*own.items(), *(RANGE_COLUMNS.items() if told else ())]
    lines = []
    for row in rows:
        cells = _cells(row.measures, own) + _cells(row.in_range, RANGE_COLUMNS if told else {})
        lines.append([row.label, str(row.seeds), *cells])
        if row.paper:
            printed = dict(zip(PRINTED, (f"{x:.4f}" for x in row.paper), strict=True))
            cells = [printed.pop(key, "") for key, _ in columns]
            lines.append([f"{row.label} in the paper", "", *cells])
    if control:
        blank = [""] * (len(columns) - len(own))
        lines.append(["phi_h alone", "", *_cells(control, own), *blank])
    return Table(["", "seeds", *(title for _, (title, *_) in columns)], lines)


def _cells(measures: Mapping, columns: Mapping = COLUMNS) -> list[str]:
    return [_plus_minus(measures[key], *how) for key, (_, *how) in columns.items()]


def _plus_minus(measure: Sequence, scale: float, decimals: int) -> str:
    if None in measure:
        return "-"
    value, low, high = (scale * x for x in measure)
    if value >= 1:  # four digits are enough
        decimals = max(0, min(decimals, 4 - len(f"{value:.0f}")))
    return f"{value:.{decimals}f}±{(high - low) / 2:.{decimals}f}"


def differences_table(rows: Sequence[Row]) -> Table:
    """By how much the MAE of each row lies above SFNet's, with its interval, row by row."""
    above = {row.label: row.difference for row in rows if row.difference}
    lines = [
        [label, f"{apart:+.4f}", "" if apart.low * apart.high > 0 else "not told apart"]
        for label, apart in above.items()
    ]
    return Table(["", "MAE above that of SFNet, rad", ""], lines)


def agreement(rows: Sequence[Row]) -> tuple[float, float]:
    """Kendall's tau of the paper's MAE and ours over rows, and its p-value."""
    from scipy.stats import kendalltau  # a third of a second

    pairs = [(row.paper[0], row.measures["mae_rad"][0]) for row in rows if row.paper]
    tau = kendalltau(*zip(*pairs, strict=True))
    return float(tau.statistic), float(tau.pvalue)
