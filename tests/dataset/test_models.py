"""Models: the list does not change, and what cannot be used says why."""

import builtins
import hashlib
import json
import os
import struct
import sys
import tracemalloc
import types
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from fpputil.dataset import listing
from fpputil.dataset import models as sources
from fpputil.dataset.models import Model
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


def stl(path, faces=2, triangles=TRIANGLES):
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
    models = sources.parts(12, first=5)
    assert [model.seed for model in models] == list(range(5, 17))
    assert names(models)[0] == "part-00005"
    assert {(model.path, model.sha256) for model in models} == {("", "")}
    assert sources.parts(12, first=5) == models


def test_family_is_known_without_the_part():
    """The family drawn from the seed alone gives the mesh that the seed gives."""
    for model in sources.parts(12):
        mesh, notes = sources.load_model(model)
        assert notes == () and mesh.is_watertight
        assert np.array_equal(mesh.vertices, shapes.part(model.seed).vertices)


def test_parts_of_some_families():
    models = sources.parts(8, ["gear", "nut"])
    every = sources.parts(models[-1].seed + 1)
    assert models == tuple(model for model in every if model.family in ("gear", "nut"))
    assert names(sources.parts(3, "gear")) == names(m for m in every if m.family == "gear")[:3]
    assert {model.family for model in sources.parts(400)} == set(FAMILIES)


@pytest.mark.parametrize(
    "arguments, given",
    [
        ({"number": 0}, "number 0 given; a whole number of 1 or more"),
        ({"number": 2.5}, "number 2.5 given"),
        ({"number": 1, "first": -1}, "first -1 given; a whole number of 0 or more"),
        ({"number": 1, "families": ["gear", "teapot"]}, "'teapot' given; the families are bracket"),
        ({"number": 1, "families": []}, "no family given; the families are"),
    ],
)
def test_unfit_parts(arguments, given):
    with pytest.raises(ValueError, match=given):
        sources.parts(**arguments)


# A folder


def test_folder_lists_each_content_once_by_path(meshes):
    models, notes = sources.mesh_folder(meshes)
    assert names(models) == ["a.PLY", "b.stl", "gears/Z.off", "gears/wheel.obj"]
    assert notes == ("gears/again.stl left out: the same bytes as b.stl",)
    for model in models:
        assert model == replace(listed(meshes / model.path), name=model.path, path=model.path)
    assert sources.mesh_folder(str(meshes)) == (models, notes)


def test_first_of_a_folder(meshes):
    every, _ = sources.mesh_folder(meshes)
    assert sources.mesh_folder(meshes, 2) == (every[:2], ())
    assert sources.mesh_folder(meshes, 4)[0] == every


@pytest.mark.parametrize(
    "number, given",
    [
        (0, "number 0 given; a whole number of 1 or more"),
        (5, r"number 5 given; .* holds 4 different models \(1 not taken; gears/again.stl left out"),
    ],
)
def test_number_out_of_range(meshes, number, given):
    with pytest.raises(ValueError, match=given):
        sources.mesh_folder(meshes, number)


def test_no_folder(meshes):
    with pytest.raises(FileNotFoundError, match="none does not exist; a folder of mesh files"):
        sources.mesh_folder(meshes / "none")
    with pytest.raises(NotADirectoryError, match="b.stl is a file; the folder that holds it"):
        sources.mesh_folder(meshes / "b.stl")


def test_folder_without_meshes(tmp_path):
    (tmp_path / "readme.txt").write_text("no mesh")
    with pytest.raises(ValueError, match="holds no mesh files; glb, gltf, npz, obj, off, ply, stl"):
        sources.mesh_folder(tmp_path)


