"""One page on a decoded capture, by which a person can judge it at a glance (chapter 12)."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from fpputil import plotting
from fpputil.capture.diagnosis import Finding
from fpputil.capture.marking import Reason
from fpputil.capture.measurement import Measurement
from fpputil.decoding.phase import THRESHOLD

PIXELS = 480  # of the longer side of a picture on the page
REASONS = {
    Reason.GOOD: ("good", "#dfe6e9"),
    Reason.DARK: ("dark", "#2d3436"),
    Reason.SATURATED: ("saturated", "#e17055"),
    Reason.SCATTERED: ("no sinusoid", "#6c5ce7"),
    Reason.UNSTEADY: ("unsteady", "#fdcb6e"),
    Reason.UNSURE: ("order unsure", "#d63031"),
    Reason.OUTSIDE: ("outside", "#00b894"),
}
SUSPECTS = ListedColormap([colour for _, colour in REASONS.values()])
STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem}
table{border-collapse:collapse;margin:1rem 0}td,th{text-align:left;padding:.2rem 1.2rem .2rem 0}
img{max-width:100%}.severe{color:#b30000}.fine{color:#1e7d32}"""


def page(title: str, scans: Sequence[Measurement], found: Sequence[Finding], depth=None) -> str:
    """The report as one HTML page without any other file. Chapter 12.

    Parameters
    ----------
    title : str
    scans : sequence of Scan
    found : sequence of Doubt
        Of all scans.
    depth : (H, W) array, optional
        mm.
    """
    pictures = []
    for scan in scans:
        figure = overview(scan, depth if scan.axis == "column" else None)
        pictures.append(_embedded(figure, f"Overview of the fringes along {scan.axis}s"))
        plt.close(figure)
    title = html.escape(title)
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head><body><h1>{title}</h1>{_verdict(found)}"
        f"{_doubts(found)}{_numbers(scans)}{''.join(pictures)}</body></html>\n"
    )


def overview(scan: Measurement, depth=None) -> Figure:
    """Photograph, grey levels, modulation, phases, uncertainty and what is not in the mask.

    Parameters
    ----------
    scan : Scan
    depth : (H, W) array, optional
        mm.
    """
    shape = scan.average.shape
    fig, axes = plotting.panels(3, 3, 11.0, shape[0] / shape[1])
    few = max(1, max(shape) // PIXELS)
    best, pitch = scan.finest, scan.fringes[scan.finest].pitch
    wrapped = np.where(scan.mask, scan.wrapped[best], np.nan)
    plotting.frame(axes[0], scan.average[::few, ::few], "average of the finest fringe")
    _levels(axes[1], scan)
    plotting.quantity(axes[2], scan.modulation[best][::few, ::few], "modulation", "grey levels")
    plotting.wrapped(axes[3], wrapped[::few, ::few], f"wrapped phase, pitch {pitch:g}")
    plotting.absolute(axes[4], scan.Phi[::few, ::few])
    high = float(np.nanpercentile(scan.sigma, 98)) if scan.mask.any() else 1.0
    plotting.quantity(axes[5], scan.sigma[::few, ::few], "uncertainty", "rad", 0, high)
    _suspects(axes[6], scan.reason[::few, ::few])
    _modulations(axes[7], scan)
    if depth is None:
        _profile(axes[8], scan)
    else:
        plotting.depth(axes[8], depth[::few, ::few])
    return fig


def _levels(ax, scan: Measurement) -> None:
    """How often each grey level occurs, per pitch."""
    for frames, fringe in zip(scan.sample, scan.fringes, strict=True):
        lit = np.ptp(frames, axis=0) > 2 * THRESHOLD
        ax.hist(
            frames[:, lit].ravel(),
            64,
            range=(0, 256),
            histtype="step",
            label=f"pitch {fringe.pitch:g}",
        )
    ax.set(
        xlabel="grey level", title="grey levels where fringes are seen", yticks=[], xlim=(0, 256)
    )
    ax.legend(fontsize=7)


def _modulations(ax, scan: Measurement) -> None:
    for B, fringe in zip(scan.modulation, scan.fringes, strict=True):
        ax.hist(B.ravel(), 64, range=(0, 128), histtype="step", label=f"pitch {fringe.pitch:g}")
    ax.set(xlabel="modulation, grey levels", title="modulation", yscale="log", xlim=(0, 128))
    ax.legend(fontsize=7)


def _suspects(ax, reason) -> None:
    shown = ax.imshow(reason, cmap=SUSPECTS, norm=BoundaryNorm(np.arange(8) - 0.5, 7))
    bar = ax.figure.colorbar(shown, ax=ax, ticks=range(7), fraction=0.046, pad=0.03)
    bar.ax.set_yticklabels([name for name, _ in REASONS.values()], fontsize=7)
    ax.set(xticks=[], yticks=[], title="why a pixel is left out")
    ax.grid(False)


def _profile(ax, scan: Measurement) -> None:
    line = int(np.argmax(scan.mask.sum(axis=1)))
    ax.plot(scan.coordinate[line])
    ax.set(xlabel="camera column", ylabel=f"projector {scan.axis}", title=f"row {line}")


def _embedded(figure: Figure, alt: str) -> str:
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=100)
    data = base64.b64encode(file.getvalue()).decode()
    return f'<img alt="{alt}" src="data:image/png;base64,{data}">'


def _verdict(found) -> str:
    if any(d.severe for d in found):
        return '<p class="severe"><b>The phases are wrong.</b> Do not use them.</p>'
    if found:
        return "<p><b>Usable, and could be better:</b></p>"
    return '<p class="fine"><b>Nothing speaks against this capture.</b></p>'


def _doubts(found) -> str:
    rows = [
        f"<li{' class=severe' if d.severe else ''}>{html.escape(d.found)}. "
        f"<i>{html.escape(d.remedy)}.</i></li>"
        for d in found
    ]
    return f"<ul>{''.join(rows)}</ul>" if rows else ""


def _numbers(scans) -> str:
    names = list(report_numbers(scans[0]))
    columns = [report_numbers(scan) for scan in scans]
    head = "".join(f"<th>{scan.axis}s</th>" for scan in scans)
    rows = "".join(
        f"<tr><td>{name}</td>{''.join(f'<td>{c[name]}</td>' for c in columns)}</tr>"
        for name in names
    )
    return f"<table><tr><th></th>{head}</tr>{rows}</table>"


def report_numbers(scan: Measurement) -> dict[str, str]:
    """What the page says in numbers, as text by name."""
    mask, reason = scan.mask, scan.reason
    lit = max(int((reason != Reason.DARK).sum()), 1)
    out = {REASONS[r][0]: f"{(reason == r).sum() / lit:.2%}" for r in Reason if r > Reason.DARK}
    typical = (lambda a: float(np.median(a[mask]))) if mask.any() else (lambda a: float("nan"))
    noise = typical(np.sqrt(scan.noise.variance(scan.average)))
    return {
        "pixels in the mask": f"{mask.mean():.1%}, {mask.sum() / lit:.1%} of the lit ones",
        "pitches, steps": ", ".join(f"{f.pitch:g} x {f.steps}" for f in scan.fringes),
        "modulation of the finest pitch, median": f"{typical(scan.modulation[scan.finest]):.1f}",
        "noise, grey levels": f"{noise:.2f}" + ("" if scan.noise.known else " (assumed)"),
        "power": f"{scan.power:.3f}",
        "uncertainty of the phase, median": f"{typical(scan.sigma):.4f} rad",
        **{f"of the lit pixels {name}": share for name, share in out.items()},
    }
