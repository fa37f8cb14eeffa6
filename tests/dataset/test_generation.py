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
from fpputil.dataset import fill as fill_module
from fpputil.dataset import layout
from fpputil.dataset import models as sources
from fpputil.dataset.fill import fill
from fpputil.dataset.generation import generate, make_model, turned
from fpputil.dataset.plan import HELD_OUT, POSES, plan_of, seeded_models, split_by_model
from fpputil.dataset.store import check, open_store
from fpputil.optics.parts import part
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import place, rotation


def tree(folder: Path) -> dict[str, bytes]:
    return {
        f.relative_to(folder).as_posix(): f.read_bytes() for f in folder.rglob("*") if f.is_file()
    }


def command(out, *options):
    return [sys.executable, "-m", "fpputil.cli", "dataset", "generate", str(out), *options]


OPTIONS = ("--preset", "tiny", "--models", "10", "--held-out", "1", "--views", "2")


# What is in it


def test_a_view_is_what_the_ray_caster_sees(small_set, tiny):
    """The rig moves round a model that stays; here the model turns before a rig that stays."""
    store = open_store(small_set)
    for index in store.indices("training")[:6]:
        about, view = store.describe(index), store.view(index)
        turn = rotation(*about["pose"])
        seen = raycast(
            place(part(about["seed"], about["family"]), rotation=turn), tiny.system, albedo=0.9
        )
        both = view.mask & seen.mask
        assert (view.mask != seen.mask).sum() <= 2
        for name, within in (("column", 2e-3), ("row", 2e-3), ("depth", 2e-3), ("shade", 1e-3)):
            difference = np.abs(getattr(view, name) - getattr(seen, name))[both]
            assert np.quantile(difference, 0.99) < within, name


def test_a_turned_rig_sees_a_turned_model(tiny):
    mesh, R = part(3), rotation(40, 70)
    a = raycast(place(mesh), turned(tiny.system, R))
    b = raycast(place(mesh, rotation=R), tiny.system)
    assert (a.mask != b.mask).sum() <= 3
    assert np.nanmedian(np.abs(a.column - b.column)) < 1e-4


