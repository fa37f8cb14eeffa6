"""Filling the folder of a dataset: held by one process at a time, resumed by the same call.

One task makes one model whole and ends by writing its record, so a run that stops at any moment
loses the models in flight and no other. Nothing that differs from run to run enters a file: the
same command ends with the same bytes, however often it was stopped. Chapter 7.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout
from tqdm.std import tqdm

from fpputil.learning import engines, layout

RECORDS = "records"
"""Folder of the finished models' records, until the manifest takes them in."""


def fill(out, plan: dict, make, root=None, workers=1, scheduler=None, progress=False) -> dict:
    """Run ``make(out, shared, model, number, root)`` for every model of a plan that has no record.

    Parameters are those of `generate`; `make` writes one model's shards and record.
    """
    out, total = Path(out).absolute(), len(plan["models"])
    root = None if root is None else str(Path(root).absolute())
    with _claim(out):
        if _begin(out, plan):
            return layout.read_manifest(out)
        missing = [n for n in range(total) if _finished(out, n) is None]
        shared = {k: plan[k] for k in ("settings", "system", "pitches", "frames")}
        jobs = [(str(out), shared, plan["models"][n], n, root) for n in missing]
        views = plan["settings"]["views"]
        done = (total - len(missing)) * views
        with tqdm(total=total * views, initial=done, unit="view", disable=not progress) as bar:
            for _ in engines.run(make, jobs, workers, scheduler):
                bar.update(views)
        return _finish(out, plan)


@contextmanager
def _claim(out: Path) -> Iterator[None]:
    """Hold the folder against other generators; the lock dies with its process."""
    if out.exists() and not out.is_dir():
        raise ValueError(f"{out} is a file; a dataset is a folder")
    if not out.parent.is_dir():
        raise ValueError(f"{out} given; its folder {out.parent} does not exist")
    if out.is_dir() and not (out / layout.MANIFEST).exists():
        foreign = [f.name for f in out.iterdir() if f.name != layout.LOCK and f.suffix != ".part"]
        if foreign:
            raise ValueError(
                f"{out} holds something else ({', '.join(sorted(foreign)[:3])}); a dataset goes to "
                "a new or empty folder"
            )
    out.mkdir(exist_ok=True)
    try:
        with FileLock(out / layout.LOCK, timeout=0):
            yield
    except Timeout:
        raise RuntimeError(f"another process is generating into {out}; wait for it") from None


def _begin(out: Path, plan: dict) -> bool:
    """Write the plan, or hold it against the one that is there; True if nothing is left to do."""
    if (out / layout.MANIFEST).exists():
        found = layout.read_manifest(out)
        before = json.loads(layout.dumps(plan))
        for key in (k for k in plan if k != "complete"):
            if found.get(key) != before[key]:
                raise ValueError(f"{out} holds another dataset: {_difference(found, before, key)}")
        if found["complete"]:
            if all(_whole(out, record) for record in found["records"]):
                shutil.rmtree(out / RECORDS, ignore_errors=True)
                return True
            for number, record in enumerate(found["records"]):
                layout.put(out, {_record(number): layout.dumps(record)})
    for left in out.rglob("*.part"):
        left.unlink()
    layout.put(out, {layout.MANIFEST: layout.dumps(plan), **layout.metadata_files(plan)})
    (out / RECORDS).mkdir(exist_ok=True)
    return False


def _difference(found: dict, plan: dict, key: str) -> str:
    there, here = found.get(key), plan[key]
    if isinstance(there, dict):
        names = sorted(k for k in {*there, *here} if there.get(k) != here.get(k))
        return "; ".join(f"{key} {k} is {there.get(k)} there and {here.get(k)} here" for k in names)
    return f"its {key} differ"


def _record(number: int) -> str:
    return f"{RECORDS}/{number:06d}.json"


def _whole(out: Path, record: dict) -> bool:
    """Whether all shards of a record are there, by their size."""
    try:
        return all((out / n).stat().st_size == s["bytes"] for n, s in record["shards"].items())
    except FileNotFoundError:
        return False


def _finished(out: Path, number: int) -> dict | None:
    """Record of a model whose shards are all there, else None."""
    try:
        record = json.loads((out / _record(number)).read_bytes())
    except FileNotFoundError:
        return None
    return record if _whole(out, record) else None


def finish_model(out: str, shared: dict, number: int, record: dict, stacks: dict | None) -> dict:
    """Write the shards of a model, then the record that says so."""
    files = {} if stacks is None else layout.view_files(shared, number, stacks)
    layout.put(Path(out), files)
    record["shards"] = {
        n: {"bytes": len(data), "sha256": layout.digest(data)} for n, data in files.items()
    }
    layout.put(Path(out), {_record(number): layout.dumps(record)})
    return record


def portable(error: Exception, root: str | None) -> str:
    """An error's message without the folder, which differs from one machine to the next."""
    return str(error).replace(f"{root}/", "") if root else str(error)


def _finish(out: Path, plan: dict) -> dict:
    """Gather the records into the manifest, and only then call the dataset complete."""
    records = [_finished(out, n) for n in range(len(plan["models"]))]
    pairs = zip(records, plan["models"], strict=True)
    white = [r["white"] for r, m in pairs if m["split"] == "training"]
    if not any(white or [r["white"] for r in records]):
        why = next((r["skipped"] for r in records if "skipped" in r), "nothing of it is lit")
        raise ValueError(f"no training model for {out} could be used; the first: {why}")
    manifest = {
        **plan,
        "complete": True,
        "records": records,
        # Black, and the brightest pixel of a training model in white light.
        "extremes": [0, max(white)] if white else None,
        "metadata": {n: layout.digest(data) for n, data in layout.metadata_files(plan).items()},
        "content": layout.content(records),
    }
    manifest = json.loads(layout.dumps(manifest))
    manifest["seal"] = layout.seal(manifest)
    layout.put(out, {layout.MANIFEST: layout.dumps(manifest)})
    shutil.rmtree(out / RECORDS)
    return manifest
