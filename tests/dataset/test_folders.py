"""Datasets as folders of PNG files, there and back."""

import json
import shutil

import cv2
import numpy as np
import pytest
import torch

from fpputil import files
from fpputil.dataset import folders, layout
from fpputil.dataset.augmentation import Augmentation
from fpputil.dataset.folders import export_folder, import_folder
from fpputil.dataset.store import check_files, open_store
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.optics.fringes import Fringe


@pytest.fixture(scope="module")
def exported(small_set, tmp_path_factory):
    folder = tmp_path_factory.mktemp("png") / "scenes"
    assert export_folder(small_set, folder, "test") == 2
    return folder


@pytest.fixture
def scenes(exported, tmp_path):
    return shutil.copytree(exported, tmp_path / "scenes")


def test_what_an_export_holds(small_set, exported):
    store = open_store(small_set)
    index = int(store.indices("test")[0])
    scene = exported / f"scene-{index:06d}"
    assert len(list(scene.iterdir())) == 60
    frames = SynthFringe(small_set, "test", frames=(("high", 15, 3), ("zmin", 15, 7)))[0]["frames"]
    low, high = store.manifest["extremes"]
    for name, shot in zip(("high_03.png", "zmin_07.png"), frames, strict=True):
        picture = cv2.imread(str(scene / name), cv2.IMREAD_UNCHANGED)
        assert picture.dtype == np.uint8 and picture.ndim == 2
        np.testing.assert_allclose(picture, shot * (high - low) + low, atol=1e-3)


def test_there_and_back(small_set, exported, tmp_path):
    """What is decoded from the photographs agrees with the geometry that made them."""
    out = tmp_path / "back"
    import_folder(exported, out)
    assert check_files(out) == []
    before = SynthFringe(small_set, "test")
    with pytest.raises(ValueError, match="no training split to take the extremes from"):
        SynthFringe(out, "test")
    after = SynthFringe(out, "test", extremes=before.extremes)
    assert len(before) == len(after) == 2
    a, b = before[0], after[0]
    np.testing.assert_allclose(b["frames"], a["frames"], atol=1e-6)
    both = a["mask"] & b["mask"]
    assert (a["mask"] != b["mask"]).sum() <= 0.01 * both.sum()
    for name, within in (("M", 1e-5), ("D_r", 1e-4), ("Phi", 1e-3), ("modulation", 1e-3)):
        np.testing.assert_allclose(
            b[name][..., both], a[name][..., both], atol=within, err_msg=name
        )
    sensitive = before.store.system.columns_per_mm(650.0) > 0.1
    bright = both.numpy() & sensitive & (a["modulation"].numpy() > 20)
    assert (b["depth"] - a["depth"]).abs().numpy()[bright].max() < 0.5


@pytest.mark.slow
def test_scenes_of_one_object_stay_together(small_set, tmp_path):
    export_folder(small_set, tmp_path / "all")
    index = json.loads((tmp_path / "all" / "scenes.json").read_text())
    for scene in index["scenes"].values():
        del scene["split"]
    (tmp_path / "all" / "scenes.json").write_text(json.dumps(index))
    manifest = import_folder(tmp_path / "all", tmp_path / "set", workers=2)
    assert [len(m["scenes"]) for m in manifest["models"]] == [2] * 11
    assert sorted(m["split"] for m in manifest["models"]) == ["test"] + ["training"] * 9 + [
        "validation"
    ]


def test_photographs_that_are_not_held(exported, tmp_path):
    import_folder(exported, tmp_path / "set")
    with pytest.raises(ValueError, match="step 1 of 4 at pitch 24 asked for; .* holds"):
        SynthFringe(tmp_path / "set", "test", frames=(("high", 4, 1),), extremes=(0, 255))
    with pytest.raises(ValueError, match="noise 1.0 given; .* holds photographs as they are"):
        export_folder(tmp_path / "set", tmp_path / "again", noise=1.0)


def bad_scene(scenes, damage):
    scene = sorted(f for f in scenes.iterdir() if f.is_dir())[0]
    damage(scene)
    manifest = import_folder(scenes, scenes.parent / "set")
    return manifest["records"][0]["notes"][0]


def shrink(scene):
    cv2.imwrite(str(scene / "high_00.png"), np.zeros((60, 80), np.uint8))


def deepen(scene):
    cv2.imwrite(str(scene / "high_00.png"), np.zeros((120, 160), np.uint16))


