"""One page on a decoded capture, by which a person can judge it at a glance (chapter 12)."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from jinja2 import Environment, PackageLoader
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from fpputil import interactive, plotting
from fpputil.capture.faults.findings import FINDINGS, Finding
from fpputil.capture.faults.gamma import TURN, power_profile
from fpputil.capture.measurement import Measurement
from fpputil.capture.quality import Reason
from fpputil.decoding.phase import THRESHOLD
from fpputil.interactive.live import Live
from fpputil.optics.fringes import WHITE

DRAWN = 64  # points of a curve through a response
PIXELS = 480  # of the longer side of a picture on the page
SUSPECTS = ListedColormap(
    ["#dfe6e9", "#2d3436", "#e17055", "#6c5ce7", "#fdcb6e", "#d63031", "#00b894"]
)
"""Of each `Reason` the colour."""


def page(
    title: str, measurements: Sequence[Measurement], findings: Sequence[Finding], depth=None
) -> str:
    """The report as one HTML page without any other file. Chapter 12.

    It takes the `Measurement` of each axis, the findings of all of them, and the depth, (H, W), mm.
    """
    pictures, figures = {}, {}
    for one in measurements:
        own = depth if one is measurements[0] else None
        figure, file = overview(one, own), io.BytesIO()
        figure.savefig(file, format="png", dpi=100)
        plt.close(figure)
        pictures[one.axis] = base64.b64encode(file.getvalue()).decode()
        figures[one.axis] = linked(one, own, f"overview-{one.axis}")._repr_mimebundle_()[
            "text/html"
        ]
    templates = Environment(
        loader=PackageLoader("fpputil", "capture"), autoescape=True, trim_blocks=True
    )
    numbers = {one.axis: one.numbers() for one in measurements}
    template = templates.get_template("report.html")
    of_phases = any(f.severe and f.code in FINDINGS for f in findings)
    told = {"findings": findings, "wrong": "phases" if of_phases else "points"}
    return template.render(title=title, numbers=numbers, pictures=pictures, figures=figures, **told)


def linked(measurement: Measurement, depth=None, instead_of: str = "") -> Live:
    """The panels of `overview` to be read pixel by pixel: one that is pointed at is marked in all.

    Its samples are drawn with their fit, and its uncertainty and the reason why it is left out
    read out.
    """
    m = measurement
    height = m.shown[0].shape[1] if m.shown else PIXELS // 2  # a Gray code alone
    every = max(1, -(-m.average.shape[0] // height))
    few, lit = (slice(None, None, every),) * 2, m.lit
    bright, contrast = _tops(m)
    maps = [
        {"name": "average", "values": m.average, "cmap": "gray", "low": 0, "high": bright},
        {"name": "modulation", "values": m.modulation[m.finest], "low": 0, "high": contrast},
        {"name": "wrapped phase", "values": m.wrapped[m.finest], "unit": "rad", "cmap": "twilight"},
        {"name": "absolute phase", "values": m.Phi, "unit": "rad"},
        {"name": "uncertainty", "values": m.sigma, "unit": "rad", "cmap": "magma", "low": 0},
        {"name": "why left out", "values": m.reason, "cmap": SUSPECTS, "low": 0, "high": 6}
        | {"names": [reason.said for reason in Reason]},
    ]
    maps[2]["values"] = np.where(lit, maps[2]["values"], np.nan)
    if m.mask.any():
        maps[4]["high"] = float(np.percentile(m.sigma[m.mask], 98))
    row = {"name": f"projector {m.axis}", "values": m.coordinate, "unit": "px"}
    if depth is not None:
        row = {"name": "depth", "values": depth, "unit": "mm", "cmap": "cividis_r"}
    maps = [one | {"values": one["values"][few]} for one in (*maps[:5], row, maps[5])]
    maps = [one for one in maps if np.isfinite(one["values"]).any()]
    names = [f"pitch {fringe.pitch:g}" for fringe in m.fringes]
    seen = [frames[:, np.ptp(frames, axis=0) > 2 * THRESHOLD] for frames in m.sample]
    seen = seen or [m.average[m.lit]]
    levels = {"title": "grey levels where fringes are seen", "xlabel": "grey level"}
    levels |= {"counts": _counts(names, seen, bright), "top": bright}
    strengths = {"title": "modulation", "xlabel": "modulation, grey levels", "of": "modulation"}
    strengths |= {"counts": _counts(names, m.modulation, contrast), "top": contrast}
    along = [{"row": row["name"]}] if any(one["name"] == row["name"] for one in maps) else []
    charts = [levels, strengths, *along]
    samples = dict(zip(names, m.shown, strict=True)) if m.shown else None
    profile = None if m.gamma == 1 else power_profile(m.gamma)[0][:: TURN // DRAWN]
    how = {"samples": samples, "charts": charts, "profile": profile}
    return interactive.maps(maps, instead_of=instead_of, **how)


def _counts(names, values, top: float) -> dict:
    """How often each of 64 levels occurs, by pitch."""
    pairs = zip(names, values, strict=True)
    return {name: np.histogram(levels, 64, (0, top))[0] for name, levels in pairs}


def _tops(m: Measurement) -> tuple[float, float]:
    """Grey level and modulation up to which there is anything: full scale, a half, a quarter ..."""
    brightest = max((float(frames.max()) for frames in m.sample), default=WHITE)
    strongest = float(np.percentile(m.modulation[:, m.lit], 99)) if m.lit.any() else 0.0
    tops = []
    for top, most in ((256.0, brightest), (128.0, strongest)):
        while top > 16 and most < 0.45 * top:
            top /= 2
        tops.append(top)
    return tops[0], tops[1]


def overview(measurement: Measurement, depth=None) -> Figure:
    """Photograph, grey levels, modulation, phases, uncertainty and what is not in the mask.

    Without the depth, (H, W), mm, a row of projector columns is drawn in its place.
    """
    m, shape = measurement, measurement.average.shape
    fig, axes = plotting.panels(3, 3, 11.0, shape[0] / shape[1])
    few = (slice(None, None, max(1, max(shape) // PIXELS)),) * 2
    wrapped = np.where(m.mask, m.wrapped[m.finest], np.nan)
    high = float(np.nanpercentile(m.sigma, 98)) if m.mask.any() else 1.0
    bright, contrast = _tops(m)
    plotting.frame(axes[0], m.average[few], "average of the finest fringe", min(bright, WHITE))
    lit = [frames[:, np.ptp(frames, axis=0) > 2 * THRESHOLD] for frames in m.sample]
    lit = lit or [m.average[m.lit]]  # of a Gray code alone
    title = "grey levels where fringes are seen"
    _histogram(axes[1], m, lit, bright, xlabel="grey level", title=title, yticks=[])
    plotting.quantity(axes[2], m.modulation[m.finest][few], "modulation", "grey levels")
    plotting.wrapped(axes[3], wrapped[few], f"wrapped phase, pitch {m.pitch:g}")
    plotting.absolute(axes[4], m.Phi[few])
    plotting.quantity(axes[5], m.sigma[few], "uncertainty", "rad", 0, high)
    image = axes[6].imshow(m.reason[few], cmap=SUSPECTS, norm=BoundaryNorm(np.arange(8) - 0.5, 7))
    bar = fig.colorbar(image, ax=axes[6], ticks=range(7), fraction=0.046, pad=0.03)
    bar.ax.set_yticklabels([reason.said for reason in Reason], fontsize=7)
    axes[6].set(xticks=[], yticks=[], title="why a pixel is left out")
    axes[6].grid(False)
    labels = {"xlabel": "modulation, grey levels", "title": "modulation", "yscale": "log"}
    _histogram(axes[7], m, m.modulation, contrast, **labels)
    if depth is None:
        line = _middle_row(m.mask)
        axes[8].plot(m.coordinate[line])
        axes[8].set(xlabel="camera column", ylabel=f"projector {m.axis}", title=f"row {line}")
    else:
        plotting.depth(axes[8], depth[few])
    return fig


def _middle_row(mask: np.ndarray) -> int:
    """The row through the middle of what is in a mask, (H, W)."""
    rows = np.repeat(np.arange(len(mask)), mask.sum(axis=1))
    return int(np.median(rows)) if rows.size else len(mask) // 2


def _histogram(ax, m: Measurement, values, top: float, **labels) -> None:
    """How often each grey level occurs, per pitch."""
    for levels, fringe in zip(values, m.fringes, strict=True):
        how = {"bins": 64, "range": (0, top), "histtype": "step"}
        ax.hist(levels.ravel(), label=f"pitch {fringe.pitch:g}", **how)
    ax.set(xlim=(0, top), **labels)
    ax.legend(fontsize=7)
