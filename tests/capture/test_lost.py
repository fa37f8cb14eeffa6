"""No mask is emptied in silence."""

from dataclasses import replace

import numpy as np
import pytest

from fpputil.capture.faults.diagnosis import diagnose
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.quality import Reason
from fpputil.capture.report import page
from fpputil.optics.fringes import fringe_set

pytestmark = pytest.mark.usefixtures("undrawn")
PROJECTOR = (912, 1140)
EIGHT = Patterns(PROJECTOR, fringe_set((912, 114, 36), 8))


def spoiled(share, change):
    """Change of the photographs in the upper share of the picture."""
    rng = np.random.default_rng(0)

    def spoil(frames):
        rows = round(240 * share)
        out = {}
        for name, frame in frames.items():
            top = frame[:rows].astype(float)
            out[name] = frame.copy()
            out[name][:rows] = np.clip(change(name, top, rng), 0, 255).astype(np.uint8)
        return out

    return spoil


def scattered(name, top, rng):
    """A second fringe in the same photographs, which goes two periods while the first goes one."""
    step = int(name[-6:-4])
    return top + 45 + 40 * np.cos(2 * np.pi * (np.arange(320) / 50 + 2 * step / 8))


def unsteady(name, top, rng):
    """Blocks of a few pixels whose fringes lose contrast at the finest pitch."""
    weak = np.kron(np.indices((60, 80)).sum(axis=0) % 2, np.ones((4, 4)))[: len(top)] == 1
    return np.where(weak & ("-36-" in name), 60 + (top - 60) * 0.45, top)


@pytest.mark.parametrize(
    "change, reason, code, word",
    [
        (scattered, Reason.SCATTERED, "lost", "on no sinusoid"),
        (unsteady, Reason.UNSTEADY, "lost", "from pitch to pitch"),
    ],
)
def test_a_reason_that_takes_many_pixels_is_told(judged, change, reason, code, word):
    for share, severe in ((0.02, None), (0.3, False), (1.0, True)):
        result, findings = judged(EIGHT, spoiled(share, change), gain=0.5)
        lost = (result.reason == reason).sum() / result.lit.sum()
        html = page("x", [result], list(findings.values()))
        if severe is None:
            assert lost < 0.05 and not findings and "Nothing speaks against" in html
            continue
        assert lost > 0.05
        if lost > 0.5 or not severe:
            assert findings[code].severe == severe and word in findings[code].message
        assert any(f.severe for f in findings.values()) == severe
        assert "Nothing speaks against" not in html


@pytest.mark.parametrize("width, severe", [(840, None), (700, False), (420, True)])
def test_columns_outside_the_projector_are_told(taken, width, severe):
    capture = taken(EIGHT)
    capture = replace(capture, patterns=replace(EIGHT, projector=(width, 1140)))
    result = measure(capture)
    findings = {f.code: f.severe for f in diagnose(result, capture)}
    assert findings == ({} if severe is None else {"lost": severe})


def test_half_of_the_orders_unsure_is_an_error(judged):
    result, findings = judged(Patterns(PROJECTOR, fringe_set((912, 36), 4)), noise=12.0)
    assert (result.reason == Reason.UNSURE).sum() > 0.5 * result.lit.sum()
    assert findings["orders"].severe