def test_splits_are_by_model(small_set):
    store = open_store(small_set)
    assert store.splits() == list(layout.SPLITS)
    models = {s: {i // 2 for i in store.indices(s)} for s in layout.SPLITS}
    assert [len(models[s]) for s in layout.SPLITS] == [8, 1, 1, 1]
    assert len(set.union(*models.values())) == 11


@pytest.mark.parametrize("number, sizes", [(1, (1, 0, 0)), (2, (2, 0, 0)), (3, (1, 1, 1)),
                                           (10, (8, 1, 1)), (500, (400, 50, 50))])  # fmt: skip
def test_eight_to_one_to_one(number, sizes):
    names = split_by_model(number, 0)
    assert tuple(names.count(s) for s in layout.SPLITS[:3]) == sizes
    assert number < 10 or names != split_by_model(number, 1)


def test_held_out_families_are_in_no_other_split():
    models, held_out = seeded_models(200)
    assert {m.family for m in held_out} == set(HELD_OUT) and len(held_out) == 20
    assert not {m.family for m in models} & set(HELD_OUT) and len(models) == 200
    assert len({m.seed for m in (*models, *held_out)}) == 220
    other, _ = seeded_models(200, seed=1)
    assert not {m.seed for m in models} & {m.seed for m in other}


def test_all_36_poses_or_some_of_them(tmp_path):
    assert len(set(POSES)) == 36
    models, _ = seeded_models(2, 0)
    plan = plan_of("tiny", models, (), 36, 0, 240.0)
    (tmp_path / "a").mkdir()
    record = make_model(str(tmp_path / "a"), plan, plan["models"][0], 0, None)
    assert record["pose"] == [list(pose) for pose in POSES]
    few = [
        make_model(
            str(tmp_path / "a"),
            plan_of("tiny", models, (), 3, 0, 240.0),
            plan["models"][n],
            n,
            None,
        )["pose"]
        for n in range(2)
    ]
    assert all(len({*map(tuple, p)}) == 3 for p in few) and few[0] != few[1]


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
        models, _ = sources.mesh_folder(folder)
        generate(tmp_path / f"set-{unit}", "tiny", models, root=folder, views=2)
    a, b = (open_store(tmp_path / f"set-{u}") for u in ("mm", "m"))
    np.testing.assert_allclose(a.view(0).depth, b.view(0).depth, atol=1e-3)


# Stopped and gone on with


def test_two_runs_and_any_number_of_workers_give_the_same_bytes(small_set, tmp_path):
    again = tmp_path / "again"
    generate(again, "tiny", *seeded_models(10, 1), views=2, workers=2)
    assert tree(again) == tree(small_set)


def test_a_killed_run_goes_on_to_the_same_bytes(small_set, tmp_path):
    """kill -9 again and again, at moments that differ, until a run comes to its end."""
    out, codes = tmp_path / "killed", []
    for n in range(30):
        run = subprocess.Popen(
            command(out, *OPTIONS), stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        before = len(list(out.glob("records/*"))) if out.exists() else 0
        limit = time.monotonic() + 60
        while run.poll() is None and time.monotonic() < limit:
            now = len(list(out.glob("records/*"))) if out.exists() else 0
            if now >= before + 2:
                time.sleep(0.01 * n)
                run.send_signal(signal.SIGKILL)
                break
            time.sleep(0.002)
        codes.append(run.wait())
        run.stdout.close()
        if codes[-1] == 0:
            break
    assert codes[-1] == 0 and codes.count(-signal.SIGKILL) >= 2
    assert tree(out) == tree(small_set)


def test_ctrl_c_keeps_what_is_finished(small_set, tmp_path):
    out = tmp_path / "stopped"
    run = subprocess.Popen(
        command(out, *OPTIONS, "--workers", "2"), stderr=subprocess.PIPE, text=True
    )
    while run.poll() is None and not list(out.glob("records/*.json")):
        time.sleep(0.01)
    run.send_signal(signal.SIGINT)
    _, said = run.communicate(timeout=60)
    assert run.returncode == 130 and "goes on from here" in said and "Traceback" not in said
    assert list(out.glob("records/*.json")) and not list(out.rglob("*.part"))
    with pytest.raises(ValueError, match="not finished"):
        open_store(out)
    assert subprocess.run(command(out, *OPTIONS), capture_output=True).returncode == 0
    assert tree(out) == tree(small_set)


@pytest.mark.parametrize("room", [0, 1, 7, 30, 50])
def test_a_full_disk_at_any_file(room, small_set, tmp_path, monkeypatch):
    out, written = tmp_path / "full", []
    write = files.write_whole

    def limited(path, data):
        if len(written) >= room:
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        written.append(path)
        write(path, data)

    monkeypatch.setattr(layout, "write_whole", limited)
    with pytest.raises(OSError, match="No space left"):
        generate(out, "tiny", *seeded_models(10, 1), views=2)
    monkeypatch.undo()
    generate(out, "tiny", *seeded_models(10, 1), views=2)
    assert tree(out) == tree(small_set)


def test_a_lost_or_cut_shard_is_made_again(small_set, tmp_path):
    out = tmp_path / "lost"
    shutil.copytree(small_set, out)
    (out / "column/c/3/0/0").unlink()
    (out / "shade/c/5/0/0").write_bytes(b"cut")
    assert len(check(out)) == 2
    generate(out, "tiny", *seeded_models(10, 1), views=2)
    assert tree(out) == tree(small_set)


def stop_at(moment, monkeypatch):
    """Stop a run as a kill would: when file number `moment` is about to be written."""
    write, written = files.write_whole, []

    def limited(path, data):
        if len(written) == moment:
            raise KeyboardInterrupt
        written.append(path)
        write(path, data)

    monkeypatch.setattr(layout, "write_whole", limited)


# Manifest, group, four arrays: 6 files; then 4 shards and a record a model; then the manifest.
@pytest.mark.parametrize("moment", [*range(5, 17), 20, 21])
def test_stopped_at_each_file(moment, tmp_path, monkeypatch):
    models = seeded_models(3, 0)
    expected = generate(tmp_path / "whole", "tiny", *models, views=1)
    out = tmp_path / "stopped"
    stop_at(moment, monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        generate(out, "tiny", *models, views=1)
    monkeypatch.undo()
    assert not json.loads((out / "manifest.json").read_bytes())["complete"]
    records = len(list(out.glob("records/*.json")))
    assert records == max(0, (moment - 6) // 5)
    assert generate(out, "tiny", *models, views=1) == expected
    assert tree(out) == tree(tmp_path / "whole")


def test_stopped_before_the_records_are_removed(tmp_path, monkeypatch):
    models = seeded_models(3, 0)
    generate(tmp_path / "whole", "tiny", *models, views=1)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(shutil, "rmtree", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        generate(tmp_path / "stopped", "tiny", *models, views=1)
    assert check(tmp_path / "stopped")  # the records are not part of it
    generate(tmp_path / "stopped", "tiny", *models, views=1)
    assert tree(tmp_path / "stopped") == tree(tmp_path / "whole")


@pytest.mark.parametrize("left", [b"", b'{"lit": [', b"[]", b"{}", b'{"shards": 3}'])
def test_a_cut_record_is_no_record(left, small_set, tmp_path):
    out = tmp_path / "cut"
    shutil.copytree(small_set, out)
    manifest = json.loads((out / "manifest.json").read_bytes())
    for key in ("records", "extremes", "metadata", "content", "seal"):
        del manifest[key]
    (out / "manifest.json").write_bytes(layout.dumps({**manifest, "complete": False}))
    (out / "records").mkdir()
    (out / "records/000002.json").write_bytes(left)
    generate(out, "tiny", *seeded_models(10, 1), views=2)
    assert tree(out) == tree(small_set)


def test_only_what_is_damaged_is_made_again(small_set, tmp_path, monkeypatch):
    out = tmp_path / "flipped"
    shutil.copytree(small_set, out)
    shard = bytearray((out / "column/c/3/0/0").read_bytes())
    shard[50] ^= 1
    (out / "column/c/3/0/0").write_bytes(shard)
    (out / "depth/zarr.json").unlink()
    made = []
    real = sources.load_model
    monkeypatch.setattr(
        sources, "load_model", lambda model, root: made.append(model) or real(model, root)
    )
    generate(out, "tiny", *seeded_models(10, 1), views=2)
    assert len(made) == 1 and tree(out) == tree(small_set)
    generate(out, "tiny", *seeded_models(10, 1), views=2)
    assert len(made) == 1


def test_partial_files_of_a_killed_run_go_and_others_stay(small_set, tmp_path):
    out = tmp_path / "set"
    shutil.copytree(small_set, out)
    (out / "mask/c/2/0/0").unlink()
    ours = out / "mask/c/2/0/0.123-0a1b2c3d.part"
    theirs = [out / "film.part", out / "mine/film.part", out / "column/film.part"]
    for file in (ours, *theirs):
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(b"x")
    generate(out, "tiny", *seeded_models(10, 1), views=2)
    assert not ours.exists() and all(file.exists() for file in theirs)
    (tmp_path / "films").mkdir()
    (tmp_path / "films/film.part").write_bytes(b"x")
    with pytest.raises(ValueError, match="holds something else .film.part"):
        generate(tmp_path / "films", "tiny", *seeded_models(3, 0), views=1)


def test_ctrl_c_twice_ends_at_once(tmp_path):
    out = tmp_path / "twice"
    run = subprocess.Popen(
        command(out, "--models", "60", "--workers", "2"), stderr=subprocess.PIPE, text=True
    )
    while run.poll() is None and not list(out.glob("records/*.json")):
        time.sleep(0.01)
    for _ in range(3):
        run.send_signal(signal.SIGINT)
        time.sleep(0.2)
    _, said = run.communicate(timeout=60)
    assert run.returncode in (130, -signal.SIGINT) and "Process Spawn" not in said


def test_seeds_of_noise_and_poses(small_set, tmp_path):
    records = open_store(small_set).manifest["records"]
    seeds = [s for r in records for s in r["noise_seed"]]
    assert len(set(seeds)) == len(seeds) == 22
    other = generate(tmp_path / "other", "tiny", *seeded_models(10, 1), views=2, seed=1)
    assert [r["pose"] for r in other["records"]] != [r["pose"] for r in records]
    assert not set(seeds) & {s for r in other["records"] for s in r["noise_seed"]}


def test_which_model_is_where():
    """The order of a random draw is part of the format: NumPy keeps it from version to version."""
    names = split_by_model(10, 0)
    assert (names.index("validation"), names.index("test")) == (4, 6)


def test_a_worker_that_does_not_see_the_folder_or_has_other_versions(tmp_path):
    plan = plan_of("tiny", *seeded_models(3, 0), 1, 0, 240.0)
    job = (make_model, str(tmp_path / "nowhere"), plan, plan["models"][0], 0, None)
    with pytest.raises(RuntimeError, match="does not see .*nowhere; all workers must"):
        fill_module._one_model(*job)
    assert not (tmp_path / "nowhere").exists()
    layout.put(tmp_path, {layout.MANIFEST: layout.dumps(plan)})
    older = {**plan, "versions": {**plan["versions"], "numpy": "0.9"}}
    with pytest.raises(RuntimeError, match="other versions of numpy than the dataset"):
        fill_module._one_model(make_model, str(tmp_path), older, plan["models"][0], 0, None)


# Refused


def test_out_that_holds_something_else(small_set, tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(ValueError, match="holds something else .thesis.tex"):
        generate(tmp_path, "tiny", *seeded_models(3, 0), views=1)
    assert (tmp_path / "thesis.tex").read_text() == "precious" and len(
        list(tmp_path.iterdir())
    ) == 1
    with pytest.raises(ValueError, match="is no folder"):
        generate(tmp_path / "thesis.tex", "tiny", *seeded_models(3, 0), views=1)
    with pytest.raises(ValueError, match="does not exist"):
        generate(tmp_path / "no" / "where", "tiny", *seeded_models(3, 0), views=1)


@pytest.mark.parametrize(
    "change, said",
    [({"views": 3}, "views is 2 there and 3 here"), ({"seed": 1}, "seed is 0 there and 1 here"),
     ({"size": 200.0}, "size is 240.0 there and 200.0 here")],
)  # fmt: skip
def test_another_dataset_in_out(change, said, small_set):
    before = tree(small_set)
    with pytest.raises(ValueError, match=f"holds another dataset: .*{said}"):
        generate(small_set, "tiny", *seeded_models(10, 1), **{"views": 2, **change})
    assert tree(small_set) == before


def test_other_models_or_versions_in_out(small_set, tmp_path):
    with pytest.raises(ValueError, match="holds another dataset: its models differ"):
        generate(small_set, "tiny", *seeded_models(10, 1, seed=1), views=2)
    out = tmp_path / "older"
    plan = plan_of("tiny", *seeded_models(3, 0), 1, 0, 240.0)
    plan["versions"]["numpy"] = "0.9"
    out.mkdir()
    layout.put(out, {layout.MANIFEST: layout.dumps(plan)})
    with pytest.raises(ValueError, match="versions numpy is 0.9 there and"):
        generate(out, "tiny", *seeded_models(3, 0), views=1)


def test_two_generators_on_one_out(tmp_path):
    out = tmp_path / "shared"
    first = subprocess.Popen(
        command(out, "--models", "60"), stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        while not list(out.glob("records/*.json")):
            assert first.poll() is None
            time.sleep(0.02)
        second = subprocess.run(command(out, "--models", "60"), capture_output=True, text=True)
    finally:
        first.kill()
        first.communicate()
    assert second.returncode == 1
    assert second.stderr.strip().endswith(f"another process is generating into {out}; wait for it")


@pytest.mark.parametrize(
    "options, said",
    [
        ({"views": 0}, "views 0 given"),
        ({"views": 37}, "37 views given; the paper turns each model into 36"),
        ({"size": 320.0}, "size 320.0 mm given; a ball of more than 285 mm does not fit"),
        ({"size": -1.0}, "size -1.0 given"),
        ({"workers": 0}, "workers 0 given"),
        ({"seed": -1}, "seed -1 given"),
    ],
)
def test_options_out_of_range(options, said, tmp_path):
    with pytest.raises(ValueError, match=said):
        generate(tmp_path / "x", "tiny", *seeded_models(3, 0), **{"views": 1, **options})


def test_presets_and_models_that_are_not_there(tmp_path):
    with pytest.raises(ValueError, match="preset 'huge' given"):
        generate(tmp_path / "x", "huge", *seeded_models(3, 0))
    with pytest.raises(ValueError, match="no model given"):
        generate(tmp_path / "x", "tiny", ())
    with pytest.raises(ValueError, match="part-.*given twice"):
        generate(tmp_path / "x", "tiny", seeded_models(1, 0)[0] * 2)


# Skipped, and said so


def sheet(z_up: bool):
    """A single triangle-thin sheet, which only one side of shows."""
    return trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2) if z_up else (0, 2, 1)])


def test_bad_models_are_skipped_and_recorded(tmp_path):
    folder = tmp_path / "meshes"
    folder.mkdir()
    for n in range(3):
        part(n).export(folder / f"good{n}.stl")
    sheet(True).export(folder / "open.ply")
    (folder / "empty.off").write_text("OFF\n0 0 0\n")
    (folder / "nan.obj").write_text("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")
    whole = (folder / "good0.stl").read_bytes()
    (folder / "cut.stl").write_bytes(whole[: len(whole) // 2])
    with open(folder / "huge.stl", "wb") as huge:  # ten million faces, all of them zero
        huge.write(bytes(80) + (10_000_000).to_bytes(4, "little"))
        huge.truncate(84 + 50 * 10_000_000)
    models, _ = sources.mesh_folder(folder)
    manifest = generate(tmp_path / "set", "tiny", models, root=folder, views=36)
    records = {m["name"]: r for m, r in zip(manifest["models"], manifest["records"], strict=True)}
    skipped = {n: r["skipped"] for n, r in records.items() if "skipped" in r}
    assert set(skipped) == {"empty.off", "nan.obj", "cut.stl", "huge.stl"}
    assert skipped["huge.stl"].startswith("huge.stl has 500 MB; at most 150 MB")
    assert str(tmp_path) not in json.dumps(manifest)
    assert any("watertight" in n for n in records["open.ply"]["notes"])
    lit = records["open.ply"]["lit"]
    assert 0 in lit and max(lit) > 100  # from behind it shows nothing
    store = open_store(tmp_path / "set")
    used = {store.describe(i)["name"] for s in store.splits() for i in store.indices(s)}
    assert used <= {"good0.stl", "good1.stl", "good2.stl", "open.ply"}
    assert check(tmp_path / "set") == []


def test_nothing_usable_is_an_error(tmp_path):
    folder = tmp_path / "meshes"
    folder.mkdir()
    (folder / "empty.off").write_text("OFF\n0 0 0\n")
    models, _ = sources.mesh_folder(folder)
    with pytest.raises(
        ValueError, match="no training model .* could be used; the first: empty.off"
    ):
        generate(tmp_path / "set", "tiny", models, root=folder)


def test_a_worker_that_dies_is_told_of(tmp_path):
    plan = plan_of("tiny", *seeded_models(4, 0), 1, 0, 240.0)
    with pytest.raises(RuntimeError, match="ended from outside"):
        fill(tmp_path / "set", plan, _dies, workers=2)


def _dies(*job):
    os.kill(os.getpid(), signal.SIGKILL)


def test_workers_end_with_their_parent(tmp_path):
    """Killed outright, a run leaves no process behind that goes on writing."""
    out = tmp_path / "set"
    run = subprocess.Popen(command(out, "--models", "60", "--workers", "2"))
    try:
        while not list(out.glob("records/*.json")):
            assert run.poll() is None
            time.sleep(0.02)
        workers = psutil.Process(run.pid).children(recursive=True)
        assert len(workers) >= 2
    finally:
        run.kill()
        run.wait()
    _, alive = psutil.wait_procs(workers, timeout=20)
    assert not [p for p in alive if p.status() != psutil.STATUS_ZOMBIE]
