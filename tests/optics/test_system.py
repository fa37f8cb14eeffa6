"""Pinholes and presets against geometry and OpenCV."""

import json
import os
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fpputil.optics.pinhole import Pinhole, camera_matrix
from fpputil.optics.system import System, from_blender, preset, table2

LENS = (-0.12, 0.05, 1e-3, -5e-4, 0.01)


def pinhole(distortion=()):
    R = Rotation.from_euler("xyz", (5, -8, 3), degrees=True).as_matrix()
    K = camera_matrix(900, 640, 480) + [(0, 7, 0), (0, 50, 0), (0, 0, 0)]  # skew, tall pixels
    return Pinhole(640, 480, K, R, (20, -30, 40), distortion)


@pytest.mark.parametrize("distortion", [(), LENS])
def test_projection_is_opencv_s(distortion):
    p = pinhole(distortion)
    points = np.random.default_rng(0).uniform((-150, -100, 500), (150, 100, 900), (50, 3))
    rvec = cv2.Rodrigues(p.R)[0]  # OpenCV knows no skew: K is applied here
    plain = cv2.projectPoints(points, rvec, p.t, np.eye(3), np.array(distortion or [0.0] * 4))[0]
    expected = plain[:, 0] @ p.K[:2, :2].T + p.K[:2, 2]
    np.testing.assert_allclose(p.project(points), expected, atol=1e-8)
    beams = (points - p.centre) / ((points - p.centre) @ p.R[2])[:, None]
    np.testing.assert_allclose(p.rays(expected), beams, atol=1e-9)


def test_a_lens_that_turns_back_ends_where_it_turns():
    """``r (1 - 0.3 r^2)`` grows up to r = 1.05, where it is 0.70."""
    p = Pinhole(640, 480, np.eye(3), distortion=(-0.3, 0, 0, 0))
    points = np.array([(r, 0, 1) for r in (0.9, 1.2, 2.0, 20.0)])
    np.testing.assert_allclose(p.project(points)[:, 0], (0.9 - 0.3 * 0.9**3, *[np.nan] * 3))
    rays = p.rays([(0.9 - 0.3 * 0.9**3, 0), (0.75, 0), (2.0, 0)])
    np.testing.assert_allclose(rays[:, 0], (0.9, np.nan, np.nan))


@pytest.mark.slow
@settings(deadline=None, max_examples=50)
@given(u=st.floats(0, 639), v=st.floats(0, 479), s=st.floats(100, 2000), lens=st.booleans())
def test_rays_and_projection_are_inverse(u, v, s, lens):
    p = pinhole(LENS if lens else ())
    pixel = np.array([u, v])
    np.testing.assert_allclose(p.project(p.centre + s * p.rays(pixel)), pixel, atol=1e-6)


def test_points_behind_have_no_pixel():
    assert np.isnan(pinhole().project(pinhole().centre - pinhole().R[2] * 100)).all()


def test_pixel_centres_are_integers(paper):
    camera = paper.system.camera
    assert tuple(camera.K[:2, 2]) == (319.5, 239.5)
    np.testing.assert_array_equal(camera.grid()[3, 5], (5, 3))
    assert camera.inside(np.array([[-0.5, 0], [639.49, 479.49]])).all()
    assert not camera.inside(np.array([[-0.51, 0], [639.5, 0], [0, 479.5]])).any()


def test_table_2_in_camera_axes(paper):
    """The projector stands 45 mm to the right and 150 mm forward, turned 5 degrees in."""
    system = paper.system
    np.testing.assert_allclose(system.camera.R, np.eye(3))
    np.testing.assert_allclose(system.projector.centre, (45, 0, 150), atol=1e-9)
    axis = system.projector.R[2]
    np.testing.assert_allclose(axis, (-np.sin(np.radians(5)), 0, np.cos(np.radians(5))), atol=1e-12)
    assert system.camera.K[0, 0] == pytest.approx(12 / 7.2 * 640)
    assert (system.projector.width, system.projector.height) == (912, 1140)


def test_optical_axes_cross_before_the_working_distance(paper):
    p = paper.system.projector
    z = p.centre[2] - p.centre[0] * p.R[2, 2] / p.R[2, 0]
    assert z == pytest.approx(664.4, abs=0.1)


def test_sensitivity_falls_to_the_epipole_at_the_right_edge(paper):
    line = paper.system.columns_per_mm(660.0)[240]
    np.testing.assert_allclose(line[[0, 320, 639]], (0.410, 0.219, 0.0004), atol=6e-4)


@pytest.mark.parametrize(
    "name, size, high",
    [("tiny", (160, 120), 24), ("small", (320, 240), 18), ("paper", (640, 480), 15)],
)
def test_presets(name, size, high):
    p = preset(name)
    assert (p.system.camera.width, p.system.camera.height) == size
    assert (p.pitches.high, p.pitches.mid, p.pitches.zmin, p.pitches.unit) == (high, 114, 304, 912)
    assert (p.system.z_min, p.system.z_max) == (480, 820)
    centre = p.system.camera.height // 2, p.system.camera.width // 2
    span = p.system.columns_at(820.0)[centre] - p.system.columns_at(480.0)[centre]
    assert abs(span) / high >= 3, "three high periods inside the measuring range"


def test_near_speaks_of_objects_as_the_tables_of_the_paper_do():
    near, middle = preset("near"), (60, 80)
    s, z = near.system, near.centre[2]
    ends = [s.columns_at(z + k * near.size / 2)[middle] for k in (-1, 1)]
    assert np.ptp(ends) / 114 == pytest.approx(1.8, abs=0.05)
    assert np.ptp(ends) / 15 == pytest.approx(14, abs=0.5)
    assert 15 / (2 * np.pi * s.columns_per_mm(z)[middle]) == pytest.approx(1.6, abs=0.05)  # mm/rad


