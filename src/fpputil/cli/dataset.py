"""`fpp dataset`: make, check, show, export or import a dataset (chapter 7)."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import App, Group, Parameter
from cyclopts.validators import MutuallyExclusive

app = App("dataset", help_format="markdown", help="Make, check, show, export or import a dataset.")
Source = Parameter(group=Group("Models from files", validator=MutuallyExclusive()))


@app.command
def generate(
    out: Path,
    /,
    *,
    preset: str = "tiny",
    models: int | None = None,
    held_out: int | None = None,
    views: int = 36,
    workers: int = 1,
    seed: int = 0,
    size: float = 240.0,
    folder: Annotated[Path | None, Source] = None,
    thingi10k: Annotated[bool, Source] = False,
    cache: Path | None = None,
    download: bool = False,
    scheduler: str | None = None,
) -> None:
    """Make a dataset, or go on with one that was stopped.

    Models come from seeds unless a folder or Thingi10K is named. Stopped at any moment, the same
    command goes on and ends with the same bytes.

    Parameters
    ----------
    out
        Folder of the dataset.
    preset
        tiny, small or paper.
    models
        How many (default 500 from seeds, all of a folder).
    held_out
        Models of families that no other split has (default a tenth more; only from seeds).
    views
        Poses of each model.
    workers
        Processes.
    seed
        Of models, splits, poses.
    size
        mm, the ball every model is scaled to.
    folder
        Mesh files below this folder.
    thingi10k
        Meshes of Thingi10K.
    cache
        Where Thingi10K lies, or goes to.
    download
        Download Thingi10K if need be.
    scheduler
        Work on the Dask cluster of this scheduler, tcp://HOST:PORT; its workers must see OUT under
        the same path.
    """
    from fpputil.dataset.generation import generate
    from fpputil.dataset.models import mesh_folder, seeded_models
    from fpputil.dataset.models import thingi10k as list_thingi10k

    if (folder or thingi10k) and held_out:
        raise ValueError("--held-out given; only models from seeds have families to hold out")
    if not thingi10k and (cache or download):
        raise ValueError("--cache or --download given; they are for --thingi10k")
    chosen, held, root, notes = (), (), folder, ()
    if folder:
        chosen, notes = mesh_folder(folder, models)
    elif thingi10k:
        root, chosen, notes = list_thingi10k(models, cache, download)
    else:
        chosen, held = seeded_models(500 if models is None else models, held_out, seed)
    for note in notes:
        print(f"note: {note}")
    start, how = time.perf_counter(), {"seed": seed, "size": size, "progress": True}
    how |= {"views": views, "workers": workers, "scheduler": scheduler, "root": root}
    manifest = generate(out, preset, chosen, held, **how)
    _print(manifest)
    print(f"{time.perf_counter() - start:.0f} s")


@app.command
def check(path: Path, /) -> int:
    """Find flipped bytes and missing shards.

    Parameters
    ----------
    path
        Folder of the dataset.
    """
    from fpputil.dataset.store import check_files, open_store

    wrong = check_files(path)
    for line in wrong:
        print(line)
    if wrong:
        print("The command that made the dataset makes damaged and missing files anew.")
        return 1
    print(f"every byte is as it was written, content {open_store(path).checksum}")
    return 0


@app.command
def info(path: Path, /) -> None:
    """Say what a dataset holds.

    Parameters
    ----------
    path
        Folder of the dataset.
    """
    from fpputil.dataset.store import open_store

    _print(open_store(path).manifest)


@app.command
def export(path: Path, folder: Path, /, *, split: str | None = None, noise: float = 0.0) -> None:
    """Write photographs as PNG files, a folder a scene.

    Parameters
    ----------
    path
        Folder of the dataset.
    folder
        New or empty.
    split
        This split alone: training, validation, test, held-out.
    noise
        Read noise, grey levels.
    """
    from fpputil.dataset.folders import export_folder

    print(f"{export_folder(path, folder, split, noise)} scenes in {folder}")


@app.command(name="import")
def import_(folder: Path, out: Path, /, *, seed: int = 0, workers: int = 1) -> None:
    """Make a dataset out of folders of PNG files.

    FOLDER holds scenes.json (system, pitches, steps) and a folder a scene with high_00.png ...,
    mid_00.png ..., zmin_00.png ..., unit_00.png ... as export writes them.

    Parameters
    ----------
    folder
        Of the scenes.
    out
        Folder of the dataset.
    seed
        Of the splits.
    workers
        Processes.
    """
    from fpputil.dataset.folders import import_folder

    _print(import_folder(folder, out, seed=seed, workers=workers, progress=True))


def _print(manifest: dict) -> None:
    """What a dataset holds, and what of it could not be used."""
    settings = manifest["settings"]
    models = list(zip(manifest["records"], manifest["models"], strict=True))
    for split in dict.fromkeys(m["split"] for m in manifest["models"]):
        records = [record for record, model in models if model["split"] == split]
        used = sum(lit >= settings["least"] for record in records for lit in record["lit"])
        print(f"{split:11s} {len(records):6d} models {used:7d} views")
    size = sum(s["bytes"] for record, _ in models for s in record["shards"].values())
    low, high = manifest["extremes"] or ("?", "?")
    print(f"{size / 1e6:.1f} MB, grey levels of training {low} to {high}")
    for record, model in models:
        if "skipped" in record:
            print(f"skipped {model['name']}: {record['skipped']}")
        elif record["notes"]:
            print(f"note on {model['name']}: {'; '.join(record['notes'][:3])}")
    print(f"content {manifest['content']}")
