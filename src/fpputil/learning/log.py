"""The course of a training run: a table as CSV, curves as PNG (chapter 8)."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING

from fpputil.files import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def write_log(out: Path, history: list[dict]) -> None:
    """Write log.csv and curve.png, one row an epoch with equal keys, each whole or not at all."""
    from matplotlib.figure import Figure  # half a second that reading results need not wait

    import fpputil.plotting  # noqa: F401  # the style of the book

    text = io.StringIO()
    table = csv.DictWriter(text, history[0].keys(), lineterminator="\n")
    table.writeheader()
    table.writerows(history)
    write_whole(out / "log.csv", text.getvalue().encode())
    figure = Figure(figsize=(8, 3), layout="constrained")
    plot_log(figure.subplots(1, 3), history)
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    write_whole(out / "curve.png", picture.getvalue())


def read_log(path: str | Path) -> list[dict[str, float]]:
    """Rows of a log.csv, numbers as floats; ValueError if the file is no such table."""
    try:
        with Path(path).open(newline="", encoding="utf-8") as file:
            rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    except (TypeError, ValueError, AttributeError) as error:
        raise ValueError(f"{path} is no log of a training run ({error})") from error
    if not rows or "images" not in rows[0]:
        raise ValueError(f"{path} is no log of a training run; it has no row with images")
    return rows


def plot_log(axes: list[Axes], history: list[dict]) -> None:
    """Loss, validation MAE and wrong orders against images seen, on three axes."""
    from fpputil.plotting import COLOURS

    images = [row["images"] for row in history]
    curves = (
        ("total", "training loss", 1, 0),
        ("validation_mae", "validation MAE, rad", 1, 1),
        ("validation_order_errors", "wrong orders, %", 100, 2),
    )
    for ax, (key, title, scale, colour) in zip(axes, curves, strict=True):
        values = [scale * row[key] for row in history]
        ax.plot(images, values, ".-", color=COLOURS[colour])
        ax.set(title=title, xlabel="images seen", yscale="log" if min(values) > 0 else "linear")