@pytest.mark.parametrize(
    "damage, said",
    [
        (lambda s: (s / "mid_03.png").unlink(), "1 of 60 photographs are missing: ['mid_03.png']"),
        (
            shrink,
            "high_00.png is 80 x 60 of uint8; the camera of scenes.json has 160 x",
        ),
        (deepen, "high_00.png is 160 x 120 of uint16; the camera"),
        (
            lambda s: (s / "unit_00.png").write_bytes(b"\x89PNG"),
            "unit_00.png is cut",
        ),
        (shutil.rmtree, "60 of 60 photographs are missing"),
    ],
)
def test_scenes_that_cannot_be_used_are_skipped(damage, said, scenes):
    index = json.loads((scenes / "scenes.json").read_text())
    for scene in index["scenes"].values():
        scene["split"] = "training"
    (scenes / "scenes.json").write_text(json.dumps(index))
    assert said in bad_scene(scenes, damage)


def test_folders_that_cannot_be_used(scenes, tmp_path):
    index = json.loads((scenes / "scenes.json").read_text())
    del index["steps"]
    (scenes / "scenes.json").write_text(json.dumps(index))
    with pytest.raises(ValueError, match="is not whole .no steps."):
        import_folder(scenes, tmp_path / "set")
    (scenes / "scenes.json").write_text("{")
    with pytest.raises(ValueError, match="is not whole"):
        import_folder(scenes, tmp_path / "set")


def test_import_measures_shade_and_depth(small_set, exported, tmp_path):
    """Against the views behind the photographs; nothing infinite gets into the mask."""
    import_folder(exported, tmp_path / "set")
    before, after = open_store(small_set), open_store(tmp_path / "set")
    for old, new in zip(before.indices("test"), after.indices("test"), strict=True):
        a, b = before.view(old), after.view(new)
        assert np.isfinite(b.depth[b.mask]).all() and (b.shade[~b.mask] == 0).all()
        both = a.mask & b.mask & (a.shade > 0.1)
        np.testing.assert_allclose(b.shade[both], a.shade[both], atol=0.01)


