"""Ray casting against closed-form geometry."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from fpputil.optics.pinhole import Pinhole, camera_matrix, looking
from fpputil.optics.raycasting import bvh, raycast
from fpputil.optics.shapes import plane, sphere


def test_plane_is_exact(tiny):
    view = raycast(plane(660.0, 300.0), tiny.system)
    np.testing.assert_allclose(view.depth[view.mask], 660.0, rtol=1e-7)
    expected = tiny.system.columns_at(660.0)
    np.testing.assert_allclose(view.column[view.mask], expected[view.mask], rtol=1e-6, atol=1e-4)
    inside = (expected >= -0.5) & (expected < 911.5)
    np.testing.assert_array_equal(view.mask, inside)


def test_row_and_column_are_the_projection_of_the_point(tiny, sphere_view):
    rays = tiny.system.camera.rays()
    points = rays * sphere_view.depth[..., None]
    pixel = tiny.system.projector.project(points)[sphere_view.mask]
    np.testing.assert_allclose(sphere_view.column[sphere_view.mask], pixel[:, 0], atol=2e-3)
    np.testing.assert_allclose(sphere_view.row[sphere_view.mask], pixel[:, 1], atol=2e-3)


def test_sphere_depth_against_the_quadratic(tiny, sphere_view):
    """No further off than the facets are from the sphere, seen at an angle."""
    mesh = sphere(100, (0, 0, 680))
    sagitta = 100 - np.linalg.norm(mesh.triangles_center - (0, 0, 680), axis=1).min()
    rays = tiny.system.camera.rays()
    centre = np.array([0, 0, 680.0])
    a, b = np.sum(rays**2, -1), rays @ centre
    with np.errstate(invalid="ignore"):
        z = (b - np.sqrt(b**2 - a * (centre @ centre - 100.0**2))) / a
    normal = (rays * z[..., None] - centre) / 100
    facing = -np.sum(normal * rays, -1) / np.sqrt(a)
    steep = sphere_view.mask & (facing > 0.3)
    assert steep.sum() > 0.8 * sphere_view.mask.sum()
    assert np.abs(sphere_view.depth - z)[steep].max() < sagitta / 0.3 + 1e-3


@pytest.mark.parametrize("specular", [0.0, 0.5])
def test_shade_is_cosine_and_highlight_over_distance_squared(tiny, specular):
    """The highlight is Blinn's: it grows as the normal nears the half of both ways off."""
    view = raycast(plane(660.0, 300.0), tiny.system, albedo=0.8, specular=specular, shininess=20)
    points = tiny.system.points_at(660.0)
    to_light, to_eye = tiny.system.projector.centre - points, -points
    distance = np.linalg.norm(to_light, axis=-1)
    half = to_light / distance[..., None] + to_eye / np.linalg.norm(to_eye, axis=-1)[..., None]
    highlight = (-half[..., 2] / np.linalg.norm(half, axis=-1)) ** 20
    expected = (0.8 * -to_light[..., 2] / distance + specular * highlight) * (400 / distance) ** 2
    np.testing.assert_allclose(view.shade[view.mask], expected[view.mask], rtol=1e-5)


@pytest.mark.parametrize("kind", ["faces", "callable"])
def test_albedo_textures(tiny, kind):
    mesh = plane(660.0, 300.0)
    plain = raycast(mesh, tiny.system, albedo=1.0)
    if kind == "faces":
        view = raycast(mesh, tiny.system, albedo=np.full(len(mesh.faces), 0.5))
        np.testing.assert_allclose(view.shade, plain.shade * 0.5, rtol=1e-5)
    else:
        view = raycast(mesh, tiny.system, albedo=lambda p: np.where(p[:, 0] > 0, 0.25, 1.0))
        right = tiny.system.points_at(660.0)[..., 0] > 0
        ratio = view.shade[view.mask] / plain.shade[view.mask]
        np.testing.assert_allclose(ratio, np.where(right, 0.25, 1.0)[view.mask], rtol=1e-5)


@pytest.mark.parametrize("gap", [10.0, 180.0])
def test_shadow_of_a_plate(tiny, gap):
    """A plate before a wall, lit from far to the right: what it hides from camera or projector."""
    projector = looking((400, 0, 0), (0, 0, 700), (912, 1140), angle=60)
    system = replace(tiny.system, projector=projector)
    wall, plate = plane(780.0, 400.0), plane(780.0 - gap, 20.0, 100.0)
    view = raycast(trimesh.util.concatenate([wall, plate]), system)
    points = system.points_at(780.0)

    def off_the_plate(eye):  # mm, of where the line of sight to the wall passes
        x, y = np.moveaxis((points + (eye - points) * gap / (780 - eye[2]))[..., :2], -1, 0)
        return np.maximum(np.abs(x) - 20, np.abs(y) - 100)

    seen, lit = off_the_plate(np.zeros(3)), off_the_plate(projector.centre)
    clear = (np.abs(seen) > 0.1) & (np.abs(lit) > 0.1)
    shadow = (seen > 0) & (lit < 0)
    assert (shadow & clear).sum() > 50
    np.testing.assert_array_equal(view.mask[clear], ~shadow[clear])


