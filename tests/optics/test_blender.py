"""Blender against the ray caster and against closed-form geometry."""

import functools
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from fpputil import probe
from fpputil.decoding import pointcloud, triangulation
from fpputil.decoding.decoder import decode
from fpputil.optics import blender, shapes
from fpputil.optics.blender import studio
from fpputil.optics.fringes import Fringe
from fpputil.optics.raycasting import bvh, raycast
from fpputil.optics.system import preset


@pytest.fixture(scope="module")
def blender_runs():
    if not probe.blender_works():
        pytest.skip("Blender does not run here; see python -m fpputil.probe")


def needs_blender(test):
    return pytest.mark.slow(pytest.mark.usefixtures("blender_runs")(test))


PHOTOGRAPHS = Path(__file__).parents[2] / "data" / "photographs"


def sphere():
    return shapes.sphere(100, (0, 0, 680))


def part():
    return shapes.place(shapes.part(1, "flange"), rotation=shapes.rotation(200, 25))


def shaded():
    """A ball that shades stairs, which shade each other."""
    ball = shapes.sphere(25, (45, 10, 560))
    return trimesh.util.concatenate([shapes.step_block(), ball])


SCENES = {"sphere": (sphere, "paper"), "part": (part, "small"), "shadows": (shaded, "small")}


def on_edges(mesh, system, reach=0.01):
    """Pixels within a hundredth of a pixel of an outline, a shadow's edge, or a facet's.

    Cycles spreads its rays so far. On a facet's edge it may also take the facet beside it for
    something in the way of the light.
    """
    tree, camera = bvh(mesh), system.camera
    seen = []
    for du, dv in ((0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)):
        K = camera.K.copy()
        K[:2, 2] -= reach * du, reach * dv
        moved = replace(system, camera=replace(camera, K=K))
        rays = moved.camera.rays().astype(np.float32).reshape(-1, 3)
        start = np.broadcast_to(camera.centre.astype(np.float32), rays.shape).copy()
        face = tree.scene.run(start, rays, query="INTERSECT").reshape(camera.height, camera.width)
        seen.append(np.where(raycast(tree, moved).mask, face, -1))
    return np.ptp(seen, axis=0) > 0


@pytest.fixture(scope="module")
def twins(paper_fringes):
    """Edges, our frames and Blender's of a scene; each scene is photographed once."""

    @functools.cache
    def get(name):
        build, camera = SCENES[name]
        mesh, system = build(), preset(camera).system
        ours = raycast(mesh, system).frames(paper_fringes)
        return on_edges(mesh, system), ours, blender.photograph(mesh, system, paper_fringes)

    return get


@needs_blender
@pytest.mark.parametrize("name", SCENES)
def test_photographs_are_those_of_the_ray_caster(twins, name):
    """Within one grey level; of the pixels on an edge, a handful are not."""
    edge, ours, blenders = twins(name)
    assert blenders.shape == ours.shape and blenders.dtype == np.uint8
    apart = np.abs(ours.astype(int) - blenders).max(axis=0)
    assert apart[~edge].max() <= 1
    assert edge.mean() < 0.03 and (apart > 1).sum() < 10


@needs_blender
@pytest.mark.parametrize("name", SCENES)
def test_absolute_phases_agree(twins, paper_fringes, name):
    edge, *pair = twins(name)
    ours, blenders = (decode(frames, paper_fringes, 912) for frames in pair)
    np.testing.assert_array_equal(ours.mask[~edge], blenders.mask[~edge])
    assert (ours.mask != blenders.mask).sum() < 10
    strong = (ours.modulation[-1] > 20) & (blenders.modulation[-1] > 20)
    assert strong.mean() > 0.15
    assert np.sqrt(np.mean((ours.Phi - blenders.Phi)[strong] ** 2)) < 2e-3


@needs_blender
def test_radius_of_the_sphere(paper, paper_fringes, twins):
    column = triangulation.column(decode(twins("sphere")[-1], paper_fringes, 912).Phi, 15)
    fit = pointcloud.fit_sphere(
        pointcloud.point_cloud(triangulation.triangulate(column, paper.system))
    )
    assert abs(fit.radius - 100) < 0.02
    assert fit.rms < 0.1


