"""What is refused, and the words that say why: one case for each kind of error."""

import json
import shutil

import numpy as np
import pytest

from fpputil.dataset import (
    Augmentation,
    SynthFringe,
    export_folder,
    generate,
    import_folder,
    layout,
    load_model,
    mesh_folder,
    open_store,
    parallel,
    parts,
    seeded_models,
)
from fpputil.dataset.generation import make_model, plan_of, see_model
from fpputil.dataset.models import Model


def rewrite(path, **changes):
    """A copy of a manifest with other entries."""
    file = path / layout.MANIFEST
    file.write_bytes(layout.dumps({**json.loads(file.read_bytes()), **changes}))
    return path


def made(path, *models, **options):
    return generate(path, "tiny", *(models or seeded_models(10, 1)), **{"views": 2, **options})


REFUSALS = [
    # Models
    (lambda s, t: parts(0), "number 0 given; a whole number of 1 or more"),
    (lambda s, t: parts(1, ["gear", "teapot"]), "'teapot'] given; one or more of bracket"),
    (lambda s, t: parts(1, []), r"families \[\] given"),
    (lambda s, t: mesh_folder(t / "none"), "none given; a folder of mesh files is needed"),
    (lambda s, t: mesh_folder(s, 1), "holds 0 different mesh files, 1 or more are .* glb, gltf"),
    (lambda s, t: load_model(Model("a", "", -1, "a.stl", "")), "a is a file; the folder it was"),
    # Generating
    (lambda s, t: made(t / "x", views=0), "views 0 given"),
    (lambda s, t: made(t / "x", views=37), "37 views given; the paper turns each model into 36"),
    (lambda s, t: made(t / "x", size=320.0), "size 320.0 mm given; a ball of more than 285 mm"),
    (lambda s, t: generate(t / "x", "near", *seeded_models(9), size=140), "more than 130 mm does"),
    (lambda s, t: made(t / "x", workers=0), "workers 0 given"),
    (lambda s, t: made(t / "x", seed=-1), "seed -1 given"),
    (lambda s, t: generate(t / "x", "huge", parts(1)), "preset 'huge' given"),
    (lambda s, t: made(t / "x", ()), "no model given"),
    (lambda s, t: made(t / "x", parts(1) * 2), r"models \['part-00000'\] given twice"),
    (lambda s, t: made(t / "no" / "where"), "no/where given; its folder .*no does not exist"),
    (lambda s, t: made(t / "file"), "file is no folder"),
    (lambda s, t: made(t), r"holds something else \(file, set\); a dataset goes to a new"),
    (lambda s, t: made(s, views=3), "another dataset: settings views is 2 there and 3 here"),
    (lambda s, t: made(s, *seeded_models(10, 1, 1)), "another dataset: its models differ"),
    (lambda s, t: made(rewrite(s, versions={})), "versions numpy is None there and"),
    (lambda s, t: parallel.executor(1, "tcp://host"), "an address like tcp://host:8786 is needed"),
    # Reading
    (lambda s, t: open_store(t / "none"), "none given; there is no such folder"),
    (lambda s, t: open_store(t), "holds no manifest.json; it is not a dataset"),
    (lambda s, t: open_store(rewrite(s, version=2)), "format 'SynthFringe' 2; 'SynthFringe' 1 is"),
    (lambda s, t: open_store(rewrite(s, complete=False)), "is not finished; run the command"),
    (lambda s, t: open_store(s).indices("train"), "split 'train' given; the splits are training"),
    (lambda s, t: open_store(s).view(22), "view 22 given; .* has views 0 to 21"),
    (lambda s, t: open_store(s).describe(-1), "view -1 given; .* has views 0 to 21"),
    # Items
    (lambda s, t: SynthFringe(s, "test", (("low", 15, 0),)), "frequency 'low' given; the freq"),
    (lambda s, t: SynthFringe(s, "test", (("high", 2, 0),)), "2 steps given"),
    (lambda s, t: SynthFringe(s, "test", (("high", 15, 15),)), "step 15 given; a fringe of 15 st"),
    (lambda s, t: SynthFringe(s, "test", ()), "no frame given"),
    (lambda s, t: SynthFringe(s, "test", seed=0.5), "seed 0.5 given"),
    (lambda s, t: SynthFringe(s, "test", extremes=(5, 5)), "extremes 5.0, 5.0 given"),
    (lambda s, t: SynthFringe(s, "test", extremes=(np.nan, 1)), "extremes nan, 1.0 given"),
    (lambda s, t: SynthFringe(s, "test", threshold=-1), "threshold -1 given"),
    (lambda s, t: SynthFringe(s, "test", texture=1.0), "texture 1.0 given; a contrast below 1"),
    (lambda s, t: Augmentation(gain=(2.0, 1.0)), "gain from 2.0 to 1.0 given"),
    (lambda s, t: Augmentation(noise=(-1, 1)), "noise -1 given"),
    # Folders
    (lambda s, t: export_folder(s, t), "is not empty; an export goes to a new or empty folder"),
    (lambda s, t: import_folder(t, t / "x"), "holds no scenes.json"),
]


@pytest.mark.parametrize("call, words", REFUSALS, ids=[words for _, words in REFUSALS])
def test_refusals(call, words, small_set, tmp_path):
    (tmp_path / "file").write_text("precious")
    copy = shutil.copytree(small_set, tmp_path / "set")
    with pytest.raises((ValueError, OSError), match=words):
        call(copy, tmp_path)
    assert (tmp_path / "file").read_text() == "precious" and not (tmp_path / "x").exists()


def test_nothing_usable_is_an_error(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/empty.off").write_text("OFF\n0 0 0\n")
    models, _ = mesh_folder(tmp_path / "meshes")
    with pytest.raises(ValueError, match="no training model .*; the first: empty.off has no faces"):
        made(tmp_path / "set", models, root=tmp_path / "meshes")


def test_a_worker_that_does_not_see_the_folder(tmp_path):
    plan = plan_of("tiny", *seeded_models(3, 0), 1, 0, 240.0)
    with pytest.raises(RuntimeError, match="does not see .*nowhere; all workers must"):
        make_model(see_model, str(tmp_path / "nowhere"), plan, plan["models"][0], 0, None)
    assert not (tmp_path / "nowhere").exists()
