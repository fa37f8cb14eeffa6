"""Models: the list does not change, and what cannot be used says why."""

import hashlib
import os
import struct
import sys
import tracemalloc
import types

import numpy as np
import pytest
import trimesh

from fpputil.dataset import models as sources
from fpputil.dataset.models import HELD_OUT, Model, load_model, mesh_folder, parts, seeded_models
from fpputil.optics import shapes
from fpputil.optics.parts import FAMILIES

BOX = trimesh.creation.box((1, 2, 3))
TRIANGLES = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [0, 0, 1]]], "f4")


def write(path, mesh=BOX):
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".npz":
        np.savez_compressed(path, vertices=mesh.vertices, facets=mesh.faces.astype(np.int32))
    else:
        mesh.export(path)
    return path


def stl(path, triangles=TRIANGLES, faces=2):
    """A binary STL file, by the format's definition; its rest, if it promises more, is a hole."""
    record = np.zeros(
        len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("n", "<u2")]
    )
    record["corners"] = triangles
    path.write_bytes(bytes(80) + struct.pack("<I", faces) + record.tobytes())
    os.truncate(path, 84 + 50 * faces)
    return path


def listed(path):
    """A file as a model, its digest taken in another way than the library takes it."""
    return Model(path.name, "", -1, path.name, hashlib.sha256(path.read_bytes()).hexdigest())


def names(models):
    return [model.name for model in models]


@pytest.fixture
def meshes(tmp_path):
    """Five files, two of them the same bytes, and one that is no mesh."""
    for k, name in enumerate(["b.stl", "a.PLY", "gears/wheel.obj", "gears/Z.off"]):
        write(tmp_path / name.lower(), trimesh.creation.box((1, 1, 1 + k)))
        (tmp_path / name.lower()).rename(tmp_path / name)
    (tmp_path / "gears" / "again.stl").write_bytes((tmp_path / "b.stl").read_bytes())
    (tmp_path / "readme.txt").write_text("no mesh")
    return tmp_path


# Parts


def test_parts_count_up():
    models = parts(12, first=5)
    assert [model.seed for model in models] == list(range(5, 17))
    assert names(models)[0] == "part-00005"
    assert {(model.path, model.sha256) for model in models} == {("", "")}


def test_family_is_known_without_the_part():
    """The family drawn from the seed alone gives the mesh that the seed gives."""
    for model in parts(12):
        mesh, notes = load_model(model)
        assert notes == () and mesh.is_watertight
        assert np.array_equal(mesh.vertices, shapes.part(model.seed).vertices)


def test_parts_of_some_families():
    models = parts(8, ["gear", "nut"])
    every = parts(models[-1].seed + 1)
    assert models == tuple(model for model in every if model.family in ("gear", "nut"))
    assert names(parts(3, "gear")) == names(m for m in every if m.family == "gear")[:3]
    assert {model.family for model in parts(400)} == set(FAMILIES)


def test_held_out_families_are_in_no_other_split():
    models, held_out = seeded_models(200)
    assert {m.family for m in held_out} == set(HELD_OUT) and len(held_out) == 20
    assert not {m.family for m in models} & set(HELD_OUT) and len(models) == 200
    assert len({m.seed for m in (*models, *held_out)}) == 220
    other, _ = seeded_models(200, seed=1)
    assert not {m.seed for m in models} & {m.seed for m in other}


# A folder


def test_folder_lists_each_content_once_by_path(meshes):
    models, notes = mesh_folder(meshes)
    assert names(models) == ["a.PLY", "b.stl", "gears/Z.off", "gears/wheel.obj"]
    assert notes == ("gears/again.stl left out: the same bytes as b.stl",)
    for model in models:
        assert model.path == model.name
        assert model.sha256 == hashlib.sha256((meshes / model.path).read_bytes()).hexdigest()
    assert mesh_folder(str(meshes), 2) == (models[:2], ())


def test_links_and_pipes_are_left_out(meshes, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    write(elsewhere / "secret.stl", trimesh.creation.box((5, 5, 5)))
    (meshes / "loop").symlink_to(meshes)
    (meshes / "out").symlink_to(elsewhere)
    (meshes / "out.stl").symlink_to(elsewhere / "secret.stl")
    (meshes / "self.stl").symlink_to("self.stl")
    os.mkfifo(meshes / "pipe.stl")
    (meshes / "folder.stl").mkdir()
    models, notes = mesh_folder(meshes)
    assert len(models) == 4
    assert notes[1:] == ("out.stl left out: a link", "self.stl left out: a link")
    (elsewhere / "through").symlink_to(meshes)
    assert mesh_folder(elsewhere / "through") == (models, notes), "the root may be a link"


# Loading


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "glb", "npz"])
def test_load_gives_the_mesh_as_it_is(tmp_path, suffix):
    """In metres as in millimetres, wherever it lies; cut in half, it is no mesh."""
    mesh = shapes.part(3, "conrod").apply_scale(1e-3).apply_translation((1, 2, 3))
    path = write(tmp_path / f"part.{suffix}", mesh)
    read, notes = load_model(listed(path), tmp_path)
    assert notes == () and shapes.genus(read) == 2
    assert np.allclose(read.bounds, mesh.bounds, atol=3e-7), "float32 at 3 m"
    assert len(read.faces) == len(mesh.faces)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    if suffix != "obj":  # which promises nothing
        with pytest.raises(ValueError, match=rf"part\.{suffix}.*(needed|needs)"):
            load_model(listed(path), tmp_path)