def compare(mesh, system, **look):
    """Two views, equal but for a handful of pixels on edges."""
    ours, blenders = raycast(mesh, system, **look), blender.see(mesh, system, **look)
    edge = on_edges(mesh, system)
    np.testing.assert_array_equal(ours.mask[~edge], blenders.mask[~edge])
    both = ours.mask & blenders.mask & ~edge
    assert both.sum() > 500 and (ours.mask != blenders.mask).sum() < 5
    for name, limit in {"column": 0.01, "row": 0.01, "depth": 0.01, "shade": 1e-3}.items():
        a, b = getattr(ours, name), getattr(blenders, name)
        assert b.dtype == np.float32
        np.testing.assert_allclose(b[both], a[both], rtol=0, atol=limit, err_msg=name)
        np.testing.assert_array_equal(np.isnan(b), ~blenders.mask & (name != "shade"))


def moved_world(system):
    """The same rig in another world: the camera is no longer at its origin."""
    R, t = Rotation.from_euler("xyz", (30, -50, 70), degrees=True).as_matrix(), (300, -200, 500)
    pinholes = (
        replace(p, R=p.R @ R.T, t=p.t - p.R @ R.T @ t) for p in (system.camera, system.projector)
    )
    return replace(system, **dict(zip(("camera", "projector"), pinholes, strict=True))), R, t


def with_K(system, name, K):
    return replace(system, **{name: replace(getattr(system, name), K=np.array(K, float))})


MATRICES = {
    "camera off centre": ("camera", [[266, 0, 60], [0, 266, 71], [0, 0, 1]]),
    "camera, wide pixels": ("camera", [[200, 0, 90], [0, 300, 50], [0, 0, 1]]),
    "camera, tall pixels": ("camera", [[320, 0, 70], [0, 240, 66], [0, 0, 1]]),
    "projector": ("projector", [[1100, 40, 400], [0, 1500, 700], [0, 0, 1]]),
}


@needs_blender
@pytest.mark.parametrize(("name", "K"), MATRICES.values(), ids=MATRICES)
def test_any_camera_matrix(tiny, name, K):
    compare(part(), with_K(tiny.system, name, K))


@needs_blender
def test_a_rig_anywhere(tiny):
    system, R, t = moved_world(tiny.system)
    mesh = part()
    mesh.vertices = mesh.vertices @ R.T + t
    compare(mesh, system)


@needs_blender
def test_one_albedo_for_each_face(tiny):
    mesh = part()
    albedo = np.random.default_rng(0).uniform(0, 1.2, len(mesh.faces))
    compare(mesh, tiny.system, albedo=albedo, white_at=650.0)


@needs_blender
def test_plane_is_exact(tiny):
    """Against the geometry itself: columns, depth, and cosine over the square of the distance."""
    system = tiny.system
    view = blender.see(shapes.plane(660.0), system, albedo=0.8)
    pixels = system.projector.project(system.points_at(660.0))
    np.testing.assert_array_equal(view.mask, system.projector.inside(pixels))
    seen = np.stack([view.column, view.row], -1)[view.mask]
    np.testing.assert_allclose(seen, pixels[view.mask], atol=2e-3)
    np.testing.assert_allclose(view.depth[view.mask], 660, atol=1e-3)
    beam = system.points_at(660.0) - system.projector.centre
    distance = np.linalg.norm(beam, axis=-1)
    shade = 0.8 * beam[..., 2] / distance * (400 / distance) ** 2
    np.testing.assert_allclose(view.shade[view.mask], shade[view.mask], rtol=1e-4)


PATTERNS = {
    "rows": (Fringe(40, 3, axis="row"), 0.05, 0),
    "gamma": (Fringe(24, 3, gamma=2.2), 0.05, 0),
    "levels": (Fringe(24, 3, levels=7), 0.05, 1e-3),
    "grid": (Fringe(24, 3, grid=True), 0.05, 1e-3),
    "all, 8 bit": (Fringe(17.3, 4, "row", 1.8, 256, True), 2, 1e-3),
}


@needs_blender
@pytest.mark.parametrize(("fringe", "limit", "share"), PATTERNS.values(), ids=PATTERNS)
def test_patterns_of_every_kind(tiny, fringe, limit, share):
    """Within a limit, grey levels. Where a pattern jumps, float32 may be beyond the jump."""
    mesh = shapes.plane(660.0)
    ours = raycast(mesh, tiny.system).frames(fringe, quantise=False)
    blenders = blender.photograph(mesh, tiny.system, fringe, quantise=False)
    assert blenders.dtype == np.float64 and blenders.shape == (fringe.steps, 120, 160)
    assert (np.abs(ours - blenders) > limit).mean() <= share


