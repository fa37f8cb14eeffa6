"""Projectors above, on their heads, on their sides and in mirrors; systems of other rigs."""

from dataclasses import replace

import numpy as np
import pytest

from fpputil.capture.depth import diagnose_points, locate
from fpputil.capture.faults.mounting import growth_by, way, writing
from fpputil.capture.folder import decode_folder
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.virtual import photograph, photograph_into, write_photograph
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import sphere
from fpputil.optics.system import preset

PROJECTOR = (912, 1140)
COLUMNS = fringe_set((912, 114, 19), 8)
ROWS = fringe_set((1140, 114, 19), 8, axis="row")
SETS = {"column": COLUMNS, "row": ROWS, "both": COLUMNS + ROWS}
PATTERNS = {name: Patterns(PROJECTOR, fringes) for name, fringes in SETS.items()}
PLACES = {
    "right": ((45, 0, 150), 0),
    "left": ((-45, 0, 150), 0),
    "above": ((0, -45, 150), 0),
    "below": ((0, 45, 150), 0),
    "on its head": ((45, 0, 150), 180),
    "on its side": ((45, 0, 150), 90),
    "on its other side": ((45, 0, 150), -90),
    "mirrored camera": ((45, 0, 150), 0),
}


@pytest.fixture(scope="module")
def rig(hung):
    """Function from a preset and a place to a system."""

    def hang(name, place="right"):
        system = hung(preset(name).system, *PLACES[place])
        if place != "mirrored camera":
            return system
        K = system.camera.K * ((-1, 1, 1), (1, 1, 1), (1, 1, 1))
        return replace(system, camera=replace(system.camera, K=K))

    return hang


@pytest.fixture
def decoded(tmp_path):
    """Function that photographs a sphere by a system and decodes it by another: results, truth."""

    def run(true, system, axes="column", patterns=None, change=lambda frame: frame, noise=1, **how):
        view = raycast(sphere(90, (0, 0, 660)), true)
        folder = tmp_path / "shots"
        folder.mkdir(exist_ok=True)
        shown = replace(patterns or PATTERNS[axes], shift=1)
        for shot, frame in photograph(view, shown, true, noise=noise, ambient=10):
            write_photograph(folder / shot.file, change(frame))
        how = {"report": False, "pictures": False, "force": True} | how
        result = decode_folder(folder, None, system, patterns=patterns or PATTERNS[axes], **how)
        return result, view

    return run


def median_error(result, view) -> float:
    known = np.isfinite(result.points[..., 2])
    assert known.sum() > 0.95 * view.mask.sum()
    return float(np.median(np.abs(result.points[..., 2] - view.depth)[known]))


def codes(result) -> dict:
    return {f.code: f.severe for f in result.findings}


QUICK = [("on its head", "column"), ("above", "row"), ("on its side", "both"),
         ("mirrored camera", "column")]  # fmt: skip


@pytest.mark.parametrize("place, axes", QUICK)
def test_what_the_system_says_of_the_mounting_is_the_truth(rig, decoded, place, axes):
    system = rig("small", place)
    result, view = decoded(system, system, axes)
    assert codes(result) == {} and median_error(result, view) < 0.15


@pytest.mark.slow
@pytest.mark.parametrize("axes", SETS)
@pytest.mark.parametrize("place", PLACES)
def test_every_mounting_is_measured_to_a_tenth_of_a_millimetre(rig, decoded, place, axes):
    """Or, along the axis that hardly tells the depth there, refused."""
    system = rig("paper", place)
    result, view = decoded(system, system, axes)
    across = "row" if place in ("above", "below", "on its side", "on its other side") else "column"
    if axes in (across, "both"):
        assert codes(result) == {} and median_error(result, view) < 0.1
    else:
        assert codes(result) == {"blunt": True} and result.points is None


def test_fringes_that_hardly_tell_the_depth_are_refused(rig, decoded):
    result, _ = decoded(rig("small"), rig("small"), "row")
    assert codes(result) == {"blunt": True} and result.points is None
    assert "columns would tell the depth" in result.findings[0].message
    assert not result.summary["decoded"]