def test_links_are_not_followed(meshes, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    write(elsewhere / "secret.stl", trimesh.creation.box((5, 5, 5)))
    (meshes / "loop").symlink_to(meshes)
    (meshes / "out").symlink_to(elsewhere)
    (meshes / "out.stl").symlink_to(elsewhere / "secret.stl")
    (meshes / "self.stl").symlink_to("self.stl")
    (meshes / "readme.link").symlink_to("readme.txt")
    models, notes = sources.mesh_folder(meshes)
    assert len(models) == 4
    links = [f"{name} left out: a link" for name in ("loop", "out", "out.stl", "self.stl")]
    assert list(notes[:4]) == links
    (elsewhere / "through").symlink_to(meshes)
    assert sources.mesh_folder(elsewhere / "through") == (models, notes), "the root may be a link"


def test_pipes_and_folders_named_like_meshes(meshes):
    os.mkfifo(meshes / "pipe.stl")
    (meshes / "folder.stl").mkdir()
    assert len(sources.mesh_folder(meshes)[0]) == 4


@pytest.mark.skipif(sys.platform != "linux", reason="names are bytes on Linux alone")
def test_name_that_is_no_text(meshes):
    os.rename(os.fsencode(meshes / "b.stl"), os.fsencode(meshes) + b"/b\xff.stl")
    models, notes = sources.mesh_folder(meshes)
    assert names(models) == ["a.PLY", "gears/Z.off", "gears/again.stl", "gears/wheel.obj"]
    assert notes == (r"b\udcff.stl left out: its name is not UTF-8",)
    json.dumps(notes, ensure_ascii=False).encode()


def test_file_that_may_not_be_read(meshes, monkeypatch):
    def refuse(path):
        if path.name == "b.stl":
            raise PermissionError(13, "Permission denied")
        return hashlib.sha256(path.read_bytes()).hexdigest()

    model = listed(meshes / "b.stl")
    monkeypatch.setattr(listing, "digest", refuse)
    monkeypatch.setattr(sources, "digest", refuse)
    models, notes = sources.mesh_folder(meshes)
    assert "b.stl" not in names(models) and "gears/again.stl" in names(models)
    assert notes == ("b.stl left out: Permission denied",)
    with pytest.raises(ValueError, match=r"b.stl cannot be read \(Permission denied\)"):
        sources.load_model(model, meshes)


# Loading


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "glb", "npz"])
def test_load_gives_the_mesh_as_it_is(tmp_path, suffix):
    """In metres as in millimetres, wherever it lies."""
    mesh = shapes.part(3, "conrod").apply_scale(1e-3).apply_translation((1, 2, 3))
    read, notes = sources.load_model(listed(write(tmp_path / f"part.{suffix}", mesh)), tmp_path)
    assert notes == () and shapes.genus(read) == 2
    assert np.allclose(read.bounds, mesh.bounds, atol=3e-7), "float32 at 3 m"
    assert len(read.faces) == len(mesh.faces)


def test_open_and_flat_meshes_are_used(tmp_path):
    flat = shapes.plane(500)
    read, notes = sources.load_model(listed(write(tmp_path / "flat.ply", flat)), tmp_path)
    assert notes == ("not watertight",)
    assert np.allclose(read.bounds, flat.bounds)


NAN = np.where(np.arange(18).reshape(2, 3, 3) == 4, np.nan, TRIANGLES)


@pytest.mark.parametrize(
    "make, given",
    [
        (lambda p: stl(p / "m.stl", 0, TRIANGLES[:0]), "m.stl has no faces"),
        (lambda p: stl(p / "m.stl", 2, NAN), "m.stl has 1 NaN or infinite vertices of 6"),
        (lambda p: stl(p / "m.stl", 2, TRIANGLES * 0 + 7), "all its vertices in one point"),
    ],
)
def test_unfit_stl(tmp_path, make, given):
    path = make(tmp_path)
    with pytest.raises(ValueError, match=given):
        sources.load_model(listed(path), tmp_path)


@pytest.mark.parametrize("suffix", ["stl", "ply", "off", "glb", "npz"])
@pytest.mark.parametrize("kept", [0.0, 0.5, 0.95])
def test_truncated_file(tmp_path, suffix, kept):
    path = write(tmp_path / f"half.{suffix}")
    path.write_bytes(path.read_bytes()[: int(kept * path.stat().st_size)])
    with pytest.raises(ValueError, match=rf"half\.{suffix}.*(needed|needs)"):
        sources.load_model(listed(path), tmp_path)


