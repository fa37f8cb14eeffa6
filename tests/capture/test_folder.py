"""A folder of photographs decoded by one call: what is returned, and what is left on disk."""

from dataclasses import replace

import numpy as np
import pytest

from fpputil.capture.depth import locate
from fpputil.capture.folder import board_pose, decode_folder
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.virtual import photograph_into
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import sphere

PROJECTOR = (912, 1140)
PATTERNS = Patterns(PROJECTOR, fringe_set((912, 114, 24), 4))


@pytest.fixture
def shots(tmp_path, sphere_view, tiny):
    photograph_into(tmp_path / "a <b> & c", sphere_view, PATTERNS, tiny.system, noise=1.0)
    return tmp_path / "a <b> & c"


def test_results_are_those_of_measure_and_lie_beside_the_folder(undrawn, shots, tiny):
    result = decode_folder(shots, system=tiny.system)
    direct = measure(open_capture(shots))
    assert result.out == shots.with_name("a <b> & c-decoded")
    assert result.findings == () and result.summary["decoded"]
    np.testing.assert_array_equal(result.measurements[0].Phi, direct.Phi)
    np.testing.assert_allclose(result.points, direct.points(tiny.system), rtol=1e-12)
    with np.load(result.out / "decoded.npz") as file:
        np.testing.assert_array_equal(file["column_Phi"], direct.Phi)
        assert np.isfinite(file["depth_sigma"]).sum() == result.summary["points"]
    page = (result.out / "report.html").read_text()
    assert "<h1>Decoding of a &lt;b&gt; &amp; c</h1>" in page and "<b> &" not in page


def test_points_of_no_known_uncertainty_are_left_out(shots, tiny, monkeypatch):
    def holed(*given):
        located = locate(*given)
        located.sigma[:, :80] = np.inf
        return located

    monkeypatch.setattr("fpputil.capture.folder.locate", holed)
    result = decode_folder(shots, system=tiny.system, report=False, pictures=False)
    assert result.summary["points"] == np.isfinite(result.points[:, 80:, 2]).sum()


def test_the_folder_one_is_in_is_decoded_beside_itself(shots, monkeypatch):
    monkeypatch.chdir(shots)
    result = decode_folder(".", report=False, pictures=False)
    assert result.out == shots.with_name("a <b> & c-decoded") and result.out.is_dir()


def test_a_bad_board_is_refused_whichever_way_the_projector_hangs(tmp_path, hung, tiny):
    """The direction is no fault of a pose; two photographs exchanged are."""
    system = hung(tiny.system, roll=180)
    fringes = (*fringe_set((1140, 114), 8), *fringe_set((1140, 114), 8, axis="row"))
    view = raycast(sphere(100, (0, 0, 680)), system)
    photograph_into(tmp_path / "pose", view, Patterns(PROJECTOR, fringes), system, noise=1)
    pose, _ = board_pose(tmp_path / "pose")
    assert np.median(np.abs(pose.column - view.column)[np.isfinite(pose.column)]) < 0.5
    a, b = (tmp_path / "pose" / f"row-114-0{n}.png" for n in (2, 5))
    a.rename(tmp_path / "aside")
    b.rename(a)
    (tmp_path / "aside").rename(b)
    with pytest.raises(ValueError, match="row-114-02.png and row-114-05.png are exchanged"):
        board_pose(tmp_path / "pose")


def test_photographs_written_as_arrays_are_decoded(tmp_path, sphere_view, tiny):
    arrays = replace(PATTERNS, files="{pitch}-{step}.npy")
    photograph_into(tmp_path / "shots", sphere_view, arrays, tiny.system)
    assert measure(open_capture(tmp_path / "shots")).mask.any()
    with pytest.raises(ValueError, match="912-0 given; png, bmp, pgm, .* files are read"):
        photograph_into(tmp_path, sphere_view, replace(arrays, files="{pitch}-{step}"), tiny.system)


def test_wrong_phases_are_not_written(undrawn, shots, tiny):
    turned = replace(PATTERNS, shift=-1)
    result = decode_folder(shots, shots.with_name("out"), tiny.system, patterns=turned)
    assert [f.code for f in result.findings] == ["mounting"]
    assert not result.summary["decoded"] and result.points is None
    assert sorted(p.name for p in result.out.iterdir()) == [
        ".fpputil.json",
        "report.html",
        "summary.json",
    ]
    page = (result.out / "report.html").read_text()
    assert "The phases are wrong" in page and "the projector&#39;s columns grow" in page


def test_a_board_is_seen_by_camera_and_projector(tmp_path, sphere_view, tiny):
    fringes = (*fringe_set((1140, 114), 4), *fringe_set((1140, 114), 4, axis="row"))
    photograph_into(tmp_path / "pose", sphere_view, Patterns(PROJECTOR, fringes), tiny.system)
    pose, projector = board_pose(tmp_path / "pose")
    assert projector == PROJECTOR and pose.name == "pose"
    seen = np.isfinite(pose.column) & np.isfinite(pose.row) & sphere_view.mask
    assert seen.sum() > 0.9 * sphere_view.mask.sum()
    assert np.median(np.abs(pose.column - sphere_view.column)[seen]) < 0.5
    assert np.median(np.abs(pose.row - sphere_view.row)[seen]) < 0.5
