"""The page on a capture: what is drawn, how it is scaled, what is escaped, how large it is."""

import json
import re

import matplotlib.pyplot as plt
import numpy as np
import pytest

from fpputil.capture.faults.diagnosis import Finding, diagnose
from fpputil.capture.folder import decode_folder
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.report import linked, overview, page
from fpputil.capture.virtual import photograph_into
from fpputil.optics.fringes import fringe_set
from fpputil.optics.system import preset

PROJECTOR = (912, 1140)
EIGHT = Patterns(PROJECTOR, fringe_set((912, 114, 36), 8))


def test_a_dark_capture_is_scaled_to_what_is_there(taken):
    for gain, bright, contrast in ((0.9, 256, 128), (0.22, 64, 32)):
        result = measure(taken(EIGHT, gain=gain, ambient=0))
        fig = overview(result)
        assert fig.axes[0].images[0].get_clim()[1] == min(bright, 255)
        assert fig.axes[1].get_xlim()[1] == bright and fig.axes[7].get_xlim()[1] == contrast
        plt.close(fig)


def test_the_row_shown_goes_through_the_object(taken, wall):
    rows = np.flatnonzero(wall.mask.any(axis=1))
    fig = overview(measure(taken(EIGHT)))
    row = int(fig.axes[8].get_title().split()[1])
    assert rows[0] + 0.4 * np.ptp(rows) < row < rows[0] + 0.6 * np.ptp(rows)
    plt.close(fig)


def test_notes_of_two_axes_say_which(taken):
    fringes = (*fringe_set((1140, 114), 3), *fringe_set((1140, 114), 3, axis="row"))
    capture = taken(Patterns(PROJECTOR, fringes))
    both = [measure(capture, axis) for axis in ("column", "row")]
    findings = [f for one in both for f in diagnose(one, capture)]
    assert [f.axis for f in findings] == ["column", "row"]
    html = page("x", both, findings)
    assert "<li>columns: so few steps" in html and "<li>rows: so few steps" in html
    assert html.count("<img") == html.count("data-instead-of=") == 2 and len(html) < 3e6


def test_the_panels_hold_the_values_samples_and_reasons(taken):
    result = measure(taken(EIGHT))
    spec = linked(result).spec
    names = [one["name"] for one in spec["maps"]]
    assert names == [
        *("average", "modulation", "wrapped phase", "absolute phase", "uncertainty"),
        *("projector column", "why left out"),
    ]
    assert spec["maps"][-1]["names"][5] == "order unsure"
    assert list(spec["samples"]) == ["pitch 912", "pitch 114", "pitch 36"]
    levels, strengths, row = spec["charts"]
    seen = [frames[:, np.ptp(frames, axis=0) > 16] for frames in result.sample]
    assert [sum(n) for n in levels["counts"].values()] == [one.size for one in seen]
    assert strengths["of"] == "modulation" and row == {"row": "projector column"}
    assert result.shown[2].dtype == np.uint8
    np.testing.assert_array_equal(result.shown[2].shape[1:], spec["size"])


def test_each_panel_holds_its_own_values(taken, monkeypatch):
    monkeypatch.setattr("fpputil.interactive.maps", lambda maps, **how: maps)
    m = measure(taken(EIGHT))
    panels = {one["name"]: one["values"] for one in linked(m)}
    every = -(-m.mask.shape[0] // len(panels["average"]))
    expected = {
        "average": m.average,
        "modulation": m.modulation[2],
        "wrapped phase": np.where(m.lit, m.wrapped[2], np.nan),
        "absolute phase": m.Phi,
        "uncertainty": m.sigma,
        "projector column": m.coordinate,
        "why left out": m.reason,
    }
    assert list(panels) == list(expected) and not m.lit.all()
    for name, values in expected.items():
        np.testing.assert_array_equal(panels[name], values[::every, ::every], err_msg=name)


def test_a_capture_without_a_good_pixel_has_a_page(taken):
    capture = taken(EIGHT, lambda frames: {k: np.full_like(v, 9) for k, v in frames.items()})
    result = measure(capture)
    html = page("dark", [result], diagnose(result, capture))
    assert "The phases are wrong" in html and "nan" not in html.lower().split("<table>")[0]
    assert "uncertainty" not in [one["name"] for one in linked(result).spec["maps"]]


def test_names_of_a_stranger_are_text(undrawn, tmp_path, wall):
    hostile = tmp_path / '"><img src=x onerror=alert(1)>'
    photograph_into(hostile, wall, EIGHT, preset("small").system, noise=1.0)
    out = decode_folder(hostile, tmp_path / "out", pictures=False).out
    html = (out / "report.html").read_text(encoding="utf-8")
    assert "<img src=x" not in html and "&lt;img src=x onerror=alert(1)&gt;" in html
    name = "</script><script>alert(1)</script>"
    findings = [Finding("frame", True, f"{name}: does not fit", "again")]
    result = measure(open_capture(hostile))
    assert name not in page(name, [result], findings)


@pytest.mark.slow
def test_a_large_capture_has_a_page_under_three_megabytes(tmp_path, paper_sphere_view, paper):
    fringes = (*fringe_set((1140, 114, 24), 8), *fringe_set((1140, 114, 24), 8, axis="row"))
    photograph_into(
        tmp_path / "shots", paper_sphere_view, Patterns(PROJECTOR, fringes), paper.system, noise=2.0
    )
    result = decode_folder(tmp_path / "shots", system=paper.system, pictures=False)
    html = (result.out / "report.html").read_text(encoding="utf-8")
    assert 3e5 < len(html) < 3e6
    assert not re.findall(r'(?:src|href)="(?!data:)', html)  # nothing is fetched
    specs = re.findall(r'<script type="application/json">(.*?)</script>', html, re.S)
    assert [json.loads(spec)["maps"][5]["name"] for spec in specs] == ["depth", "projector row"]


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_what_is_left_out_is_told_by_name_in_the_panel(taken, share):
    result = measure(taken(EIGHT, noise=1.0 + 30 * share))
    reasons = linked(result).spec["maps"][-1]
    assert reasons["high"] == len(reasons["names"]) - 1
