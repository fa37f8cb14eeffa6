"""Figures to play with: in JupyterLab, and on a page that is opened from the disk.

A cell ends in what one of these functions returns. On a page the figure takes the place of a still
picture, which print, GitHub and readers without JavaScript see. All it needs is in its own output,
and nothing in it differs from run to run.
"""

from __future__ import annotations

import base64
import json
import re
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fpputil.decoding.phase import modulation, numerator_denominator
from fpputil.notebook import Table

RUNTIME = Path(__file__).with_name("runtime.js")


class Live:
    """A figure to play with, as a notebook shows it.

    Parameters
    ----------
    spec : dict
        What ``runtime.js`` draws.
    instead_of : str
        Name of the still picture whose place it takes on a page.
    table : Table, optional
        What stands there without JavaScript.
    """

    def __init__(self, spec: dict, instead_of: str = "", table: Table | None = None):
        self.spec, self.instead_of, self.table = spec, instead_of, table

    def _repr_mimebundle_(self, include=None, exclude=None):
        text = json.dumps(self.spec, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
        text = text.replace("</", "<\\/")
        data = f'<script type="application/json">{text}</script>'
        still = self.table._repr_html_() if self.table else ""
        html = (
            f'<div class="fpp-live" data-instead-of="{self.instead_of}">{still}{data}</div>\n'
            f"<script data-fpp-runtime>{RUNTIME.read_text(encoding='utf-8')}</script>"
        )
        return {"text/html": html, "text/plain": str(self.table or "")}


def slider(
    name: str,
    label: str,
    low: float,
    high: float,
    value: float,
    step: float = 1,
    unit: str = "",
    names: Sequence[str] = (),
    play: int = 0,
) -> dict:
    """A control of `explore`.

    `names` stand for the values 0, 1, 2 ...; with `play`, milliseconds a step, it has a button that
    moves it on its own.
    """
    spec = {"name": name, "label": label, "min": low, "max": high, "step": step, "value": value}
    more = {"unit": unit, "names": list(names), "play": play}
    return spec | {k: v for k, v in more.items() if v}


def explore(
    controls: Sequence[dict],
    formula: str,
    data: Mapping | None = None,
    checks: Sequence[tuple[dict, dict]] = (),
    instead_of: str = "",
) -> Live:
    """A formula under controls.

    Parameters
    ----------
    controls : sequence of dict
        Of `slider`; or {name, label, value} with a bool, or with `choices`, a list of str.
    formula : str
        Body of a JavaScript function of (values, data, tools) that returns {plots, numbers}, as
        ``runtime.js`` says.
    data : mapping, optional
        What the formula takes besides; arrays arrive with ``.shape`` and ``.real(k)``.
    checks : sequence of (settings, numbers)
        What Python finds for some settings; the tests of the pages have the formula say the same.
    instead_of : str
        As of `Live`.

    Examples
    --------
    >>> formula = "return {plots: [], numbers: {twice: [2 * values.x]}}"
    >>> figure = explore([slider("x", "x", 0, 9, 3)], formula, checks=[({"x": 4}, {"twice": 8})])
    >>> figure.spec["controls"][0]["value"]
    3
    """
    return Live({"kind": "explore"} | _computed(controls, formula, data, checks), instead_of)


def _computed(controls, formula, data, checks) -> dict:
    packed = {k: pack(v) if isinstance(v, np.ndarray) else v for k, v in (data or {}).items()}
    spec = {"controls": list(controls), "formula": formula, "data": packed}
    spec["checks"] = [[v, {k: _short(x) for k, x in n.items()}] for v, n in checks]
    return spec


def sortable(table: Table, instead_of: str = "") -> Live:
    """A table that is sorted by a click on a head, and compared with one of its rows.

    Examples
    --------
    >>> sortable(Table(["method", "MAE"], [["a", 2.0], ["b", 1.0]])).spec["checks"]
    [[{'column': 1}, {'first': 1}], [{'column': 1, 'down': True}, {'first': 0}]]
    """
    checks = []
    for column in range(1, len(table.columns)):
        numbers = [re.match(r"[-+]?[\d.]+", str(row[column])) for row in table.rows]
        cells = [float(found[0]) if found else np.nan for found in numbers]
        if np.isfinite(cells).any():
            checks.append([{"column": column}, {"first": int(np.nanargmin(cells))}])
            checks.append([{"column": column, "down": True}, {"first": int(np.nanargmax(cells))}])
    return Live({"kind": "table", "checks": checks}, instead_of, table)


def maps(
    shown: Sequence[dict],
    frames: Sequence[str] = (),
    label: str = "frame",
    instead_of: str = "",
    samples: Mapping[str, np.ndarray] | None = None,
    charts: Sequence[dict] = (),
    profile: Sequence[float] | None = None,
) -> Live:
    """Maps to be read pixel by pixel.

    Parameters
    ----------
    shown : sequence of dict
        Each with name and values, (H, W) or (F, H, W), NaN for no value; and if need be unit, cmap
        (of matplotlib), low and high; "names" of the values 0, 1, 2 ...
    frames : sequence of F str
        Names of what a slider leafs through.
    label, instead_of : str
        Of that slider; as of `Live`.
    samples : mapping of (N, H, W) uint8, optional
        Photographs of each phase shift, by name; those of the pixel are drawn with their curve.
    charts : sequence of dict
        Beside the maps: {"row": name} draws the row of the pixel in a map; {"counts": {name: (B,)
        counts}, "top", "title", "xlabel", "of"} how often each value from 0 to top occurs, with
        that of the pixel in the map `of`, or in its samples, marked.
    profile : sequence of float, optional
        That curve over one period, from its top on; by default a sinusoid.
    """
    size, stacks = list(np.shape(shown[0]["values"])[-2:]), {}
    spec = {"kind": "maps", "size": size, "maps": [], "checks": []}
    if frames:
        spec |= {"frames": list(frames), "frame_label": label}
    for m in shown:
        values = np.asarray(m["values"])
        values = values[None] if values.ndim == 2 else values
        entry = {"name": m["name"], "unit": m.get("unit", "")}
        entry["low"] = _short(m.get("low", np.nanmin(values)))
        entry["high"] = _short(m.get("high", np.nanmax(values)))
        entry |= {"colours": colours(m.get("cmap", "viridis")), "values": quantised(values)}
        entry |= {"names": list(m["names"])} if "names" in m else {}
        spec["maps"].append(entry)
        stacks[m["name"]] = values
    if charts:
        spec["charts"] = [
            c
            | {
                k: {n: np.asarray(v).tolist() for n, v in c[k].items()}
                for k in ("counts",)
                if k in c
            }
            for c in charts
        ]
    if profile is not None:
        spec["profile"] = [_short(x) for x in profile]
    if samples:
        spec["samples"] = {name: pack(np.asarray(stack)) for name, stack in samples.items()}
    seen = np.argwhere(np.isfinite(next(reversed(stacks.values()))[0].astype(float)))
    for frame, (v, u) in zip((0, len(frames) // 2), seen[[len(seen) // 2, -1]], strict=True):
        at = {k: float(a[min(frame, len(a) - 1), v, u]) for k, a in stacks.items()}
        for name, stack in (samples or {}).items():
            M, D = numerator_denominator(stack[:, v, u])
            at[name] = float(modulation(M, D, len(stack)))
        numbers = {k: _short(x) for k, x in at.items() if np.isfinite(x)}
        spec["checks"].append([{"frame": frame, "v": int(v), "u": int(u)}, numbers])
    return Live(spec, instead_of)


def space(
    bodies: Sequence[dict],
    look_from,
    look_at,
    alt: str,
    angle: float = 30.0,
    instead_of: str = "",
    controls: Sequence[dict] = (),
    formula: str = "",
    data: Mapping | None = None,
    checks: Sequence[tuple[dict, dict]] = (),
    hover: str = "",
) -> Live:
    """Meshes and points in space, to turn and to come closer to.

    Parameters
    ----------
    bodies : sequence of dict
        Each with name and mesh (Trimesh) or points (P, 3), mm; with a colour, or values of each
        vertex and a cmap, low and high; {"visible": False} hides it at first, "as_points" names a
        second body of its vertices alone; {"lines": True} joins points 0 and 1, 2 and 3 ...
    look_from, look_at : (x, y, z)
        mm.
    alt : str
        What is seen, for those who do not see it.
    angle : float
        Of the view, degrees.
    instead_of : str
        As of `Live`.
    controls, formula, data, checks
        As of `explore`; the formula returns {bodies: {name: {place, hue}}, numbers}: new vertices,
        3 floats each, and their colours, 4 bytes each.
    hover : str
        Name of the slider that a pointer moves: to the vertex of the first body under it.
    """
    import matplotlib.colors

    vertices = [np.asarray(b["mesh"].vertices if "mesh" in b else b["points"]) for b in bodies]
    low = np.min([v.min(axis=0) for v in vertices], axis=0)
    scale = float(np.max([v.max(axis=0) for v in vertices] - low) / 65535)
    spec = {"kind": "space", "alt": alt, "origin": [_short(x) for x in low], "scale": _short(scale)}
    spec["bodies"], points = [], []
    for k, (b, v) in enumerate(zip(bodies, vertices, strict=True)):
        body = {"name": b["name"], "points": pack(np.round((v - low) / scale).astype("<u2").T)}
        if "mesh" in b:
            body["faces"] = pack(np.asarray(b["mesh"].faces, "<u2" if len(v) < 65536 else "<u4"))
        if "values" in b:
            a, z = b.get("low", np.nanmin(b["values"])), b.get("high", np.nanmax(b["values"]))
            body["shade"] = pack(np.clip(255 * (b["values"] - a) / (z - a), 0, 255).astype("u1"))
            body["colours"] = colours(b.get("cmap", "viridis"))
        else:
            body["colour"] = [round(255 * c) for c in matplotlib.colors.to_rgb(b["colour"])]
        spec["bodies"].append(
            body | {name: b[name] for name in ("size", "visible", "lines") if name in b}
        )
        if "as_points" in b:
            same = {"colour": body["colour"]} if "colour" in body else {}
            points.append({"name": b["as_points"], "like": k, "visible": False, "size": 2} | same)
    spec["bodies"] += points
    eye, target = np.asarray(look_from, float), np.asarray(look_at, float)
    ahead, distance = target - eye, np.linalg.norm(target - eye)
    yaw, pitch = np.arctan2(ahead[0], ahead[2]), np.arcsin(ahead[1] / distance)
    spec["eye"] = {"at": [_short(x) for x in target], "yaw": _short(yaw), "pitch": _short(pitch)}
    spec["eye"] |= {"distance": _short(distance), "angle": angle}
    spec |= _computed(controls, formula, data, checks) | {"hover": hover} if formula else {}
    return Live(spec, instead_of)


def pack(array: np.ndarray, **more) -> dict:
    """An array as text, deflated; of whole numbers the differences, where these are shorter."""
    array = np.ascontiguousarray(array)
    array = array.astype(array.dtype.newbyteorder("<"))
    flat, kind = array.ravel(), array.dtype.kind + str(array.dtype.itemsize)
    data = zlib.compress(flat.tobytes(), 9)
    if array.dtype.kind == "u":  # differences wrap around, as they do when they are summed up
        delta = zlib.compress(np.diff(flat, prepend=flat.dtype.type(0)).tobytes(), 9)
        if len(delta) < len(data):
            data, more = delta, more | {"delta": True}
    text = base64.b64encode(data).decode()
    return {"b64": text, "dtype": kind, "shape": list(array.shape), "deflate": True} | more


def quantised(values: np.ndarray) -> dict:
    """Whole numbers as they are; others in 65,535 steps and one mark of no value."""
    if values.dtype.kind == "u":
        return pack(values)
    levels, low, high = 65535, float(np.nanmin(values)), float(np.nanmax(values))
    step = _short((high - low) / (levels - 1)) or 1.0
    low = _short(low)
    stored = np.where(np.isnan(values), levels, np.clip(np.round((values - low) / step), 0, 65534))
    return pack(stored.astype("u2"), scale=step, offset=low, none=levels)


def colours(name) -> dict:
    """256 colours of a map of matplotlib, by name or itself, red, green and blue."""
    import matplotlib

    table = matplotlib.colormaps.get_cmap(name)(np.linspace(0, 1, 256))[:, :3]
    return pack(np.round(255 * table).astype("u1"))


def _short(x) -> float:
    return float(f"{float(x):.9g}")
