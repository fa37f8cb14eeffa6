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

from fpputil import plotting
from fpputil.capture.diagnosis import FINDINGS, Finding
from fpputil.capture.measurement import Measurement
from fpputil.capture.quality import Reason
from fpputil.decoding.phase import THRESHOLD

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
    pictures = {}
    for one in measurements:
        figure, file = overview(one, depth if one is measurements[0] else None), io.BytesIO()
        figure.savefig(file, format="png", dpi=100)
        plt.close(figure)
        pictures[one.axis] = base64.b64encode(file.getvalue()).decode()
    templates = Environment(
        loader=PackageLoader("fpputil", "capture"), autoescape=True, trim_blocks=True
    )
    numbers = {one.axis: one.numbers() for one in measurements}
    template = templates.get_template("report.html")
    of_phases = any(f.severe and f.code in FINDINGS for f in findings)
    shown = {"findings": findings, "wrong": "phases" if of_phases else "points"}
    return template.render(title=title, numbers=numbers, pictures=pictures, **shown)


def overview(measurement: Measurement, depth=None) -> Figure:
    """Photograph, grey levels, modulation, phases, uncertainty and what is not in the mask.

    Without the depth, (H, W), mm, a row of projector columns is drawn in its place.
    """
    m, shape = measurement, measurement.average.shape
    fig, axes = plotting.panels(3, 3, 11.0, shape[0] / shape[1])
    few = (slice(None, None, max(1, max(shape) // PIXELS)),) * 2
    wrapped = np.where(m.mask, m.wrapped[m.finest], np.nan)
    high = float(np.nanpercentile(m.sigma, 98)) if m.mask.any() else 1.0
    plotting.frame(axes[0], m.average[few], "average of the finest fringe")
    lit = [frames[:, np.ptp(frames, axis=0) > 2 * THRESHOLD] for frames in m.sample]
    title = "grey levels where fringes are seen"
    _histogram(axes[1], m, lit, 256, xlabel="grey level", title=title, yticks=[])
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
    _histogram(axes[7], m, m.modulation, 128, **labels)
    if depth is None:
        line = int(np.argmax(m.mask.sum(axis=1)))
        axes[8].plot(m.coordinate[line])
        axes[8].set(xlabel="camera column", ylabel=f"projector {m.axis}", title=f"row {line}")
    else:
        plotting.depth(axes[8], depth[few])
    return fig


def _histogram(ax, m: Measurement, values, top: float, **labels) -> None:
    """How often each grey level occurs, per pitch."""
    for levels, fringe in zip(values, m.fringes, strict=True):
        how = {"bins": 64, "range": (0, top), "histtype": "step"}
        ax.hist(levels.ravel(), label=f"pitch {fringe.pitch:g}", **how)
    ax.set(xlim=(0, top), **labels)
    ax.legend(fontsize=7)
