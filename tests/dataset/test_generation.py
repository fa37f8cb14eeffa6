"""Making a dataset: what is in it, and what survives being stopped."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
import trimesh

from fpputil import files
from fpputil.dataset import generation, layout
from fpputil.dataset.generation import POSES, fill, generate, plan_of, split_by_model
from fpputil.dataset.models import mesh_folder, seeded_models
from fpputil.dataset.store import check_files, open_store
from fpputil.optics.parts import part
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import place, rotation


def tree(folder: Path) -> dict[str, bytes]:
    return {
        f.relative_to(folder).as_posix(): f.read_bytes() for f in folder.rglob("*") if f.is_file()
    }


OPTIONS = ("--preset", "tiny", "--models", "10", "--held-out", "1", "--views", "2")


def start(out, *options, **pipes):
    """The command that makes the dataset, and wait for its first record."""
    call = [sys.executable, "-m", "fpputil.cli", "dataset", "generate", str(out), *options]
    run = subprocess.Popen(call, text=True, **pipes)
    while not list(out.glob("records/*.json")):
        assert run.poll() is None
        time.sleep(0.01)
    return run


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    """Three models, one view each."""
    out = tmp_path_factory.mktemp("three") / "set"
    generate(out, "tiny", *seeded_models(3, 0), views=1)
    return out


# What is in it


def test_a_view_is_what_the_ray_caster_sees(small_set, tiny):
    """The rig moves round a model that stays; here the model turns before a rig that stays."""
    store = open_store(small_set)
    for index in store.indices("training")[:6]:
        model, view = store.describe(index), store.view(index)
        solid = place(part(model["seed"], model["family"]), rotation=rotation(*model["pose"]))
        expected = raycast(solid, tiny.system, albedo=0.9)
        both = view.mask & expected.mask
        assert (view.mask != expected.mask).sum() <= 2
        for name, within in (("column", 2e-3), ("row", 2e-3), ("depth", 2e-3), ("shade", 1e-3)):
            difference = np.abs(getattr(view, name) - getattr(expected, name))[both]
            assert np.quantile(difference, 0.99) < within, name


def test_splits_are_by_model(small_set):
    store = open_store(small_set)
    assert store.splits() == list(layout.SPLITS)
    models = {s: {i // 2 for i in store.indices(s)} for s in layout.SPLITS}
    assert [len(models[s]) for s in layout.SPLITS] == [8, 1, 1, 1]
    assert len(set.union(*models.values())) == 11


def test_eight_to_one_to_one():
    """The order of a random draw is part of the format: NumPy keeps it from version to version."""
    for number, sizes in ((1, [1, 0, 0]), (2, [2, 0, 0]), (3, [1, 1, 1]), (500, [400, 50, 50])):
        splits = split_by_model(number, 0)
        assert [splits.count(s) for s in layout.SPLITS[:3]] == sizes
    splits = split_by_model(10, 0)
    assert (splits.index("validation"), splits.index("test")) == (4, 6)
    assert splits != split_by_model(10, 1)


def test_poses_and_seeds_of_noise():
    """All 36 poses or some of them; no two views share a seed."""
    settings = {"seed": 0, "views": 36}
    assert len(set(POSES)) == 36
    assert generation.poses_of(settings, 0)["pose"] == [list(pose) for pose in POSES]
    some = [generation.poses_of({"seed": s, "views": 3}, n) for s in range(2) for n in range(2)]
    assert all(len({*map(tuple, s["pose"])}) == 3 for s in some)
    assert len({str(s["pose"]) for s in some}) == 4
    assert len({seed for s in some for seed in s["noise_seed"]}) == 12


def test_extremes_come_from_training_alone(small_set):
    store = open_store(small_set)
    brightest = {
        s: max(store.view(i).plain().max() for i in store.indices(s)) for s in store.splits()
    }
    assert store.manifest["extremes"] == [0, brightest["training"]]


def test_models_in_metres_give_the_same_views(tmp_path):
    """A model is scaled to one size, so its unit does not matter."""
    for unit, scale in (("mm", 1), ("m", 2**-10)):  # a power of two scales without rounding
        folder = tmp_path / unit
        folder.mkdir()
        mesh = part(5)
        mesh.vertices *= scale
        mesh.export(folder / "part.ply")
        models, _ = mesh_folder(folder)
        generate(tmp_path / f"set-{unit}", "tiny", models, root=folder, views=2)
    a, b = (open_store(tmp_path / f"set-{u}") for u in ("mm", "m"))
    np.testing.assert_allclose(a.view(0).depth, b.view(0).depth, atol=1e-3)


@pytest.mark.parametrize(
    "preset_name, models, name",
    [
        ("tiny", (1000, 60), "1f6d2d47cdca0ae39002d2984832805715468b7017ee424ab7538b2a5e729e57"),
        ("small", (500, 30), "0ad3dcb0b1036030fac457dd0e4e5048efac551c691fe0ec555a27598e9e6c55"),
    ],
)
def test_the_name_of_a_dataset_does_not_change(preset_name, models, name):
    """Stored results name by it the data that their networks were trained on."""
    plan = plan_of(preset_name, *seeded_models(*models, 1), 18, 1, 240.0)
    assert layout.plan_name(plan) == name


# Skipped, and said so


def test_bad_models_are_skipped_and_recorded(tmp_path):
    folder = tmp_path / "meshes"
    folder.mkdir()
    for n in range(3):
        part(n).export(folder / f"good{n}.stl")
    # A sheet that shows only one of its sides.
    sheet = trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    sheet.export(folder / "open.ply")
    (folder / "empty.off").write_text("OFF\n0 0 0\n")
    (folder / "nan.obj").write_text("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")
    data = (folder / "good0.stl").read_bytes()
    (folder / "cut.stl").write_bytes(data[: len(data) // 2])
    models, _ = mesh_folder(folder)
    manifest = generate(tmp_path / "set", "tiny", models, root=folder, views=36)
    records = {m["name"]: r for m, r in zip(manifest["models"], manifest["records"], strict=True)}
    skipped = {n: r["skipped"] for n, r in records.items() if "skipped" in r}
    assert set(skipped) == {"empty.off", "nan.obj", "cut.stl"}
    assert skipped["empty.off"].startswith("empty.off has no faces")
    assert str(tmp_path) not in json.dumps(manifest)
    assert any("watertight" in n for n in records["open.ply"]["notes"])
    lit = records["open.ply"]["lit"]
    assert 0 in lit and max(lit) > 100  # from behind it shows nothing
    store = open_store(tmp_path / "set")
    used = {store.describe(i)["name"] for s in store.splits() for i in store.indices(s)}
    assert used <= {"good0.stl", "good1.stl", "good2.stl", "open.ply"}
    assert check_files(tmp_path / "set") == []


# Stopped and gone on with


def stop_at(moment, monkeypatch, error):
    """Stop a run like a kill or a full disk, when file number `moment` is about to be written."""
    write, written = files.write_whole, []

    def limited(path, data):
        if len(written) == moment:
            raise error
        written.append(path)
        write(path, data)

    monkeypatch.setattr(layout, "write_whole", limited)


# Manifest, group, four arrays: 6 files; then 4 shards and a record a model; then the manifest.
@pytest.mark.parametrize("moment, records", [(9, 0), (13, 1), (21, 3)])
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(errno.ENOSPC, "No space left")])
def test_stopped_between_two_files(moment, records, error, three, tmp_path, monkeypatch):
    """Before the first record, between two, before the manifest."""
    out = tmp_path / "stopped"
    stop_at(moment, monkeypatch, error)
    with pytest.raises((KeyboardInterrupt, OSError)):
        generate(out, "tiny", *seeded_models(3, 0), views=1)
    monkeypatch.undo()
    assert not json.loads((out / "manifest.json").read_bytes())["complete"]
    assert len(list(out.glob("records/*.json"))) == records
    generate(out, "tiny", *seeded_models(3, 0), views=1)
    assert tree(out) == tree(three)


def test_stopped_before_the_records_are_removed(three, tmp_path, monkeypatch):
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(shutil, "rmtree", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt))
        generate(tmp_path / "stopped", "tiny", *seeded_models(3, 0), views=1)
    assert check_files(tmp_path / "stopped")  # the records are not part of it
    generate(tmp_path / "stopped", "tiny", *seeded_models(3, 0), views=1)
    assert tree(tmp_path / "stopped") == tree(three)


@pytest.mark.parametrize("left", [b"", b'{"lit": [', b"[]", b"{}", b'{"shards": 3}'])
def test_a_cut_record_is_no_record(left, three, tmp_path):
    out = tmp_path / "cut"
    shutil.copytree(three, out)
    manifest = json.loads((out / "manifest.json").read_bytes())
    for key in ("records", "extremes", "content"):
        del manifest[key]
    (out / "manifest.json").write_bytes(layout.dumps({**manifest, "complete": False}))
    (out / "records").mkdir()
    (out / "records/000002.json").write_bytes(left)
    generate(out, "tiny", *seeded_models(3, 0), views=1)
    assert tree(out) == tree(three)


def test_only_what_is_damaged_is_made_again(small_set, tmp_path, monkeypatch):
    out = tmp_path / "flipped"
    shutil.copytree(small_set, out)
    shard = bytearray((out / "column/c/3/0/0").read_bytes())
    shard[50] ^= 1
    (out / "column/c/3/0/0").write_bytes(shard)
    (out / "shade/c/5/0/0").unlink()
    (out / "depth/zarr.json").unlink()
    (out / "mask/c/2/0/0.123-0a1b2c3d.part").write_bytes(b"of a run that was killed")
    manifest = (out / "manifest.json").read_text()
    seed = str(json.loads(manifest)["records"][7]["noise_seed"][0])
    (out / "manifest.json").write_text(manifest.replace(seed, seed[::-1].lstrip("0")))
    made, load = [], generation.load_model
    monkeypatch.setattr(generation, "load_model", lambda *a: made.append(a) or load(*a))
    for _ in range(2):
        generate(out, "tiny", *seeded_models(10, 1), views=2)
        assert len(made) == 3 and tree(out) == tree(small_set)


@pytest.mark.slow
def test_any_number_of_workers_gives_the_same_bytes(small_set, tmp_path):
    generate(tmp_path / "again", "tiny", *seeded_models(10, 1), views=2, workers=2)
    assert tree(tmp_path / "again") == tree(small_set)


def test_what_a_lost_worker_was_writing_is_removed(tmp_path):
    """A cluster gives its model to another worker; the half-written file belongs to nobody."""
    out, plan = tmp_path / "set", plan_of("tiny", *seeded_models(3, 0), 1, 0, 240.0)

    def lost_half_way(*job):
        (out / "mask.123-0a1b2c3d.part").write_bytes(b"half")
        return generation.see_model(*job)

    fill(out, plan, lost_half_way)
    assert not list(out.rglob("*.part"))


@pytest.mark.slow
def test_a_killed_run_goes_on_to_the_same_bytes(small_set, tmp_path):
    """kill -9 again and again, at moments that differ, until a run comes to its end."""
    out, codes = tmp_path / "killed", []
    for n in range(30):
        before = len(list(out.glob("records/*")))
        run = start(out, *OPTIONS, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while run.poll() is None and len(list(out.glob("records/*"))) < before + 2:
            time.sleep(0.002)
        time.sleep(0.01 * n)
        run.kill()
        codes.append(run.wait())
        done = "records" in json.loads((out / "manifest.json").read_text())
        kept = 10 if done else len(list(out.glob("records/*")))
        assert done if codes[-1] == 0 else kept > before
        if kept >= 9:
            break
    assert codes.count(-signal.SIGKILL) >= 2
    generate(out, "tiny", *seeded_models(10, 1), views=2)
    assert tree(out) == tree(small_set)


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, 3])
def test_ctrl_c_ends_soon_leaves_no_worker_and_the_same_command_goes_on(times, small_set, tmp_path):
    """As a terminal sends it: to every process at once."""
    out = tmp_path / "stopped"
    pipes = {"stderr": subprocess.PIPE, "start_new_session": True}
    run = start(out, *OPTIONS, "--workers", "2", **pipes)
    workers = psutil.Process(run.pid).children(recursive=True)
    for _ in range(times):
        os.killpg(run.pid, signal.SIGINT)
        time.sleep(0.1)
    _, said = run.communicate(timeout=10)
    assert run.returncode in (130, -signal.SIGINT) and "Process Spawn" not in said
    assert times > 1 or ("goes on from here" in said and "Traceback" not in said)
    _, alive = psutil.wait_procs(workers, timeout=5)
    assert not [p for p in alive if p.status() != psutil.STATUS_ZOMBIE]
    assert list(out.glob("records/*.json")) and not list(out.rglob("*.part"))
    generate(out, "tiny", *seeded_models(10, 1), views=2)
    assert tree(out) == tree(small_set)


@pytest.mark.slow
def test_two_generators_on_one_out(tmp_path):
    out = tmp_path / "shared"
    first = start(out, "--models", "60", stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with pytest.raises(RuntimeError, match="another process is generating into .*; wait"):
            generate(out, "tiny", *seeded_models(60))
    finally:
        first.kill()
        first.wait()


@pytest.mark.slow
def test_a_worker_that_dies_is_told_of(tmp_path):
    plan = plan_of("tiny", *seeded_models(4, 0), 1, 0, 240.0)
    with pytest.raises(RuntimeError, match="ended from outside .*the same command goes on"):
        fill(tmp_path / "set", plan, _dies, workers=2)


def _dies(*job):
    os.kill(os.getpid(), signal.SIGKILL)