@pytest.mark.parametrize("side", [1, -1])
def test_a_wall_between_camera_and_projector(tiny, side):
    """One side is seen and not lit, the other lit and not seen: either way the mask is empty."""
    corners = [(20, -50, 500), (20, 50, 500), (20, 50, 800), (20, -50, 800)]
    wall = trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False)
    if side < 0:
        wall.invert()
    with pytest.raises(ValueError, match="empty mask"):
        raycast(wall, tiny.system)


def test_the_middle_sample_is_the_pixel_centre(tiny):
    mesh = sphere(100, (0, 0, 680))
    view = raycast(mesh, tiny.system, supersample=3)
    np.testing.assert_allclose(view.fine.column[1::3, 1::3], view.column, atol=1e-3)


def test_supersampling_mixes_only_the_edges(tiny):
    near, far = plane(560.0, 40.0), plane(760.0, 400.0)
    mesh = trimesh.util.concatenate([near, far])
    one, fine = raycast(mesh, tiny.system), raycast(mesh, tiny.system, supersample=3)
    np.testing.assert_array_equal(one.column, fine.column)
    a, b = one.plain(quantise=False), fine.plain(quantise=False)
    changed = np.abs(a - b) > 1.0
    assert 0 < changed.mean() < 0.1
    step = np.abs(np.diff(np.nan_to_num(one.depth), axis=1)) > 100
    near_step = np.zeros_like(changed)
    near_step[:, :-1] |= step
    near_step[:, 1:] |= step
    down = np.abs(np.diff(np.nan_to_num(one.depth), axis=0)) > 100
    near_step[:-1] |= down
    near_step[1:] |= down
    assert near_step[changed].mean() > 0.95


def test_one_tree_serves_many_views(tiny):
    mesh = sphere(100, (0, 0, 680))
    tree = bvh(mesh)
    plain, first, second = (raycast(m, tiny.system) for m in (mesh, tree, tree))
    np.testing.assert_array_equal(plain.column, first.column)
    np.testing.assert_array_equal(first.column, second.column)


def test_a_moved_rig_sees_the_same_as_a_moved_object(tiny):
    mesh = trimesh.creation.box((120, 80, 60))
    mesh.apply_translation((10, -5, 660))
    R, t = Rotation.from_euler("xyz", (3, 12, -7), degrees=True).as_matrix(), np.array([5.0, 9, 2])
    moved = mesh.copy()
    moved.vertices = mesh.vertices @ R.T + t
    system = tiny.system
    pinholes = {
        name: replace(p, R=p.R @ R, t=p.R @ t + p.t)
        for name, p in (("camera", system.camera), ("projector", system.projector))
    }
    a, b = raycast(moved, system), raycast(mesh, replace(system, **pinholes))
    assert (a.mask != b.mask).mean() < 1e-3
    both = a.mask & b.mask
    np.testing.assert_allclose(a.column[both], b.column[both], atol=2e-3)
    np.testing.assert_allclose(a.depth[both], b.depth[both], atol=2e-3)


def test_a_lens_does_not_fold_far_points_into_the_image(tiny):
    """Barrel distortion turns back far off the axis; what lies there is not lit."""
    projector = replace(tiny.system.projector, distortion=(-0.3, 0, 0, 0))
    wide = Pinhole(320, 240, camera_matrix(50, 320, 240))
    system = replace(tiny.system, camera=wide, projector=projector)
    view = raycast(plane(660.0, 4000.0), system)
    beam = system.points_at(660.0)[view.mask] - projector.centre
    angle = np.arccos(beam @ projector.R[2] / np.linalg.norm(beam, axis=1))
    assert np.degrees(angle).max() < 45
    ideal = raycast(plane(660.0, 4000.0), replace(system, projector=tiny.system.projector))
    assert 1 < view.mask.sum() / ideal.mask.sum() < 1.5


@pytest.mark.parametrize("s", [2, 3])
def test_samples_lie_evenly_in_the_pixel(tiny, s):
    """On a plane the mean of the samples' columns is the column of the centre."""
    view = raycast(plane(660.0, 300.0), tiny.system, supersample=s)
    h, w = view.mask.shape
    mean = view.fine.column.reshape(h, s, w, s).mean(axis=(1, 3))
    inside = view.mask & np.isfinite(mean)
    np.testing.assert_allclose(mean[inside], view.column[inside], atol=2e-3)
