"""Tables 3 to 6: the paper's values beside ours, from the files of `results` (chapters 10, 11)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest

from scipy.stats import kendalltau

from fpputil.experiments.paper import PAPER
from fpputil.experiments.registry import ROWS
from fpputil.experiments.statistics import (
    MEASURES,
    Interval,
    difference,
    measures_of,
    seed_variation,
    seeds_of,
)


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


def table(number: int | str, runs: dict[str, dict], seeded: dict | None = None) -> list[Row]:
    """Rows of a table whose runs are finished; Tables 3 and 4 over all seeds, the others seed 0.

    Parameters
    ----------
    number : int or str
        3 to 6, or "ours".
    runs : dict
        From `read_results`.
    seeded : dict, optional
        Runs of another preset, from whose seeds to tell how far a seed moves a measure; by
        default from those of `runs`.

    Raises
    ------
    ValueError
        If there is no such table.
    """
    if number not in ROWS:
        raise ValueError(f"table {number!r} given; the tables are {', '.join(map(str, ROWS))}")
    several, rows = number in (3, 4), []
    reference = seeds_of("sfnet", runs, several)
    spreads = {measure: seed_variation(seeded or runs, measure) for measure in MEASURES}
    for label, name in ROWS[number].items():
        if not (own := seeds_of(name, runs, several)):
            continue
        above = difference(own, reference, spreads) if reference and name != "sfnet" else None
        found = measures_of(own, spreads)
        rows.append(Row(label, name, len(own), found, above, PAPER[number].get(label)))
    return rows


COLUMNS = {
    "mae_rad": ("MAE, rad", 1, 4),
    "rmse_rad": ("RMSE, rad", 1, 3),
    "mae_mm": ("MAE, mm", 1, 2),
    "rmse_mm": ("RMSE, mm", 1, 1),
    "order_errors": ("orders, %", 100, 2),
    "spikes": ("spikes, %", 100, 2),
}
"""Title of each measure that is printed, what it is multiplied with, decimals."""


def as_text(rows: list[Row], control: dict[str, Interval] | None = None) -> str:
    """A table in columns: ours with half its interval, the paper's values below, row by row.

    Parameters
    ----------
    rows : list of Row
    control : dict, optional
        Measures of phi_h of SFNet alone, as ``run["splits"]["test"]["alone"]`` has them.
    """
    first = max(14, *(len(row.label) for row in rows))
    lines = [[f"{'seeds':>{first + 3}}", *(title for title, *_ in COLUMNS.values())]]
    for row in rows:
        lines.append([f"{row.label:{first}}{row.seeds:3}", *_cells(row.measures)])
        if row.paper:
            lines.append(["  in the paper", *(f"{x:.4f}" for x in row.paper)])
    if control:
        lines.append(["phi_h alone", *_cells(control)])
    widths = [max(map(len, column)) for column in zip_longest(*lines, fillvalue="")]
    padded = (map(str.ljust, line, widths) for line in lines)
    return "\n".join(" ".join(line).rstrip() for line in padded)


def _cells(measures: dict[str, Interval]) -> list[str]:
    return [_plus_minus(measures[key], *how) for key, (_, *how) in COLUMNS.items()]


def _plus_minus(found: Interval, scale: float, decimals: int) -> str:
    if None in found:
        return "-"
    value, low, high = (scale * x for x in found)
    if value >= 1:  # four digits are enough
        decimals = max(0, min(decimals, 4 - len(f"{value:.0f}")))
    return f"{value:.{decimals}f}±{(high - low) / 2:.{decimals}f}"


def as_line(name: str, rows: list[Row]) -> str:
    """What the paper prints of a row, ours, in one line; or that its run is not made yet."""
    found = [row.measures for row in rows if row.name == name]
    return ", ".join(cell for m in found for cell in _cells(m)[:4]) or "not made yet"


def differences_as_text(rows: list[Row]) -> str:
    """By how much the MAE of each row lies above SFNet's, with its interval, row by row."""
    if not any(row.difference for row in rows):
        return "no MAE above or below SFNet's: SFNet is not made yet, or nothing beside it"
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
