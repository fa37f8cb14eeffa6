"""`fpp dataset`: make, check, show, export or import a dataset (chapter 7)."""

import time
from pathlib import Path
from typing import Annotated

from cyclopts import App, Group
from cyclopts.validators import MutuallyExclusive

from fpputil import dataset
from fpputil.cli.options import Preset, option

app = App("dataset", help_format="markdown", help="Make, check, show, export or import a dataset.")
SOURCE = Group("Models from files", validator=MutuallyExclusive())
Folder = Annotated[Path, option("Folder of the dataset.")]
Processes = Annotated[int, option("Processes.")]


@app.command
def generate(
    out: Folder,
    /,
    *,
    preset: Preset = "tiny",
    models: Annotated[int | None, option("How many (default 500, all of a folder).")] = None,
    held_out: Annotated[
        int | None, option("From seeds, of families no other split has (default a tenth more).")
    ] = None,
    views: Annotated[int, option("Poses of each model.")] = 36,
    workers: Processes = 1,
    seed: Annotated[int, option("Of models, splits, poses.")] = 0,
    size: Annotated[
        float | None, option("mm, the ball every model is scaled to (default: of the preset).")
    ] = None,
    folder: Annotated[Path | None, option("Mesh files below this folder.", group=SOURCE)] = None,
    thingi10k: Annotated[bool, option("Meshes of Thingi10K.", group=SOURCE)] = False,
    cache: Annotated[Path | None, option("Where Thingi10K lies, or goes to.")] = None,
    download: Annotated[bool, option("Download Thingi10K if need be.")] = False,
    scheduler: Annotated[
        str | None, option("Of Dask, tcp://HOST:PORT; its workers see OUT under the same path.")
    ] = None,
) -> None:
    """Make a dataset, or go on with one that was stopped.

    Models come from seeds unless a folder or Thingi10K is named. Stopped at any moment, the same
    command goes on and ends with the same bytes.
    """
    if (folder or thingi10k) and held_out:
        raise ValueError("--held-out given; only models from seeds have families to hold out")
    if not thingi10k and (cache or download):
        raise ValueError("--cache or --download given; they are for --thingi10k")
    held, root, notes = (), folder, ()
    if folder:
        chosen, notes = dataset.mesh_folder(folder, models)
    elif thingi10k:
        root, chosen, notes = dataset.thingi10k(models, cache, download)
    else:
        chosen, held = dataset.seeded_models(500 if models is None else models, held_out, seed)
    for note in notes:
        print(f"note: {note}")
    start, how = time.perf_counter(), {"seed": seed, "size": size, "progress": True}
    how |= {"views": views, "workers": workers, "scheduler": scheduler, "root": root}
    _print(dataset.generate(out, preset, chosen, held, **how))
    print(f"{time.perf_counter() - start:.0f} s")


@app.command
def check(path: Folder, /) -> int:
    """Find flipped bytes and missing shards."""
    if wrong := dataset.check_files(path):
        anew = "The command that made the dataset makes damaged and missing files anew."
        print(*wrong, anew, sep="\n")
        return 1
    print(f"every byte is as it was written, content {dataset.open_store(path).checksum}")
    return 0


@app.command
def info(path: Folder, /) -> None:
    """Say what a dataset holds."""
    _print(dataset.open_store(path).manifest)


@app.command
def export(
    path: Folder,
    folder: Annotated[Path, option("New or empty.")],
    /,
    *,
    split: Annotated[str | None, option("training, validation, test or held-out alone.")] = None,
    noise: Annotated[float, option("Read noise, grey levels.")] = 0.0,
) -> None:
    """Write photographs as PNG files, a folder a scene."""
    print(f"{dataset.export_folder(path, folder, split, noise)} scenes in {folder}")


@app.command(name="import")
def import_(
    folder: Annotated[Path, option("Of the scenes.")],
    out: Folder,
    /,
    *,
    seed: Annotated[int, option("Of the splits.")] = 0,
    workers: Processes = 1,
) -> None:
    """Make a dataset out of folders of PNG files.

    FOLDER holds scenes.json (system, pitches, steps) and a folder a scene with high_00.png ...,
    mid_00.png ..., zmin_00.png ..., unit_00.png ... as export writes them.
    """
    _print(dataset.import_folder(folder, out, seed=seed, workers=workers, progress=True))


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