@needs_blender
def test_several_fringes_come_in_their_order(tiny):
    fringes = Fringe(24, 4), Fringe(114, 3, "row")
    frames = blender.photograph(part(), tiny.system, fringes)
    ours = raycast(part(), tiny.system).frames(fringes)
    assert (np.abs(frames.astype(int) - ours) > 1).mean() < 1e-4


@needs_blender
def test_a_face_seen_from_behind_is_dark(tiny):
    wall, back = shapes.plane(700.0), shapes.plane(600.0, 40.0)
    back.invert()
    mesh = trimesh.util.concatenate([wall, back])
    compare(mesh, tiny.system)


@needs_blender
def test_light_goes_forward_only(tiny):
    """What lies behind the projector, at z = 150 mm, is not lit."""
    behind = shapes.plane(100.0, 4.0)
    behind.apply_translation((-10, 0, 0))
    mesh = trimesh.util.concatenate([shapes.plane(700.0), behind])
    compare(mesh, tiny.system)


@needs_blender
def test_more_samples_mix_neighbours(tiny):
    """The mean light stays; a fringe of six pixels loses contrast."""
    mesh, fringe = shapes.plane(660.0), Fringe(24, 3)
    one, many = (
        blender.photograph(mesh, tiny.system, fringe, samples=s, quantise=False) for s in (1, 64)
    )
    inside = (slice(None), slice(20, 100), slice(20, 120))
    assert one[inside].mean() == pytest.approx(many[inside].mean(), rel=2e-3)
    assert 0.8 < many[inside].std() / one[inside].std() < 0.98


@needs_blender
def test_calls_do_not_depend_on_each_other(tiny, tmp_path, monkeypatch, capfd):
    """Nothing stays behind: no state, no file, no word on the output."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    fringe = Fringe(24, 3)
    before = blender.photograph(part(), tiny.system, fringe, samples=2)
    blender.see(sphere(), tiny.system)
    blender.picture([(part(), "teal")], (0, 0, 0), (0, 0, 650), (40, 30), samples=2)
    after = blender.photograph(part(), tiny.system, fringe, samples=2)
    np.testing.assert_array_equal(before, after)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_importing_needs_no_blender():
    code = "import sys, fpputil.optics.blender; assert 'bpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


WITHOUT = {
    "switched off": ({"FPP_BLENDER": "0"}, object(), "switched off by FPP_BLENDER=0"),
    "not installed": ({}, None, r"pip install 'fpputil\[blender\]'"),
    "no X libraries": ({}, object(), "apt install libgl1 libsm6"),
}


@pytest.mark.parametrize(("settings", "spec", "says"), WITHOUT.values(), ids=WITHOUT)
def test_without_blender_one_sentence_says_what_to_do(tiny, monkeypatch, settings, spec, says):
    monkeypatch.delenv("FPP_BLENDER", raising=False)
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(probe, "blender_works", lambda: False)
    monkeypatch.setattr(studio.importlib.util, "find_spec", lambda name: spec)
    with pytest.raises(ImportError, match=says) as caught:
        blender.see(shapes.plane(660.0), tiny.system)
    assert "\n" not in str(caught.value)
    with pytest.raises(ImportError, match=says):
        blender.photograph(shapes.plane(660.0), tiny.system, Fringe(24))
    with pytest.raises(ImportError, match=says):
        blender.picture([(shapes.plane(660.0), "red")], (0, 0, 0), (0, 0, 1))


@needs_blender
@pytest.mark.parametrize("take", [blender.see, lambda *a: blender.photograph(*a, Fringe(24, 3))])
def test_nothing_to_see(tiny, take):
    with pytest.raises(ValueError, match="outside the view of the camera"):
        take(shapes.sphere(10, (5000, 0, 660), 2), tiny.system)
    turned_away = shapes.plane(660.0)
    turned_away.invert()
    with pytest.raises(ValueError, match="at least one pixel must be seen and lit"):
        take(turned_away, tiny.system)


@needs_blender
def test_picture_shows_bodies_light_and_shadow(tiny):
    """A wall under fringes: white sky around it, stripes on it, and a ball's shadow."""
    projector, size = tiny.system.projector, (160, 120)
    wall = shapes.plane(800.0, 150.0, 100.0)
    ball = shapes.sphere(15, (0, 0, 450), 4)
    box = trimesh.creation.box((60, 60, 60))
    box.apply_translation(projector.centre - (0, 0, 30))
    light = {"projector": projector, "fringe": Fringe(60), "samples": 16}
    look = (0, 0, 0), (0, 0, 800), size, 24.0
    dull = blender.picture([(wall, "grey")], *look, samples=16)
    lit = blender.picture([(wall, "grey"), (box, "red")], *look, **light)
    shadow = blender.picture([(wall, "grey"), (ball, "blue")], *look, **light)
    veiled = blender.picture([(wall, "grey"), (ball, ("blue", 0.5))], *look, **light)
    assert lit.shape == (120, 160, 3) and lit.dtype == np.uint8
    assert (lit[:3, :3] == 255).all()
    row = lit[30, 40:120].astype(int)
    assert np.ptp(row) > 60 and np.ptp(dull[30, 40:120].astype(int)) < 30
    ball_at = (slice(57, 64), slice(77, 84))
    assert shadow[ball_at][..., 2].mean() > shadow[ball_at][..., 0].mean() + 30
    left = (slice(54, 66), slice(48, 64))  # where the shadow falls
    assert shadow[left].mean() < lit[left].mean() - 20
    assert abs(veiled[left].mean() - lit[left].mean()) < 5


