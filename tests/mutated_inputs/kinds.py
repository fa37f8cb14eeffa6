"""5,000 files changed at random: read, or refused in one line that names the file, and no more.

Each kind is read in a process of its own, under a limit of memory and a watchdog. Case N of a kind
again: ``python tests/test_mutated_inputs.py KIND FOLDER N``; it leaves its files in FOLDER.
"""

import contextlib
import copy
import io
import json
import math
import random
import shutil
import signal
import subprocess
import sys
import tomllib
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

MEMORY, SECONDS = 8 << 30, 20  # that reading a changed file may take
DEEP = b"[" * 100_000
VALUES = (None, True, -1, 0, 1.5, 1e308, 10**20, math.nan, "x", "1.0", "", [], {}, [[[]], 1], 1e-9)


# A file, changed


def damaged(rng, data: bytes) -> bytes:
    """Bytes flipped, cut out, cut off or put in, in the head of the file more often."""
    for _ in range(rng.choice((1, 1, 2, 5))):
        reach = min(len(data), rng.choice((32, 512, 1 << 40)))
        at = rng.randrange(reach + 1)
        extra = rng.choice((rng.randbytes(1), rng.randbytes(2), rng.randbytes(8), DEEP))
        bit = bytes(b ^ 1 << rng.randrange(8) for b in data[at : at + 1])
        end = at + rng.choice((1, 4, 100))
        data = rng.choice(
            (
                data[:at] + bit + data[at + 1 :],
                data[:at] + bit + data[at + 1 :],
                data[:at] + extra + data[at + len(extra) :],
                data[:at] + extra + data[at:],
                data[:at] + data[end:],
                data[:end] + data[at:],
                data[:at],
            )
        )
    return data


def restructured(rng, tree):
    """A tree of dicts and lists with an entry replaced, removed, renamed or added."""
    tree = node = copy.deepcopy(tree)
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        key = rng.choice(keys) if keys else None
        if not (keys and isinstance(node[key], dict | list) and node[key] and rng.random() < 0.7):
            break
        node = node[key]
    new = copy.deepcopy(rng.choice(VALUES))
    how = rng.choice(("replace",) * 5 + ("number",) * 2 + ("remove", "rename", "add"))
    old = node[key] if keys else None
    if how == "number" and isinstance(old, int | float) and not isinstance(old, bool):
        node[key] = rng.choice((str(old), float(old), -old, old + 1, old * 1000, [old], bool(old)))
    elif how in ("remove", "rename") and keys:
        del node[key]
        if how == "rename":
            node.update({f"{key}x": old}) if isinstance(node, dict) else node.append(old)
    elif how == "add" and isinstance(node, dict):
        node[rng.choice(("x", "width", "0"))] = new
    elif how == "add":
        node.append(old)
    elif keys:
        node[key] = new
    return tree


def toml(value) -> str:
    """A value as TOML writes it; tables stand in line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, float):
        return repr(value).replace("e+", "e")
    return json.dumps("" if value is None else value, ensure_ascii=False)


def safetensors(metadata, data: bytes) -> bytes:
    """A file of weights with other metadata, and no SHA-256, as those that ship."""
    size = int.from_bytes(data[:8], "little")
    head = json.loads(data[8 : 8 + size])
    head["__metadata__"] = {"metadata": json.dumps(metadata)}
    text = json.dumps(head).encode()
    return len(text).to_bytes(8, "little") + text + data[8 + size :]


def metadata_of(data: bytes):
    head = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])
    metadata = json.loads(head["__metadata__"]["metadata"])
    return {k: v for k, v in metadata.items() if k != "sha256"}


def changed(rng, file: Path) -> bytes:
    """Another content of a file: of those with a structure more often another structure."""
    data = file.read_bytes()
    if file.suffix not in (".json", ".toml", ".safetensors", ".gltf") or rng.random() < 0.3:
        return damaged(rng, data)
    if file.suffix == ".safetensors":
        return safetensors(restructured(rng, metadata_of(data)), data)
    if file.suffix == ".toml":
        tree = restructured(rng, tomllib.loads(data.decode()))
        return "".join(f"{json.dumps(k)} = {toml(v)}\n" for k, v in tree.items()).encode()
    return json.dumps(restructured(rng, json.loads(data))).encode()


# What is read, and how


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


RESULTS = Path(__file__).parents[1] / "data" / "results" / "tiny"


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


# What comes of it


def fault(kind: Kind, folder: Path, file: Path, rng) -> str:
    """What is wrong with how a changed file is answered; "" if nothing is."""
    try:
        kind.use(folder, file, rng)
        left = []
    except (ValueError, OSError, RuntimeError) as error:
        line = str(error)
        if "\n" in line.strip():
            return f"{type(error).__name__} of several lines: {line}"
        names = (file.name, str(folder), *IN_WORDS)
        if not any(name in line for name in names):
            return f"unnamed: {traceback.format_exc()}"
        left = [folder / "out"] if kind.use in WHOLE and (folder / "out").exists() else []
    except BaseException:
        return traceback.format_exc()
    left += folder.rglob("*.part")
    return f"left behind: {left}" if left else ""


IN_WORDS = ("these weights", "the network was trained for", "patterns for a projector of")
"""How a file is named by a function that is given what was in it."""

WHOLE = (use_capture, use_render)
"""What writes the folder `out` whole or not at all."""


def read_changed(name: str, folder: Path, cases: range):
    """Read changed files of a kind; a line of JSON on standard output before each, and after."""
    import resource

    import torch
    from matplotlib.figure import Figure

    warnings.simplefilter("error", RuntimeWarning)  # which would be a second line
    torch.set_num_threads(1)
    Figure.savefig = lambda self, file, **_: file.write(b"no picture")
    kind, sample, out = KINDS[name], folder / "sample", sys.stdout
    if not sample.exists():
        (folder / "made").mkdir(parents=True)
        kind.make(folder / "made")
        (folder / "made").rename(sample)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    for case in cases:
        rng = random.Random(f"{name} {case}")
        copied = Path(shutil.copytree(sample, folder / f"case-{case}"))
        file = rng.choice(sorted(copied.glob(rng.choice(kind.files))))
        file.write_bytes(changed(rng, file))
        print(json.dumps({"case": case, "file": file.name}), file=out, flush=True)
        signal.alarm(SECONDS)
        wrong = fault(kind, copied, file, rng)
        signal.alarm(0)
        if wrong:
            print(json.dumps({"case": case, "fault": wrong}), file=out, flush=True)
        elif len(cases) > 1:
            shutil.rmtree(copied)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_a_changed_file_is_read_or_refused(name, tmp_path):
    words = [sys.executable, __file__, name, tmp_path / "cases"]
    run = subprocess.run(words, capture_output=True, text=True, errors="replace")
    lines = [json.loads(line) for line in run.stdout.splitlines()]
    faults = [f"case {line['case']}: {line['fault']}" for line in lines if "fault" in line]
    assert not faults, "\n".join(faults)
    assert run.returncode == 0, f"{lines[-1:]} ended the process: {run.stderr[-3000:]}"
    assert run.stderr == ""  # from libraries, too, which write beside Python
    assert len(lines) == KINDS[name].number


if __name__ == "__main__":
    kind, folder, *numbers = sys.argv[1:]
    first, last = [*map(int, numbers), 0][0], KINDS[kind].number
    read_changed(kind, Path(folder), range(first, first + 1 if numbers else last))