def test_colour_photographs_become_grey(exported, tmp_path):
    scene = next(f for f in sorted(exported.iterdir()) if f.is_dir())
    one = shutil.copytree(exported, tmp_path / "one")
    picture = cv2.imread(str(scene / "high_00.png"), cv2.IMREAD_UNCHANGED)
    tinted = np.stack([picture // 4, picture, picture], axis=-1)
    cv2.imwrite(str(one / scene.name / "high_00.png"), tinted)
    import_folder(one, tmp_path / "set")
    kept = open_store(tmp_path / "set").array("frames", 0)[0]
    np.testing.assert_array_equal(kept, cv2.cvtColor(tinted, cv2.COLOR_BGR2GRAY))


def test_other_numbers_of_steps_go_out_and_in(small_set, tmp_path):
    """A geometry that takes 5 and 3 steps; exported again, its photographs are the same files."""
    store, folder = open_store(small_set), tmp_path / "own"
    p, steps = store.manifest["pitches"], {"high": 5, "mid": 4, "zmin": 3, "unit": 6}
    for index in store.indices("training")[:3]:
        scene = folder / f"view{index}"
        scene.mkdir(parents=True)
        for name, count in steps.items():
            for n, frame in enumerate(store.view(index).frames(Fringe(p[name], count))):
                cv2.imwrite(str(scene / f"{name}_{n:02d}.png"), frame)
    about = {"system": store.manifest["system"], "pitches": p, "steps": steps}
    (folder / "scenes.json").write_text(json.dumps(about))
    manifest = import_folder(folder, tmp_path / "set")
    assert [len(m["scenes"]) for m in manifest["models"]] == [1, 1, 1]
    item = SynthFringe(tmp_path / "set", "training", frames=(("high", 5, 2), ("zmin", 3, 1)))[0]
    bright = item["mask"] & (item["modulation"] > 20)
    assert (item["Phi"] - item["Phi_true"])[bright].abs().max() < 1e-3
    assert export_folder(tmp_path / "set", tmp_path / "again") == 3
    for scene in (tmp_path / "again").glob("scene-*"):
        assert len(list(scene.iterdir())) == 18


def test_changed_photographs_are_another_dataset(scenes, tmp_path):
    import_folder(scenes, tmp_path / "set")
    shrink(sorted(f for f in scenes.iterdir() if f.is_dir())[0])
    with pytest.raises(ValueError, match="holds another dataset: its models differ"):
        import_folder(scenes, tmp_path / "set")


@pytest.mark.parametrize(
    "change, said",
    [
        (lambda s: [], "scenes.json is no table"),
        (lambda s: dict.fromkeys(s), "scenes.json is no table"),
        (lambda s: {k: {"split": "train"} for k in s}, "split 'train' given for scene-"),
        (
            lambda s: {
                k: {"object": "a", "split": p} for k, p in zip(s, ("test", "training"), strict=True)
            },
            "show one object; they belong in one split",
        ),
        (lambda s: {}, "holds no scene"),
    ],
)
def test_scenes_that_make_no_sense(change, said, scenes, tmp_path):
    index = json.loads((scenes / "scenes.json").read_text())
    (scenes / "scenes.json").write_text(json.dumps({**index, "scenes": change(index["scenes"])}))
    with pytest.raises(ValueError, match=said):
        import_folder(scenes, tmp_path / "set")


def test_an_imported_photograph_is_augmented_too(exported, tmp_path):
    import_folder(exported, tmp_path / "set")

    def item(**how):
        kept = {"augmentation": Augmentation(**how), "extremes": (0, 255)}
        return SynthFringe(tmp_path / "set", "test", **kept)[0]

    plain, lit = item(), item()["mask"]
    dark = item(gain=(0.5, 0.5))
    np.testing.assert_allclose(dark["frames"], plain["frames"] / 2, atol=0.003)
    np.testing.assert_allclose(
        dark["modulation"][dark["mask"]], plain["modulation"][dark["mask"]] / 2
    )
    np.testing.assert_allclose(item(gamma=(0.5, 0.5))["frames"], plain["frames"] ** 0.5, atol=0.003)
    bright = lit & (plain["frames"].min(0).values > 0.1)
    noise = 255 * (item(noise=(2.0, 2.0))["frames"] - plain["frames"])[:, bright]
    assert 1.7 < noise.std() < 2.3 and not torch.equal(noise[0], noise[1])


def test_many_scenes_of_one_object_are_several_models_of_one_split(scenes, tmp_path, monkeypatch):
    monkeypatch.setattr(folders, "AT_ONCE", 1)
    index = json.loads((scenes / "scenes.json").read_text())
    first, second = index["scenes"]
    index["scenes"] = {first: {"object": "cup"}, second: {"object": "cup"}}
    (scenes / "scenes.json").write_text(json.dumps(index))
    manifest = import_folder(scenes, tmp_path / "set")
    assert [m["name"] for m in manifest["models"]] == ["cup (1)", "cup (2)"]
    assert {m["split"] for m in manifest["models"]} == {"training"}


@pytest.mark.parametrize("moment", [0, 30, 61, 121])
def test_an_export_that_was_stopped_goes_on(moment, small_set, exported, tmp_path, monkeypatch):
    """In the first scene, at the second, before the index; another export does not."""
    folder, write, written = tmp_path / "stopped", files.write_whole, []

    def limited(path, data):
        if len(written) == moment:
            path.with_name(f"{path.name}.7-0a1b2c3d.part").write_bytes(data[:50])  # a kill leaves
            raise KeyboardInterrupt
        written.append(path)
        write(path, data)

    monkeypatch.setattr(layout, "write_whole", limited)
    with pytest.raises(KeyboardInterrupt):
        export_folder(small_set, folder, "test")
    monkeypatch.setattr(layout, "write_whole", write)
    if moment:
        with pytest.raises(ValueError, match="is not empty"):
            export_folder(small_set, folder, "test", noise=1.0)
    assert export_folder(small_set, folder, "test") == 2
    for file in exported.rglob("*"):
        if file.is_file():
            assert (folder / file.relative_to(exported)).read_bytes() == file.read_bytes()
    assert len(list(folder.rglob("*"))) == len(list(exported.rglob("*")))


def test_a_finished_export_is_not_done_twice(small_set, tmp_path, monkeypatch):
    """As after a kill between the last file and the end of the process; another one is refused."""
    export_folder(small_set, tmp_path / "out", "test")
    before = {f: f.stat().st_mtime_ns for f in (tmp_path / "out").rglob("*.png")}
    export_folder(small_set, tmp_path / "out", "test")
    assert {f: f.stat().st_mtime_ns for f in (tmp_path / "out").rglob("*.png")} == before
    assert not (tmp_path / "out" / "unfinished.json").exists()
    with pytest.raises(ValueError, match="is not empty"):
        export_folder(small_set, tmp_path / "out", "test", noise=1.0)