def test_sheets_of_light_lie_on_the_bright_columns(tiny):
    projector = tiny.system.projector
    mesh = blender.sheets(projector, 114, 600.0)
    start, *ends = np.moveaxis(mesh.triangles, 1, 0)
    np.testing.assert_allclose(start, np.broadcast_to(projector.centre, (8, 3)))
    pixels = projector.project(np.stack(ends))
    np.testing.assert_allclose(pixels[..., 0], np.tile(np.arange(0, 912, 114), (2, 1)), atol=1e-9)
    np.testing.assert_allclose(pixels[..., 1], [[-0.5] * 8, [1139.5] * 8])
    depth_of = (np.stack(ends) - projector.centre) @ projector.R[2]
    np.testing.assert_allclose(depth_of, 600)


@pytest.mark.parametrize("shape", [(4, 5), (4, 5, 3), (7, 4, 5)])
def test_stored_photographs_are_those_made(tmp_path, monkeypatch, shape):
    image = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    path = tmp_path / "frames.npz"
    monkeypatch.setattr(probe, "blender_works", lambda: True)
    np.testing.assert_array_equal(blender.stored(path, lambda: image), image)
    np.testing.assert_array_equal(blender.stored(path, lambda: 255 - image), 255 - image)
    monkeypatch.setattr(probe, "blender_works", lambda: False)
    np.testing.assert_array_equal(blender.stored(path, lambda: 1 / 0), image)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
def test_the_stored_frames_are_those_of_either_twin(tiny, paper_fringes, monkeypatch):
    """The photographs that readers without Blender see."""
    monkeypatch.setattr(probe, "blender_works", lambda: False)
    kept = blender.stored(PHOTOGRAPHS / "sphere-tiny.npz", lambda: None)
    mesh = sphere()
    ours = raycast(mesh, tiny.system).frames(paper_fringes)
    edge = on_edges(mesh, tiny.system)
    assert np.abs(kept.astype(int) - ours)[:, ~edge].max() <= 1
    monkeypatch.undo()
    if probe.blender_works():
        anew = blender.photograph(mesh, tiny.system, paper_fringes)
        assert np.abs(kept.astype(int) - anew)[:, ~edge].max() <= 1


def test_bad_stores(tmp_path, monkeypatch):
    monkeypatch.setattr(probe, "blender_works", lambda: False)
    with pytest.raises(FileNotFoundError, match="no such stored photograph, and Blender does not"):
        blender.stored(tmp_path / "x.npz", lambda: None)
    (tmp_path / "x.npz").write_bytes(b"not a picture")
    with pytest.raises(ValueError, match="holds no"):
        blender.stored(tmp_path / "x.npz", lambda: None)
