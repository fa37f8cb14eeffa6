"""What is read, and how: kinds of files, those who make them, and those who use them."""

import contextlib
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Kind:
    """Files that `make` writes into a folder; `files` are changed, `use` reads them."""

    make: Callable
    files: tuple[str, ...]
    use: Callable
    number: int


def fpp(*words) -> None:
    """The command; what it refuses is raised again."""
    from fpputil.cli import main

    printed, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(errors):
        code = main([*map(str, words)])
    lines = [line for line in errors.getvalue().split("\r")[-1].splitlines() if line.strip()]
    if lines and lines[-1].startswith("fpp: "):
        raise ValueError("\n".join(lines))
    assert code == 0 or '"decoded": false' in printed.getvalue(), errors.getvalue()


def scene():
    from fpputil.optics import preset, raycast, shapes

    system = preset("tiny").system
    return raycast(shapes.sphere(100, [0, 0, 660], 4), system), system


def make_capture(folder):
    from fpputil.capture import Patterns, photograph_into
    from fpputil.optics import fringe_set

    view, system = scene()
    for name, suffix in (("png", "png"), ("npy", "npy")):
        files = "{pitch}-{step}." + suffix
        patterns = Patterns((912, 1140), fringe_set((912, 114, 24), 3), files=files, white="w.png")
        photograph_into(folder / name, view, patterns, system)
    system.save(folder / "system.json")


def use_capture(folder, file, rng):
    from fpputil.capture import Patterns, decode_folder, open_capture
    from fpputil.optics import System

    system = folder / "system.json"
    shots = file.parent if file != system else folder / "png"
    Patterns.load(shots / "patterns.toml").shots()
    open_capture(shots).frames(0)
    if rng.random() < 0.5:
        decode_folder(shots, folder / "out", System.load(system), report=False)
    else:
        fpp("decode", shots, "--out", folder / "out", "--system", system, "--no-report", "--json")


def use_render(folder, file, rng):
    system = folder / "system.json"
    shots = file.parent if file.name == "patterns.toml" else folder / "png"
    how = ("--system", rng.choice(("tiny", system)), "--mesh", folder / "body.off")
    fpp("render", folder / "out", "--patterns", shots / "patterns.toml", *how)


def make_render(folder):
    make_capture(folder)
    for file in (*folder.glob("*/*.png"), *folder.glob("*/*.npy")):
        file.unlink()
    box().export(folder / "body.off")


def box():
    import trimesh

    mesh = trimesh.creation.box((80, 90, 70))
    mesh.apply_translation((0, 0, 650))
    return mesh


def make_systems(folder):
    from fpputil.optics import preset

    system = preset("tiny").system
    lens = replace(system.camera, distortion=(0.1, -0.05, 0.001, 0.002, 0.01))
    for name, one in (("plain", system), ("lens", replace(system, camera=lens))):
        for suffix in ("json", "yml"):
            one.save(folder / f"{name}.{suffix}")


def use_systems(folder, file, rng):
    from fpputil.optics import System

    System.load(file).columns_at(600.0)
    fpp("system", "show", file)
    fpp("system", "convert", file, folder / "out.yml", "--force")


def make_photographs(folder):
    import cv2
    import tifffile

    grey = np.random.default_rng(0).integers(0, 256, (24, 32), np.uint8)
    deep, colour = grey.astype(np.uint16) * 257, np.stack([grey] * 3, axis=2)
    for name, image in (("grey", grey), ("deep", deep), ("colour", colour)):
        for suffix in ("png", "tif") if name == "deep" else ("png", "tif", "bmp"):
            cv2.imwrite(str(folder / f"{name}.{suffix}"), image)
        np.save(folder / f"{name}.npy", image)
    np.save(folder / "float.npy", grey / 3)
    tifffile.imwrite(folder / "float.tif", grey.astype("f4"))
    tifffile.imwrite(folder / "deflate.tif", deep, compression="zlib")


def use_photographs(folder, file, rng):
    from fpputil.capture import read_photograph

    read_photograph(file)


def make_meshes(folder):
    for name in ("stl", "obj", "ply", "off", "glb", "gltf"):
        box().export(folder / f"body.{name}")
    box().export(folder / "text.stl", file_type="stl_ascii")
    box().export(folder / "text.ply", encoding="ascii")
    np.savez(folder / "body.npz", vertices=box().vertices, facets=box().faces)


def use_meshes(folder, file, rng):
    from fpputil.optics import preset, raycast
    from fpputil.optics.shapes import load_mesh, place

    mesh = load_mesh(file if file.suffix != ".bin" else folder / "body.gltf")
    with contextlib.suppress(ValueError):  # a body may show its inside, or hardly be one
        raycast(place(mesh), preset("tiny").system)


def make_dataset(folder):
    from fpputil.dataset import generate, seeded_models

    generate(folder / "set", "tiny", *seeded_models(3, 1), views=2)


def use_dataset(folder, file, rng):
    from fpputil.dataset import SynthFringe, check_files, generate, open_store, seeded_models

    path, way = folder / "set", rng.randrange(6)
    store = open_store(path)
    if way < 3:
        for split in store.splits():
            data = SynthFringe(path, split, extremes=rng.choice((None, (0, 255))))
            data[0]["frames"]
            store.describe(int(data.indices[-1]))
            store.view(int(data.indices[-1]))
    elif way == 3:
        assert all("\n" not in line for line in check_files(path))
    elif way == 4:
        fpp("dataset", "info", path)
    else:
        generate(path, "tiny", *seeded_models(3, 1), views=2)