def test_open_and_flat_meshes_are_used(tmp_path):
    flat = shapes.plane(500)
    read, notes = load_model(listed(write(tmp_path / "flat.ply", flat)), tmp_path)
    assert notes == ("not watertight",)
    assert np.allclose(read.bounds, flat.bounds)


def test_a_large_file_is_refused_before_it_is_read(tmp_path):
    stl(tmp_path / "huge.stl", faces=10_000_000)
    model = Model("huge.stl", "", -1, "huge.stl", "not asked for")
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match="huge.stl has 500 MB; at most 150 MB fit"):
            load_model(model, tmp_path)
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("what", ["faces", "vertices"])
def test_a_large_mesh_is_refused(tmp_path, monkeypatch, what):
    monkeypatch.setattr(sources, f"MAX_{what.upper()}", 1)
    with pytest.raises(ValueError, match=f"m.stl has [24] {what}; at most 1 fit into memory"):
        load_model(listed(stl(tmp_path / "m.stl")), tmp_path)


NAN = np.where(np.arange(18).reshape(2, 3, 3) == 4, np.nan, TRIANGLES)


@pytest.mark.parametrize(
    "triangles, words",
    [
        (NAN, "m.stl has 1 NaN or infinite vertices of 6"),
        (TRIANGLES * 0 + 7, "all its vertices in one point"),
    ],
)
def test_unfit_meshes(tmp_path, triangles, words):
    with pytest.raises(ValueError, match=words):
        load_model(listed(stl(tmp_path / "m.stl", triangles, len(triangles))), tmp_path)


def test_file_changed_or_gone(tmp_path):
    path = write(tmp_path / "m.stl")
    model = listed(path)
    write(path, trimesh.creation.box((1, 2, 4)))
    with pytest.raises(ValueError, match="m.stl has changed since it was listed"):
        load_model(model, tmp_path)
    path.unlink()
    with pytest.raises(FileNotFoundError, match="m.stl is gone"):
        load_model(model, tmp_path)


# Thingi10K, by a stand-in with the functions of its package


@pytest.fixture
def package(tmp_path, monkeypatch):
    """`init` and `dataset` of version 1.5, and a list of what `init` was asked for."""
    module = types.ModuleType("thingi10k")
    files = [write(tmp_path / f"npz/{k}.npz", shapes.part(k % 7, "nut")) for k in (100032, 99, 343)]
    module.asked = []

    def init(variant=None, cache_dir=None, force_redownload=False):
        module.asked.append((variant, cache_dir, os.environ.get("HF_HUB_OFFLINE")))

    module.init = init
    module.dataset = lambda: [{"file_id": int(f.stem), "file_path": str(f)} for f in files]
    monkeypatch.setitem(sys.modules, "thingi10k", module)
    monkeypatch.setenv("HF_HUB_OFFLINE", "")  # and back to what it was afterwards
    return module


def test_thingi10k_by_number(tmp_path, package):
    root, models, notes = sources.thingi10k(cache=tmp_path)
    assert root == tmp_path / "npz" and notes == ()
    assert names(models) == ["thingi10k-99", "thingi10k-343", "thingi10k-100032"]
    assert [model.path for model in models] == ["99.npz", "343.npz", "100032.npz"]
    for model in models:
        read, _ = load_model(model, root)
        expected = shapes.part(int(model.path[:-4]) % 7, "nut")
        assert read.volume == pytest.approx(expected.volume, rel=1e-4)
    assert sources.thingi10k(2, tmp_path) == (root, models[:2], ())


def test_thingi10k_downloads_only_when_asked(tmp_path, package, monkeypatch):
    sources.thingi10k(download=True)
    sources.thingi10k(cache=tmp_path)
    assert package.asked == [("npz", None, ""), ("npz", str(tmp_path), "1")]


def test_thingi10k_that_is_not_there(package, monkeypatch):
    def fail(**options):
        raise RuntimeError("Failed to initialize dataset:\n  no network")

    monkeypatch.setattr(package, "init", fail)
    with pytest.raises(RuntimeError, match=r"\(Failed .*: no network\); ask for the download"):
        sources.thingi10k()
    monkeypatch.setitem(sys.modules, "thingi10k", None)
    with pytest.raises(ImportError, match=r"pip install 'fpputil\[thingi10k\]'"):
        sources.thingi10k()