def test_presets_share_one_field_of_view():
    corner = [preset(n).system.camera.rays(np.array([-0.5, -0.5])) for n in ("tiny", "paper")]
    np.testing.assert_allclose(*corner)


def test_blender_camera_looks_along_minus_z():
    R, centre = from_blender((1, 2, 3), (0, 0, 0))
    np.testing.assert_allclose(R[2], (0, 0, -1))
    np.testing.assert_allclose(R[1], (0, -1, 0))
    np.testing.assert_allclose(centre, (1000, 2000, 3000))


def test_points_at_lie_on_the_plane_of_a_moved_camera(paper):
    R = Rotation.from_euler("y", 20, degrees=True).as_matrix()
    camera = replace(paper.system.camera, R=R, t=np.array([10.0, 20, 30]))
    points = replace(paper.system, camera=camera).points_at(600.0)
    np.testing.assert_allclose(points @ R[2] + 30, 600.0)


@pytest.mark.parametrize("moved", [False, True])
def test_a_mirrored_system_sees_the_mirrored_columns(paper, moved):
    """Wherever the camera stands, the picture is turned round, and so are the columns."""
    system = paper.system
    if moved:
        R, t = Rotation.from_euler("xyz", (5, 20, -8), degrees=True).as_matrix(), (10.0, 20, 30)
        system = replace(
            system,
            camera=replace(system.camera, R=R, t=t),
            projector=replace(
                system.projector,
                R=system.projector.R @ R,
                t=system.projector.R @ t + system.projector.t,
            ),
        )
    mirrored, back = system.mirrored(), system.mirrored().mirrored()
    expected = 911 - system.columns_at(600.0)[:, ::-1]
    np.testing.assert_allclose(mirrored.columns_at(600.0), expected, atol=1e-9)
    np.testing.assert_allclose(back.projector.P, system.projector.P, atol=1e-9)


@pytest.mark.parametrize("suffix", ["json", "yml", "yaml"])
@pytest.mark.parametrize("distortion", [(), LENS])
def test_save_and_load(tmp_path, suffix, distortion):
    system = table2()
    system = replace(system, camera=replace(system.camera, distortion=distortion))
    path = tmp_path / f"system.{suffix}"
    system.save(path)
    loaded = System.load(path)
    assert (loaded.z_min, loaded.z_max) == (480, 820)
    for name in ("camera", "projector"):
        a, b = getattr(system, name), getattr(loaded, name)
        assert (a.width, a.height) == (b.width, b.height)
        for array in ("K", "R", "t", "distortion"):
            np.testing.assert_array_equal(getattr(a, array), getattr(b, array))
    assert [p.name for p in tmp_path.iterdir()] == [path.name], "no partial file stays"


def test_yaml_is_readable_by_opencv(tmp_path):
    table2().save(tmp_path / "system.yml")
    store = cv2.FileStorage(str(tmp_path / "system.yml"), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(store.getNode("camera_K").mat(), table2().camera.K)


@pytest.mark.parametrize("suffix", ["json", "yml"])
@pytest.mark.parametrize("keep", [0.0, 0.3, 0.7, 0.95])
def test_half_written_file(tmp_path, suffix, keep):
    path = tmp_path / f"system.{suffix}"
    table2().save(path)
    text = path.read_text()
    path.write_text(text[: int(keep * len(text))])
    with pytest.raises(ValueError, match="holds camera, projector"):
        System.load(path)


@pytest.mark.parametrize(
    "change",
    [
        {"camera": {"width": 160.7}},
        {"camera": {"distorsion": []}},
        {"z_far": 3},
        {"projector": 3},
    ],
)
def test_system_files_hold_what_they_must_and_no_more(tmp_path, change):
    path = tmp_path / "system.json"
    table2().save(path)
    data = json.loads(path.read_text())
    for key, value in change.items():
        data[key] = {**data[key], **value} if isinstance(value, dict) else value
    path.write_text(json.dumps(data))
    with pytest.raises(ValueError, match="holds camera, projector"):
        System.load(path)


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "system.json"
    table2().save(path)
    before = path.read_text()

    def full_disk(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space left on device, writing .*system.json"):
        table2(160).save(path)
    assert path.read_text() == before
    assert [p.name for p in tmp_path.iterdir()] == ["system.json"]
    with pytest.raises(FileNotFoundError, match="its folder .* does not exist"):
        table2().save(tmp_path / "none" / "system.json")


def test_arrays_cannot_be_changed_in_place():
    with pytest.raises(ValueError, match="read-only"):
        pinhole().K[0, 0] = 1


def test_the_projector_lights_to_the_outer_edges_of_its_pixels(tiny):
    """Half a pixel beyond the centres of the first and the last column, and no further."""
    system, width, near = tiny.system, tiny.system.projector.width, 0
    for z in np.linspace(system.z_min, system.z_max, 60):
        columns, lit = system.columns_at(z), system.lit_at(z)
        inner = ((columns >= -0.5) & (columns < 0)) | (np.abs(columns - width + 0.75) < 0.25)
        outer = (columns < -0.5) | (columns > width - 0.5)
        near += inner.sum() + (np.abs(columns - width + 0.25) < 0.25).sum()
        assert lit[inner].all() and not lit[outer].any()
    assert near > 100