def make_scenes(folder):
    import cv2

    from fpputil.dataset.folders import INDEX, _names
    from fpputil.dataset.layout import dumps
    from fpputil.optics import Fringe, preset
    from fpputil.optics.system import FREQUENCIES, system_to_dict

    view, system = scene()
    pitches, steps = preset("tiny").pitches._asdict(), dict.fromkeys(FREQUENCIES, 3)
    frames = view.frames([Fringe(pitches[name], 3) for name in FREQUENCIES])
    for name in ("a", "b"):
        (folder / "scenes" / name).mkdir(parents=True)
        for file, frame in zip(_names([3] * 4), frames, strict=True):
            cv2.imwrite(str(folder / "scenes" / name / file), frame)
    index = {"system": system_to_dict(system), "pitches": pitches, "steps": steps}
    index["scenes"] = {k: {"object": k, "split": "training"} for k in ("a", "b")}
    (folder / "scenes" / INDEX).write_bytes(dumps(index))


def use_scenes(folder, file, rng):
    from fpputil.dataset import import_folder

    import_folder(folder / "scenes", folder / "out")


def method():
    from fpputil.networks import SFNetMethod

    return SFNetMethod(base=2, levels=2)


def short():
    from fpputil.learning import TrainingConfig

    return TrainingConfig(epochs=1, batch=2, validation_views=1, precision="float32")


def make_run(folder):
    from fpputil.learning import fit, load_weights
    from fpputil.learning.weights import write_metrics

    make_dataset(folder)
    fit(method(), folder / "set", short(), folder / "run")
    path = folder / "run" / "weights.safetensors"
    write_metrics(path, load_weights(path), "test", {"mae_rad": (0.1, 0.0, 0.2), "views": 2})


def use_weights(folder, file, rng):
    from fpputil.learning import load_weights, open_split
    from fpputil.learning.prediction import check_photographs, predict, warnings
    from fpputil.learning.weights import read_metrics

    path = folder / "run" / "weights.safetensors"
    read_metrics(path)
    trained = load_weights(path)
    if rng.random() < 0.5:
        open_split(trained, folder / "set", "test")
    elif rng.random() < 0.7:
        view, system = scene()
        from fpputil.optics import Fringe

        images = [view.frames(Fringe(p, 15), steps=[0])[0] for p in (24, 304)]
        shots = check_photographs(trained, images, system)
        warnings(shots)
        with contextlib.suppress(ValueError):
            predict(trained, shots)
    else:
        fpp("evaluate", path, "--data", folder / "set", "--workers", 0, "--views", 1, "--json")


def use_run(folder, file, rng):
    from fpputil.learning import fit
    from fpputil.learning.log import read_log

    read_log(folder / "run" / "log.csv")
    fit(method(), folder / "set", short(), folder / "run", resume=True)


RESULTS = Path(__file__).parents[2] / "data" / "results" / "tiny"


def make_results(folder):
    (folder / "tiny").mkdir()
    for name in ("sfnet", "sfnet-seed-1", "sido"):
        stored = json.loads((RESULTS / f"{name}.json").read_bytes())
        for part in (*stored["splits"].values(), *stored["conditions"].values()):
            part["models"] = part["models"][:3]
            part["sums"] = {k: v[:3] for k, v in part["sums"].items()}
        stored["splits"]["test"]["inspection"] = stored["splits"]["test"]["inspection"][:3]
        (folder / "tiny" / f"{name}.json").write_text(json.dumps(stored))
    for name in ("sfnet.npz", "views.npz", "rates.json"):
        shutil.copy(RESULTS / name, folder / "tiny")


def use_results(folder, file, rng):
    from fpputil.experiments import load
    from fpputil.experiments.learning_rate import best_learning_rate

    way, loaded = rng.randrange(4), load("tiny", folder)
    if file.name == "rates.json":
        best_learning_rate(file, rng.choice(("sfnet", "sido", "psnet")))
        assert loaded.rates
    elif file.suffix == ".npz":
        for view in loaded.views:
            view.cropped(view.error("sfnet"))
    elif way == 0:
        loaded.analysis("sfnet")
        loaded.mean("sfnet", part="noise 4")
    else:
        fpp("results", *(("list",), ("table", 3), ("table", 6))[way - 1], "--results", folder)


def make_mark(folder):
    from fpputil.files import folder_whole

    with folder_whole(folder / "results", "fpp decode") as out:
        (out / "a.txt").write_text("a")
        (out / "b").mkdir()
        (out / "b" / "c.txt").write_text("c")


def use_mark(folder, file, rng):
    from fpputil.files import folder_whole

    with folder_whole(folder / "results", "fpp decode", force=True) as out:
        (out / "a.txt").write_text("new")


PATTERNS = ("*/patterns.toml",)
KINDS = {
    "capture": Kind(make_capture, (*PATTERNS * 4, "*/*.*", "system.json"), use_capture, 900),
    "render": Kind(make_render, (*PATTERNS * 5, "system.json", "body.off"), use_render, 400),
    "systems": Kind(make_systems, ("*",), use_systems, 900),
    "photographs": Kind(make_photographs, ("*",), use_photographs, 900),
    "meshes": Kind(make_meshes, ("*",), use_meshes, 750),
    "dataset": Kind(
        make_dataset, ("*/manifest.json",) * 3 + ("*/*/zarr.json", "*/*/c/*/*/*"), use_dataset, 300
    ),
    "scenes": Kind(make_scenes, ("*/scenes.json",) * 4 + ("*/*/*.png",), use_scenes, 250),
    "weights": Kind(make_run, ("run/weights.*",), use_weights, 200),
    "run": Kind(make_run, ("run/checkpoint*", "run/config.json", "run/log.csv"), use_run, 150),
    "results": Kind(make_results, ("*/*.json", "*/*.npz"), use_results, 200),
    "mark": Kind(make_mark, ("*/.fpputil.json",) * 3 + ("*/*.txt",), use_mark, 50),
}