@pytest.mark.parametrize(
    "name, text, given",
    [
        ("m.obj", "v 0 0 0\nv 1 0 0\n", "m.obj has no faces"),
        ("m.obj", "", "m.obj"),
    ],
)
def test_unfit_text(tmp_path, name, text, given):
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=given):
        sources.load_model(listed(tmp_path / name), tmp_path)


@pytest.mark.parametrize(
    "name, faces, given",
    [
        ("huge.stl", 10_000_000, "huge.stl has 500 MB; at most 150 MB fit"),
        ("huge.obj", 10_000_000, "huge.obj has 500 MB; at most 150 MB fit"),
    ],
)
def test_too_many_faces_are_refused_before_they_are_read(tmp_path, name, faces, given):
    stl(tmp_path / name, faces)
    model = Model(name, "", -1, name, "not asked for")
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=given):
            sources.load_model(model, tmp_path)
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


def test_polygons_that_a_header_counts_once(tmp_path, monkeypatch):
    """The triangles are counted again when they are known."""
    monkeypatch.setattr(sources, "MAX_FACES", 1)
    square = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    square += "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
    (tmp_path / "m.ply").write_text(f"{square}end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    with pytest.raises(ValueError, match="m.ply has 2 faces; at most 1 fit"):
        sources.load_model(listed(tmp_path / "m.ply"), tmp_path)


def test_file_changed_gone_or_elsewhere(tmp_path):
    path = write(tmp_path / "set" / "m.stl")
    model = listed(path)
    sources.load_model(model, path.parent)
    write(path, trimesh.creation.box((1, 2, 4)))
    with pytest.raises(ValueError, match="m.stl has changed since it was listed"):
        sources.load_model(model, path.parent)
    with pytest.raises(ValueError, match="a file below .*set is needed"):
        write(tmp_path / "m.stl")
        sources.load_model(replace(model, path="../m.stl"), path.parent)
    with pytest.raises(ValueError, match="the folder it was listed from is needed"):
        sources.load_model(model)
    path.unlink()
    with pytest.raises(FileNotFoundError, match="m.stl is gone"):
        sources.load_model(model, path.parent)
    path.symlink_to(path)
    with pytest.raises(FileNotFoundError, match="m.stl is gone"):
        sources.load_model(model, path.parent)


# Thingi10K, in the layout of the cache of its package


LAYOUT = {"npz": "npz", "raw": "Thingi10K/raw_meshes"}


def fill(cache, variant, files, complete=True):
    top = cache / f"thingi10k_{variant}_extracted"
    for k, name in enumerate(files):
        write(top / LAYOUT[variant] / name, shapes.part(k, "nut"))
    if complete:
        (top / ".complete").write_text("unknown")
    return top / LAYOUT[variant]


FILES = {
    "npz": ["100032.npz", "99.npz", "34783.npz", "49911.npz"],
    "raw": ["100032.stl", "99.obj", "34783.ply", "49911.stl"],
}


@pytest.fixture
def without_package(monkeypatch):
    """Neither the package nor a network: any import of it fails."""
    real = builtins.__import__

    def importing(name, *rest, **more):
        if name.partition(".")[0] in ("thingi10k", "datasets", "huggingface_hub"):
            raise ModuleNotFoundError(f"No module named {name!r}")
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", importing)


@pytest.mark.parametrize("variant", FILES)
def test_thingi10k_by_number(tmp_path, without_package, variant):
    folder = fill(tmp_path, variant, FILES[variant])
    (folder / "notes.txt").write_text("no model")
    root, models, notes = sources.thingi10k(cache=tmp_path)
    assert root == folder and notes == ()
    assert names(models) == ["thingi10k-99", "thingi10k-34783", "thingi10k-100032"]
    assert [model.path for model in models] == [FILES[variant][k] for k in (1, 2, 0)]
    for model, seed in zip(models, (1, 2, 0), strict=True):
        read, notes = sources.load_model(model, root)
        assert read.volume == pytest.approx(shapes.part(seed, "nut").volume, rel=1e-4)
    assert sources.thingi10k(2, tmp_path, download=True) == (root, models[:2], ())
    with pytest.raises(ValueError, match="number 4 given; .* holds 3 different models"):
        sources.thingi10k(4, tmp_path)


def test_npz_goes_before_raw(tmp_path):
    fill(tmp_path, "raw", FILES["raw"])
    assert sources.thingi10k(cache=tmp_path)[0].name == "raw_meshes"
    fill(tmp_path, "npz", FILES["npz"])
    assert sources.thingi10k(cache=tmp_path)[0].name == "npz"


def test_npz_without_pickles(tmp_path):
    path = tmp_path / "1.npz"
    np.savez(path, vertices=np.array([{"a": 1}] * 3, object), facets=np.zeros((1, 3), int))
    with pytest.raises(ValueError, match="1.npz cannot be read .*allow_pickle"):
        sources.load_model(listed(path), tmp_path)


def test_cache_that_is_not_complete(tmp_path, without_package):
    fill(tmp_path, "npz", FILES["npz"], complete=False)
    with pytest.raises(FileNotFoundError, match="does not hold Thingi10K; `pip install.*download"):
        sources.thingi10k(cache=tmp_path)
    with pytest.raises(ImportError, match=r"`pip install 'fpputil\[thingi10k\]'`"):
        sources.thingi10k(cache=tmp_path, download=True)


@pytest.mark.parametrize(
    "variables, cache",
    [
        ({}, "home/.cache/huggingface/datasets"),
        ({"XDG_CACHE_HOME": "x"}, "x/huggingface/datasets"),
        ({"XDG_CACHE_HOME": "x", "HF_HOME": "y"}, "y/datasets"),
        ({"HF_HOME": "y", "HF_DATASETS_CACHE": "z"}, "z"),
    ],
)
def test_default_cache_is_that_of_the_package(tmp_path, monkeypatch, variables, cache):
    for name in ("XDG_CACHE_HOME", "HF_HOME", "HF_DATASETS_CACHE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for name, folder in variables.items():
        monkeypatch.setenv(name, str(tmp_path / folder))
    fill(tmp_path / cache, "npz", FILES["npz"])
    assert sources.thingi10k()[0] == tmp_path / cache / "thingi10k_npz_extracted" / "npz"


def package(init):
    """A stand-in for the package: `init` with the signature of version 1.5.0."""
    module = types.ModuleType("thingi10k")
    module.init = init
    return module


def test_download_through_the_package(tmp_path, monkeypatch):
    asked = []

    def init(variant=None, cache_dir=None, force_redownload=False):
        asked.append((variant, cache_dir, force_redownload))
        fill(tmp_path, "npz", FILES["npz"])

    monkeypatch.setitem(sys.modules, "thingi10k", package(init))
    with pytest.raises(FileNotFoundError):
        sources.thingi10k(cache=tmp_path)
    assert asked == [], "never without being asked"
    for _ in range(2):
        assert len(sources.thingi10k(cache=tmp_path, download=True)[1]) == 3
    assert asked == [("npz", str(tmp_path), False)], "once"


@pytest.mark.parametrize("after", [False, True])
def test_download_that_fails(tmp_path, monkeypatch, after):
    """The package fetches its tables after the files; these alone are enough."""

    def init(variant=None, cache_dir=None, force_redownload=False):
        fill(tmp_path, "npz", FILES["npz"], complete=after)
        raise RuntimeError("Failed to initialize dataset:\n  no network")

    monkeypatch.setitem(sys.modules, "thingi10k", package(init))
    if after:
        assert len(sources.thingi10k(cache=tmp_path, download=True)[1]) == 3
        return
    with pytest.raises(RuntimeError, match=r"downloaded \(Failed .*: no network\); a connection"):
        sources.thingi10k(cache=tmp_path, download=True)
