"""`fpp dataset`: make, check, show, export or import a dataset (chapter 7)."""

from __future__ import annotations

import time
from pathlib import Path


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    dataset = commands.add_parser("dataset", help="make, check, show, export or import a dataset")
    verbs = dataset.add_subparsers(title="commands", required=True, metavar="COMMAND")
    _generate_parser(verbs)
    check = verbs.add_parser("check", help="find flipped bytes and missing shards")
    check.add_argument("path", metavar="OUT", type=Path)
    check.set_defaults(run=_check)
    info = verbs.add_parser("info", help="say what a dataset holds")
    info.add_argument("path", metavar="OUT", type=Path)
    info.set_defaults(run=_info)
    export = verbs.add_parser("export", help="write photographs as PNG files, a folder a scene")
    export.add_argument("path", metavar="OUT", type=Path)
    export.add_argument("folder", metavar="FOLDER", type=Path, help="new or empty")
    export.add_argument("--split", help="this split alone: training, validation, test, held-out")
    export.add_argument("--noise", type=float, default=0.0, help="read noise, grey levels")
    export.set_defaults(run=_export)
    imports = verbs.add_parser(
        "import",
        help="make a dataset out of folders of PNG files",
        description="FOLDER holds scenes.json (system, pitches, steps) and a folder a scene with "
        "high_00.png ..., mid_00.png ..., zmin_00.png ..., unit_00.png ... as export writes them.",
    )
    imports.add_argument("folder", metavar="FOLDER", type=Path)
    imports.add_argument("out", metavar="OUT", type=Path)
    imports.add_argument("--seed", type=int, default=0, help="of the splits (default 0)")
    imports.add_argument("--workers", type=int, default=1, help="processes (default 1)")
    imports.set_defaults(run=_import)


def _generate_parser(verbs) -> None:
    make = verbs.add_parser(
        "generate",
        help="make a dataset, or go on with one that was stopped",
        description="Models come from seeds unless a folder or Thingi10K is named. Stopped at any "
        "moment, the same command goes on and ends with the same bytes.",
    )
    make.add_argument("out", metavar="OUT", type=Path, help="folder of the dataset")
    make.add_argument("--preset", default="tiny", help="tiny, small or paper (default tiny)")
    make.add_argument("--models", type=int, metavar="N",
                      help="how many (default 500 from seeds, all of a folder)")  # fmt: skip
    make.add_argument("--held-out", type=int, metavar="M",
                      help="models of families that no other split has (default N / 10; only "
                      "from seeds)")  # fmt: skip
    make.add_argument("--views", type=int, default=36, help="poses of each model (default 36)")
    make.add_argument("--workers", type=int, default=1, help="processes (default 1)")
    make.add_argument("--seed", type=int, default=0, help="of models, splits, poses (default 0)")
    make.add_argument("--size", type=float, default=240.0,
                      help="mm, the ball every model is scaled to (default 240)")  # fmt: skip
    source = make.add_mutually_exclusive_group()
    source.add_argument("--folder", type=Path, help="mesh files below this folder")
    source.add_argument("--thingi10k", action="store_true", help="meshes of Thingi10K")
    make.add_argument("--cache", type=Path, help="where Thingi10K lies, or goes to")
    make.add_argument("--download", action="store_true", help="download Thingi10K if need be")
    make.add_argument("--scheduler", metavar="tcp://HOST:PORT",
                      help="work on the Dask cluster of this scheduler; its workers must see OUT "
                      "under the same path")  # fmt: skip
    make.set_defaults(run=_generate)


def _generate(options) -> None:
    from fpputil.dataset.generation import generate

    models, held_out, root, notes = _models(options)
    for note in notes:
        print(f"note: {note}")
    start = time.perf_counter()
    manifest = generate(
        options.out, options.preset, models, held_out, root=root, views=options.views,
        seed=options.seed, size=options.size, workers=options.workers,
        scheduler=options.scheduler, progress=True,
    )  # fmt: skip
    _tell(options.out, manifest)
    print(f"{time.perf_counter() - start:.0f} s")


def _models(options):
    """Models, held-out models, their root folder, and notes on what was left out."""
    from fpputil.dataset import models as sources

    if (options.folder or options.thingi10k) and options.held_out:
        raise ValueError("--held-out given; only models from seeds have families to hold out")
    if not options.thingi10k and (options.cache or options.download):
        raise ValueError("--cache or --download given; they are for --thingi10k")
    if options.folder:
        models, notes = sources.mesh_folder(options.folder, options.models)
        return models, (), options.folder, notes
    if options.thingi10k:
        root, models, notes = sources.thingi10k(options.models, options.cache, options.download)
        return models, (), root, notes
    number = 500 if options.models is None else options.models
    return *sources.seeded_models(number, options.held_out, options.seed), None, ()


def _check(options) -> int:
    from fpputil.dataset.store import check_files, open_store

    wrong = check_files(options.path)
    for line in wrong:
        print(line)
    if wrong:
        print("The command that made the dataset makes damaged and missing files anew.")
        return 1
    print(f"every byte is as it was written, content {open_store(options.path).checksum}")
    return 0


def _info(options) -> None:
    from fpputil.dataset.store import open_store

    _tell(options.path, open_store(options.path).manifest)


def _export(options) -> None:
    from fpputil.dataset.folders import export_folder

    number = export_folder(options.path, options.folder, options.split, options.noise)
    print(f"{number} scenes in {options.folder}")


def _import(options) -> None:
    from fpputil.dataset.folders import import_folder

    manifest = import_folder(
        options.folder, options.out, seed=options.seed, workers=options.workers, progress=True
    )
    _tell(options.out, manifest)


def _tell(path: Path, manifest: dict) -> None:
    """What a dataset holds, and what of it could not be used."""
    settings, records = manifest["settings"], manifest["records"]
    for split in dict.fromkeys(m["split"] for m in manifest["models"]):
        own = [r for r, m in zip(records, manifest["models"], strict=True) if m["split"] == split]
        used = sum(lit >= settings["least"] for r in own for lit in r["lit"])
        print(f"{split:11s} {len(own):6d} models {used:7d} views")
    size = sum(s["bytes"] for r in records for s in r["shards"].values())
    low, high = manifest["extremes"] or ("?", "?")
    print(f"{size / 1e6:.1f} MB, grey levels of training {low} to {high}")
    for record, model in zip(records, manifest["models"], strict=True):
        if "skipped" in record:
            print(f"skipped {model['name']}: {record['skipped']}")
        elif record["notes"]:
            print(f"note on {model['name']}: {'; '.join(record['notes'][:3])}")
    print(f"content {manifest['content']}")
