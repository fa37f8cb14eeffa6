"""Datasets as folders of PNG files, there and back."""

import json
import shutil

import cv2
import numpy as np
import pytest

from fpputil.learning.folders import export_folder, import_folder
from fpputil.learning.store import check, open_store
from fpputil.learning.synthfringe import SynthFringe


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
    assert check(out) == []
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
    assert np.abs(b["depth"] - a["depth"]).numpy()[bright].max() < 0.5


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
    data = SynthFringe(tmp_path / "set", "test", frames=(("high", 4, 1),), extremes=(0, 255))
    with pytest.raises(ValueError, match="step 1 of 4 at pitch 24 asked for; .* holds"):
        data[0]


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
        (shrink, "high_00.png has 80 x 60 pixels; the camera of scenes.json has 160 x 120"),
        (deepen, "high_00.png is no whole 8-bit PNG file"),
        (lambda s: (s / "unit_00.png").write_bytes(b"\x89PNG"), "unit_00.png is no whole 8-bit"),
        (shutil.rmtree, "60 of 60 photographs are missing"),
    ],
)
def test_scenes_that_cannot_be_used_are_skipped(damage, said, scenes):
    index = json.loads((scenes / "scenes.json").read_text())
    for scene in index["scenes"].values():
        scene["split"] = "training"
    (scenes / "scenes.json").write_text(json.dumps(index))
    assert said in bad_scene(scenes, damage)


def test_folders_that_cannot_be_used(small_set, scenes, tmp_path):
    with pytest.raises(ValueError, match="holds no scenes.json"):
        import_folder(tmp_path, tmp_path / "set")
    index = json.loads((scenes / "scenes.json").read_text())
    del index["steps"]
    (scenes / "scenes.json").write_text(json.dumps(index))
    with pytest.raises(ValueError, match="is not whole .KeyError: 'steps'."):
        import_folder(scenes, tmp_path / "set")
    (scenes / "scenes.json").write_text("{")
    with pytest.raises(ValueError, match="is not whole"):
        import_folder(scenes, tmp_path / "set")
    with pytest.raises(ValueError, match="is not empty"):
        export_folder(small_set, scenes)
