"""Clouds that can be used: without specks and lone points, as a mesh, and as others open them."""

import json

import numpy as np
import pytest
import trimesh

from fpputil.capture.folder import decode_folder
from fpputil.capture.patterns import Patterns
from fpputil.capture.virtual import photograph_into
from fpputil.cli import main
from fpputil.decoding.pointcloud import clean_points, fit_sphere, surface
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import sphere

PATTERNS = Patterns((912, 1140), fringe_set((912, 114, 24), 4))


@pytest.fixture(scope="module")
def shots(tmp_path_factory, tiny):
    """A sphere, and a few small boxes beside it that make specks."""
    places = [(x, y, 680.0) for x in (-125, 125) for y in (-90, 0, 90)]
    boxes = [trimesh.creation.box((8, 8, 8)) for _ in places]
    for one, place in zip(boxes, places, strict=True):
        one.apply_translation(place)
    view = raycast(trimesh.util.concatenate([sphere(80, (0, 0, 680)), *boxes]), tiny.system)
    folder = tmp_path_factory.mktemp("cloud") / "shots"
    photograph_into(folder, view, PATTERNS, tiny.system, noise=1.0)
    return folder


@pytest.fixture
def decoded(shots, tmp_path, tiny):
    def run(**how):
        quick = {"report": False, "pictures": False, "force": True}
        return decode_folder(shots, tmp_path / "out", tiny.system, **quick, **how)

    return run


def test_specks_are_left_out_and_told(decoded):
    result = decoded()
    np.testing.assert_array_equal(np.isfinite(result.points[..., 2]), depth_known(result))
    whole = decoded(min_area=0)
    lost = result.summary["removed"]["in specks"]
    assert 30 < lost < 200 and whole.summary["removed"] == {}
    assert whole.summary["points"] == result.summary["points"] + lost
    points = result.points[np.isfinite(result.points).all(axis=-1)]
    distances = np.linalg.norm(points - (0, 0, 680), axis=1)
    assert np.abs(distances - 80).max() < 4  # of the boxes nothing is left


def depth_known(result):
    with np.load(result.out / "decoded.npz") as file:
        return np.isfinite(file["depth"])


def test_the_command_tells_what_it_left_out(undrawn, shots, tmp_path, capsys):
    words = ["decode", str(shots), "--out", str(tmp_path / "o"), "--no-pictures"]
    rig = ["--system", "tiny", "--force"]
    assert main([*words, *rig, "--mesh", "--max-sigma", "2", "--lone", "4"]) == 0
    said = capsys.readouterr().out
    assert "uncertain" in said and "in specks left out)" in said
    assert (tmp_path / "o" / "mesh.ply").is_file()
    assert main([*words, *rig, "--min-area", "0"]) == 0
    assert "left out" not in capsys.readouterr().out
    assert main([*words, *rig, "--min-area", "100000"]) == 1
    assert "no point is left" in capsys.readouterr().err
    assert main([*words, "--force", "--mesh"]) == 1
    assert "--mesh without --system given" in capsys.readouterr().err


def test_uncertain_points_are_left_out_on_request(decoded):
    free, result = decoded(), decoded(max_sigma=0.5)
    with np.load(result.out / "decoded.npz") as file:
        known = np.isfinite(file["depth"])
        assert np.all(file["depth_sigma"][known] <= 0.5)
    assert result.summary["removed"]["uncertain"] > 0
    assert result.summary["points"] < free.summary["points"]


def test_lone_points_are_left_out_on_request():
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(60.0), np.arange(50.0))
    points = np.stack([x, y, 600 + rng.normal(0, 0.05, x.shape)], -1)
    rows, columns = rng.integers(0, 50, 20), rng.integers(0, 60, 20)
    points[rows, columns, 2] += 40 * rng.choice((-1, 1), 20)
    cleaned, removed = clean_points(points, lone=4)
    alone = np.zeros(x.shape, bool)
    alone[rows, columns] = True
    np.testing.assert_array_equal(np.isnan(cleaned[..., 2]), alone)
    assert removed == {"lone": alone.sum()} and np.isfinite(points).all()


@pytest.mark.parametrize(
    "limits, said",
    [
        ({"max_sigma": 1.0}, "max_sigma 1.0 without sigma given"),
        ({"lone": 0}, "lone 0 given"),
        ({"min_area": -1}, "min_area -1 given"),
    ],
)
def test_limits_that_cannot_be(limits, said):
    with pytest.raises(ValueError, match=said):
        clean_points(np.zeros((3, 3, 3)), **limits)


def test_the_mesh_is_the_sphere_with_normals_to_the_camera(decoded):
    result = decoded(mesh=True)
    mesh = trimesh.load(result.out / "mesh.ply", process=False)
    assert fit_sphere(np.asarray(mesh.vertices)).radius == pytest.approx(80, abs=0.5)
    outwards = mesh.vertices - (0, 0, 680)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    middle = np.hypot(*mesh.vertices[:, :2].T) < 60
    cosines = np.sum(mesh.vertex_normals * outwards, axis=1)[middle]
    assert np.median(cosines) > 0.95 and (cosines > 0.5).all()
    assert mesh.visual.vertex_colors.shape == (len(mesh.vertices), 4)


HEAD = {"x": "float", "y": "float", "z": "float", "red": "uchar", "green": "uchar", "blue": "uchar"}


@pytest.mark.parametrize("name", ["points.ply", "mesh.ply"])
def test_files_are_as_meshlab_cloudcompare_and_open3d_read_them(decoded, name):
    """By the names and types that their documents give, and by VTK as another reader."""
    path = decoded(mesh=True).out / name
    head, body = path.read_bytes().split(b"end_header\n", 1)
    lines = head.decode("ascii").splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    types = {line.split()[-1]: line.split()[1] for line in lines if line.startswith("property")}
    normals = dict.fromkeys(("nx", "ny", "nz"), "float")
    assert types.items() >= (HEAD if name == "points.ply" else HEAD | normals).items()
    assert name == "points.ply" or "property list uchar int vertex_indices" in lines
    pyvista = pytest.importorskip("pyvista")
    read, known = pyvista.read(path), trimesh.load(path, process=False)
    np.testing.assert_allclose(read.points, known.vertices, atol=1e-4)


def test_edges_across_a_step_are_no_triangles():
    x, y = np.meshgrid(np.arange(6.0), np.arange(5.0))
    colours = np.arange(90, dtype=np.uint8).reshape(5, 6, 3)
    mesh = surface(np.stack([x, y, 600 + 50 * (x > 2)], -1), 8.0, colours)
    assert (
        len(mesh.faces) == 2 * 2 * 4 * 2 and np.ptp(mesh.vertices[mesh.faces][..., 2], 1).max() == 0
    )
    assert mesh.visual.vertex_colors[0, :3].tolist() == [0, 1, 2]


def test_the_wrapped_phase_is_kept_everywhere_beside_the_mask(decoded):
    result = decoded()
    with np.load(result.out / "decoded.npz") as file:
        wrapped, mask, Phi = (file[f"column_{k}"] for k in ("wrapped", "mask", "Phi"))
        assert np.isfinite(wrapped).all() and wrapped.shape == (3, 120, 160)
        assert 0.05 < mask.mean() < 0.5 and np.isnan(Phi[~mask]).all()
    assert json.loads((result.out / "summary.json").read_text(encoding="utf-8"))["removed"]
