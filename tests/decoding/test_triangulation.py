"""Depth against geometry: triangulation, phase-height, fits, files."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from fpputil.decoding import phase_height, pointcloud, triangulation
from fpputil.decoding.decoder import decode
from fpputil.optics.pinhole import Pinhole
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import plane

LENS = (-0.1, 0.03, 1e-3, -5e-4, 0.0)


@pytest.mark.parametrize("camera_lens", [(), LENS])
@pytest.mark.parametrize("projector_lens", [(), LENS])
def test_triangulation_inverts_projection(tiny, camera_lens, projector_lens):
    system = replace(
        tiny.system,
        camera=replace(tiny.system.camera, distortion=camera_lens),
        projector=replace(tiny.system.projector, distortion=projector_lens),
    )
    z = np.random.default_rng(0).uniform(500, 800, (120, 160))
    points = system.points_at(z)
    column = system.projector.project(points)[..., 0]
    got = triangulation.triangulate(column, system)
    sensitive = system.columns_per_mm(660.0) > 0.05
    np.testing.assert_allclose(got[sensitive], points[sensitive], atol=1e-6)


@pytest.mark.parametrize("known", ["row", "both"])
@pytest.mark.parametrize("projector_lens", [(), LENS])
def test_rows_and_both_invert_projection(tiny, hung, known, projector_lens):
    """Of a projector above the camera, and on its side: where rows, or both, tell the depth."""
    system = hung(tiny.system, (0, -45, 150)) if known == "row" else hung(tiny.system, roll=60)
    camera = replace(system.camera, distortion=LENS)
    projector = replace(system.projector, distortion=projector_lens)
    system = replace(system, camera=camera, projector=projector)
    points = system.points_at(np.random.default_rng(0).uniform(500, 800, (120, 160)))
    column, row = np.moveaxis(system.projector.project(points), -1, 0)
    found = triangulation.intersect(None if known == "row" else column, row, system)
    sharp = found.sigma < 20  # mm a pixel
    assert sharp.mean() > 0.6
    np.testing.assert_allclose(found.points[sharp], points[sharp], atol=1e-5)
    assert np.isnan(found.miss).all() if known == "row" else np.nanmax(found.miss) < 1e-6
    inside = system.projector.inside(np.stack([column, row], -1))
    np.testing.assert_array_equal(found.inside[sharp], inside[sharp])


@pytest.mark.parametrize("projector_lens", [(), LENS])
def test_two_axes_make_the_least_squares_point(tiny, hung, projector_lens):
    """Against a search along the ray; and its scatter is what `sigma` says."""
    system = hung(tiny.system, roll=40)
    projector = replace(system.projector, distortion=projector_lens)
    system, rng = replace(system, projector=projector), np.random.default_rng(1)
    lit = projector.project(system.points_at(650.0))
    sigma = np.array([0.3, 0.1])
    noisy = lit + sigma * rng.standard_normal(lit.shape)
    found = triangulation.intersect(noisy[..., 0], noisy[..., 1], system, sigma)
    z = triangulation.depth_of(found.points, system)
    v, u = 40, 50
    depths = z[v, u] + np.linspace(-1, 1, 2001)
    ways = system.camera.centre + depths[:, None] * system.camera.rays([u, v])
    cost = (((projector.project(ways) - noisy[v, u]) / sigma) ** 2).sum(axis=1)
    assert abs(depths[cost.argmin()] - z[v, u]) < 2e-3
    miss = np.linalg.norm(projector.project(found.points) - noisy, axis=-1)
    np.testing.assert_allclose(found.miss, miss, rtol=1e-5, atol=1e-5)
    sharp = found.sigma < 2
    assert np.std((z - 650)[sharp] / found.sigma[sharp]) == pytest.approx(1, abs=0.03)


def test_one_axis_fills_where_the_other_is_unknown(tiny, hung):
    system = hung(tiny.system, roll=40)
    column, row = np.moveaxis(system.projector.project(system.points_at(650.0)), -1, 0)
    column[:60], row[:, :80] = np.nan, np.nan
    points = triangulation.triangulate(column, system, row)
    assert (np.isfinite(points[..., 2]) == (np.isfinite(column) | np.isfinite(row))).all()
    sharp = np.isfinite(points[..., 2]) & (np.abs(np.arange(160) - 80) < 70)
    np.testing.assert_allclose(points[sharp][:, 2], 650.0, atol=1e-4)


def test_rays_are_bent_only_where_something_is_known(tiny, monkeypatch):
    camera = replace(tiny.system.camera, distortion=LENS)
    system, asked, rays = replace(tiny.system, camera=camera), [], Pinhole.rays
    column = system.columns_at(650.0)
    column[20:] = np.nan
    monkeypatch.setattr(Pinhole, "rays", lambda self, uv: asked.append(len(uv)) or rays(self, uv))
    assert np.isfinite(triangulation.triangulate(column, system)[:20, :100]).all()
    assert sum(asked) == 20 * 160


@settings(deadline=None, max_examples=30)
@given(u=st.integers(0, 120), v=st.integers(0, 119), z=st.floats(480, 820))
def test_round_trip_of_any_point(u, v, z):
    from fpputil.optics.system import preset

    system = preset("tiny").system
    column = np.full((120, 160), np.nan)
    column[v, u] = system.columns_at(z)[v, u]
    got = triangulation.triangulate(column, system)
    np.testing.assert_allclose(got[v, u], system.points_at(z)[v, u], atol=1e-7)
    assert np.isnan(got).sum() == 3 * (120 * 160 - 1)


def test_raycast_depth_is_triangulated_back(tiny, sphere_view):
    points = triangulation.triangulate(sphere_view.column, tiny.system)
    z = triangulation.depth_of(points, tiny.system)
    assert np.nanmax(np.abs(z - sphere_view.depth)) < 1e-3
    assert (np.isfinite(z) == sphere_view.mask).all()


def test_behind_the_camera_is_nan(tiny):
    P, behind = tiny.system.projector.P, -200 * tiny.system.camera.rays()
    column = (behind @ P[0, :3] + P[0, 3]) / (behind @ P[2, :3] + P[2, 3])
    assert np.isnan(triangulation.triangulate(column, tiny.system)).all()


def test_skew_of_the_projector(tiny):
    K = tiny.system.projector.K.copy()
    K[0, 1] = 20
    system = replace(tiny.system, projector=replace(tiny.system.projector, K=K))
    points = triangulation.triangulate(system.columns_at(660.0), system)
    np.testing.assert_allclose(points[:, :120], system.points_at(660.0)[:, :120], atol=1e-8)


@pytest.mark.parametrize("dtype", [np.uint8, bool])
def test_masks_of_any_kind(dtype):
    mask = np.zeros((5, 6), dtype)
    mask[1, 2] = 1
    assert pointcloud.point_cloud(np.ones((5, 6, 3)), mask).shape == (1, 3)


def test_eight_bit_phase_of_the_paper_preset(paper, paper_sphere_view, paper_fringes):
    """RMS under 0.005 rad where the modulation exceeds 20, and no order error."""
    d = decode(paper_sphere_view.frames(paper_fringes), paper_fringes, 912)
    error = d.Phi - paper_fringes[-1].phase(paper_sphere_view.column)
    strong = d.modulation[-1] > 20
    assert strong.sum() > 50_000
    assert np.sqrt(np.mean(error[strong] ** 2)) < 0.005
    assert np.abs(error[strong]).max() < np.pi


@pytest.mark.parametrize("noise, tolerance", [(0.0, 0.02), (2.0, 0.05)])
def test_sphere_radius_of_the_paper_preset(
    paper, paper_sphere_view, paper_fringes, noise, tolerance
):
    frames = paper_sphere_view.frames(paper_fringes, noise, 0)
    d = decode(frames, paper_fringes, 912)
    points = triangulation.triangulate(triangulation.column(d.Phi, 15), paper.system)
    fit = pointcloud.fit_sphere(pointcloud.point_cloud(points))
    assert abs(fit.radius - 100) < tolerance
    assert fit.rms < 0.1


@pytest.mark.parametrize("degree, inside", [(1, 10.0), (3, 0.1), (5, 1e-3)])
def test_phase_height_models_on_planes(tiny, degree, inside):
    heights = np.linspace(560, 760, 9)
    Phi = np.stack([2 * np.pi * tiny.system.columns_at(z) / 24 for z in heights])
    Phi[:, :, 120:] = np.nan  # towards the epipole the phase says nothing
    model = phase_height.fit_phase_height(Phi, heights, degree)
    got = model.height(2 * np.pi * tiny.system.columns_at(637.0) / 24)
    assert np.nanmax(np.abs(got - 637.0)) < inside
    assert np.isnan(got[:, 120:]).all() and np.isfinite(got[:, :120]).all()


@pytest.mark.parametrize("degree", [1, 3])
def test_a_phase_that_is_straight_in_height_gives_it_exactly(degree):
    a, b = np.random.default_rng(0).uniform(1, 2, (2, 4, 5))
    heights = np.linspace(560, 760, 9)
    model = phase_height.fit_phase_height(a + b * heights[:, None, None], heights, degree)
    np.testing.assert_allclose(model.height(a + b * 637.1), 637.1, rtol=0, atol=1e-9)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1000), radius=st.floats(1, 500), z=st.floats(-1000, 1000))
def test_sphere_fit_is_exact_on_a_cap(seed, radius, z):
    rng = np.random.default_rng(seed)
    n = rng.normal(size=(200, 3))
    n[:, 2] = -np.abs(n[:, 2])
    points = radius * n / np.linalg.norm(n, axis=1, keepdims=True) + (3, -4, z)
    fit = pointcloud.fit_sphere(points)
    assert fit.radius == pytest.approx(radius, rel=1e-6)
    np.testing.assert_allclose(fit.centre, (3, -4, z), atol=1e-4)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1000), noise=st.floats(0, 0.1))
def test_plane_fit(seed, noise):
    rng = np.random.default_rng(seed)
    normal = np.array([0.1, -0.2, 1.0]) / np.sqrt(1.05)
    basis = np.linalg.svd(normal[None])[2][1:]
    points = 600 * normal + rng.uniform(-100, 100, (500, 2)) @ basis
    points += noise * rng.standard_normal((500, 1)) * normal
    fit = pointcloud.fit_plane(points)
    assert abs(fit.distance - 600) < 0.02 + noise and fit.rms < 1.2 * noise + 1e-9
    assert fit.normal @ normal > 0.99999


def test_plane_through_the_whole_chain(tiny):
    from fpputil.optics.fringes import fringe_set

    fringes = fringe_set(tiny.pitches.descending)
    view = raycast(plane(700.0, 150.0), tiny.system)
    d = decode(view.frames(fringes), fringes, 912)
    points = triangulation.triangulate(triangulation.column(d.Phi, 24), tiny.system)
    keep = tiny.system.columns_per_mm(660.0) > 0.1
    fit = pointcloud.fit_plane(pointcloud.point_cloud(points, keep))
    assert fit.distance == pytest.approx(700, abs=0.05) and fit.rms < 0.2


def test_ply_round_trip(tmp_path, tiny, sphere_view):
    points = triangulation.triangulate(sphere_view.column, tiny.system)
    cloud = pointcloud.point_cloud(points)
    colours = np.tile(np.array([10, 20, 30], np.uint8), (len(cloud), 1))
    pointcloud.save_ply(tmp_path / "cloud.ply", cloud, colours)
    back = trimesh.load(tmp_path / "cloud.ply")
    np.testing.assert_allclose(back.vertices, cloud, atol=1e-4)
    assert (back.colors[:, :3] == (10, 20, 30)).all()
    pointcloud.save_ply(tmp_path / "cloud.ply", cloud[:1])
    np.testing.assert_allclose(trimesh.load(tmp_path / "cloud.ply").vertices, cloud[:1], atol=1e-4)
    mesh = pointcloud.surface(points, max_edge=20)
    pointcloud.save_ply(tmp_path / "mesh.ply", mesh)
    assert len(trimesh.load(tmp_path / "mesh.ply").faces) == len(mesh.faces)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cloud.ply", "mesh.ply"]


def test_surface_faces_the_camera_and_drops_bridges(tiny):
    mesh = trimesh.util.concatenate([plane(560.0, 40.0), plane(760.0, 400.0)])
    view = raycast(mesh, tiny.system)
    points = triangulation.triangulate(view.column, tiny.system)
    whole, cut = pointcloud.surface(points), pointcloud.surface(points, max_edge=30)
    assert len(cut.faces) < len(whole.faces)
    spans = cut.triangles[:, :, 2].max(axis=1) - cut.triangles[:, :, 2].min(axis=1)
    assert spans.max() < 30
    assert (cut.face_normals[:, 2] < 0).mean() > 0.99


def test_wrong_baseline_moves_the_sphere(paper, paper_sphere_view):
    """The oracle notices: 1 mm of baseline changes the radius by more than its tolerance."""
    p = paper.system.projector
    moved = replace(paper.system, projector=replace(p, t=-p.R @ (p.centre + (1, 0, 0))))
    points = triangulation.triangulate(paper_sphere_view.column, moved)
    assert abs(pointcloud.fit_sphere(pointcloud.point_cloud(points)).radius - 100) > 0.05