def test_the_remedy_harms_nobody(rig, decoded):
    """A projector on its head looks like steps that go the other way; the remedy names both."""
    true = rig("small", "on its head")
    alone, _ = decoded(true, None)
    assert codes(alone) == {"direction": True}
    assert all(word in alone.findings[0].remedy for word in ("shift -1", "on its head", "mirrored"))
    turned = replace(PATTERNS["column"], shift=-1)
    told, _ = decoded(true, true, patterns=turned)
    assert codes(told) == {"mounting": True} and told.points is None
    assert "grow from left to right in the picture, by the system from right to left" in (
        told.findings[0].message
    )
    assert "by the system it stands on its head" in told.findings[0].remedy


def test_steps_that_go_the_other_way_are_told_beside_an_upright_system(rig, decoded):
    turned = replace(PATTERNS["both"], shift=-1)
    result, _ = decoded(rig("small"), rig("small"), "both", patterns=turned)
    assert [f.code for f in result.findings if f.severe] == ["mounting", "mounting"]
    assert "it stands upright; if it does, the steps go the other way: give shift 1" in (
        result.findings[0].remedy
    )


@pytest.mark.parametrize("shift", [1, -1])
def test_mirrored_photographs_are_named(rig, decoded, shift):
    """Whichever way the steps go, on whichever side the projector lies."""
    mirror = {"change": lambda frame: frame[:, ::-1]}
    shown = replace(PATTERNS["both"], shift=shift)
    for place in ("right", "on its side"):
        result, _ = decoded(rig("small", place), None, "both", shown, **mirror)
        assert codes(result)["mirrored"] and "direction" not in codes(result)
    result, _ = decoded(rig("small"), rig("small"), "both", shown, **mirror)
    assert codes(result)["mirrored"] and result.points is None
    assert "against those of the system" in result.findings[0].message


def test_rows_may_be_photographed_first(rig, decoded):
    result, view = decoded(rig("small"), rig("small"), patterns=Patterns(PROJECTOR, ROWS + COLUMNS))
    assert codes(result) == {} and median_error(result, view) < 0.15


@pytest.mark.parametrize("system", [None, "right"])
def test_dark_photographs_are_not_called_mirrored(rig, decoded, system):
    system = system and rig("small", system)
    result, _ = decoded(rig("small"), system, "both", change=np.zeros_like)
    assert codes(result) == {"dark": True}


def test_one_axis_in_a_mirror_is_not_measured(rig, decoded):
    result, _ = decoded(rig("small"), rig("small"), change=lambda frame: frame[:, ::-1])
    assert codes(result) == {"mounting": True} and result.points is None


def test_a_projector_on_its_side_is_no_fault_of_phases(rig, decoded):
    for axes in ("column", "both"):
        result, _ = decoded(rig("small", "on its side"), None, axes)
        assert codes(result) == {} and result.summary["decoded"]


def focal(system, factor):
    K = system.projector.K * ((factor, 1, 1), (1, factor, 1), (1, 1, 1))
    return replace(system, projector=replace(system.projector, K=K))


def test_a_system_of_another_rig_is_named(rig, decoded):
    true = rig("small")
    for other, axes, code in (
        (rig("small", "below"), "column", "range"),
        (rig("small", "below"), "both", "apart"),
        (focal(true, 1.02), "both", "apart"),
    ):
        result, _ = decoded(true, other, axes)
        assert codes(result)[code] and result.points is None
        assert not result.summary["decoded"] and "points" not in result.summary
    assert "system" in result.findings[0].remedy


@pytest.mark.parametrize("share, severe", [(0.03, None), (0.2, False), (0.6, True)])
def test_pixels_outside_the_measuring_range_are_told(rig, decoded, share, severe):
    """A note from a twentieth of those in the mask, an error from half."""
    true = rig("small")
    view = raycast(sphere(90, (0, 0, 660)), true)
    near = replace(true, z_max=float(np.quantile(view.depth[view.mask], 1 - share)))
    result, _ = decoded(true, near)
    assert codes(result).get("range") is severe
    if severe is not None:
        text = result.findings[0].message
        far = view.depth[result.measurements[0].mask] > near.z_max
        assert int(text.split("%")[0]) == pytest.approx(100 * far.mean(), abs=0.6)
        assert "480 to" in text and "0% lie nearer" in text


def test_points_without_light_of_the_projector_are_told(rig, decoded, tmp_path):
    """Its columns fit any row: those that its picture does not have tell of another rig."""
    true = rig("small")
    decoded(true, None)
    one = measure(open_capture(tmp_path / "shots", PATTERNS["column"]))
    K = true.projector.K + ((0, 0, 0), (0, 0, 900), (0, 0, 0))
    moved = replace(true, projector=replace(true.projector, K=K))
    found = list(diagnose_points(locate([one], moved), [one], moved))
    assert [(f.code, f.severe) for f in found] == [("beam", True)]


def test_noise_alone_does_not_contradict(rig, decoded):
    """With a long pitch columns and rows part by half a pixel and more."""
    patterns = Patterns(
        PROJECTOR, fringe_set((912, 114), 8) + fringe_set((1140, 114), 8, axis="row")
    )
    result, _ = decoded(rig("small"), rig("small"), "both", patterns, noise=7.0)
    assert "apart" not in codes(result)
    located = locate(result.measurements, rig("small"))
    assert np.nanmedian(located.miss) > 0.5


def test_an_upright_system_does_not_take_a_projector_on_its_head(rig, decoded):
    """Whose columns, counted the other way, are one off: 3 mm here."""
    turned = replace(PATTERNS["both"], shift=-1)
    result, _ = decoded(rig("small", "on its head"), rig("small"), "both", turned)
    assert codes(result) == {"apart": True} and result.points is None


def test_the_report_of_another_rig_does_not_blame_the_phases(undrawn, rig, decoded):
    result, _ = decoded(rig("small"), rig("small", "below"), report=True)
    page = (result.out / "report.html").read_text()
    assert "The points are wrong" in page and "have no depth from 480 to 820 mm" in page


def test_no_point_at_all_is_an_error_even_if_accepted(rig, decoded):
    near = replace(rig("small"), z_min=100.0, z_max=120.0)
    result, _ = decoded(rig("small"), near)
    assert codes(result) == {"range": True} and "100%" in result.findings[0].message
    with pytest.raises(ValueError, match="no point inside the measuring range"):
        decoded(rig("small"), near, accept=True)


def test_accepted_points_are_written(rig, decoded):
    result, _ = decoded(rig("small"), rig("small"), "row", accept=True)
    assert codes(result) == {"blunt": True} and result.summary["points"] > 1000


def test_patterns_of_another_projector_are_refused(tmp_path, tiny):
    wide = Patterns((1824, 1140), fringe_set((1824, 114, 24), 4))
    projector = replace(tiny.system.projector, width=1824)
    system = replace(tiny.system, projector=projector)
    view = raycast(sphere(90, (0, 0, 660)), system)
    photograph_into(tmp_path / "shots", view, wide, system)
    words = "projector of 1824 x 1140 pixels given; the system has one of 912 x 1140"
    with pytest.raises(ValueError, match=words):
        decode_folder(tmp_path / "shots", system=tiny.system)


def test_both_axes_are_as_sharp_as_the_sharper_one_and_say_so(rig, decoded, tmp_path):
    """The scatter about the truth, in the standard deviations that are told, is one."""
    system = rig("small", "on its side")
    result, view = decoded(system, system, "both")
    off = result.points[..., 2] - view.depth
    sigma = locate(result.measurements, system).sigma
    known = np.isfinite(off) & (result.measurements[0].modulation[2] > 40)
    assert np.median(np.abs(off[known] / sigma[known])) == pytest.approx(0.674, rel=0.1)


@pytest.mark.parametrize("place", PLACES)
def test_the_growth_is_that_of_the_projected_pixels(rig, place):
    system = rig("tiny", place)
    v, u = 60, 80
    rows, columns = (system.projector.project(system.points_at(650.0))[..., k] for k in (1, 0))
    for growth, image in zip(growth_by(system), (columns, rows), strict=True):
        middle = image[v, u + 1] - image[v, u], image[v + 1, u] - image[v, u]
        np.testing.assert_allclose(growth, middle, atol=0.6)
    upright = {"on its head": "stands on its head", "mirrored camera": "is mirrored"}
    assert upright.get(place, "side" if "side" in place else "upright") in writing(system)


def test_ways_have_words():
    ways = {way(d) for d in ((2, 1), (-2, 1), (1, 2), (1, -2))}
    assert ways == {"from left to right", "from right to left", "downwards", "upwards"}
