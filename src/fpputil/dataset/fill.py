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
from socket import gethostname

from filelock import FileLock, Timeout
from tqdm.std import tqdm

from fpputil.dataset import layout
from fpputil.dataset import parallel as engines
from fpputil.dataset.plan import versions
from fpputil.files import PARTIAL

RECORDS = "records"
"""Folder of the finished models' records, until the manifest takes them in."""


def fill(out, plan: dict, make, root=None, workers=1, scheduler=None, progress=False) -> dict:
    """Run ``make(out, shared, model, number, root)`` for every model of a plan that has no record.

    Parameters are those of `generate`; `make` ends with `finish_model`.
    """
    engines.check(workers, scheduler)
    out, views, total = Path(out).absolute(), plan["settings"]["views"], len(plan["models"])
    root = None if root is None else str(Path(root).absolute())
    shared = {k: plan[k] for k in ("settings", "system", "pitches", "frames", "versions")}
    with _claim(out):
        found = _found(out, plan)
        done = _done(out, plan, found)
        if found and found["complete"] and len(done) == total and _laid_out(out, plan):
            shutil.rmtree(out / RECORDS, ignore_errors=True)
            return found
        _tidy(out, plan)
        layout.put(out, {layout.MANIFEST: layout.dumps(plan), **layout.metadata_files(plan)})
        layout.put(out, {_record(n): layout.dumps(r) for n, r in done.items()})
        jobs = [
            (make, str(out), shared, model, number, root)
            for number, model in enumerate(plan["models"])
            if number not in done
        ]
        bar = tqdm(
            total=total * views, initial=len(done) * views, unit="view", disable=not progress
        )
        with bar:
            for number, record in engines.run(_one_model, jobs, workers, scheduler):
                done[number] = record
                bar.update(views)
        _tidy(out, plan)  # a worker that was lost may have left something
        return _finish(out, plan, [done[n] for n in range(total)])


def _one_model(make, out: str, shared: dict, model: dict, number: int, root: str | None):
    """Number and record of a model, made by a worker that may be on another machine."""
    if not (Path(out) / layout.MANIFEST).is_file():
        raise RuntimeError(f"worker {gethostname()} does not see {out}; all workers must")
    own = versions(bool(shared["frames"]))
    if own != shared["versions"]:
        names = [k for k in own if own[k] != shared["versions"].get(k)]
        raise RuntimeError(
            f"worker {gethostname()} has other versions of {', '.join(names)} than the dataset"
        )
    return number, make(out, shared, model, number, root)


@contextmanager
def _claim(out: Path) -> Iterator[None]:
    """Hold the folder against other generators; the lock dies with its process."""
    if (out.exists() or out.is_symlink()) and not out.is_dir():
        raise ValueError(f"{out} is no folder; a dataset is a folder")
    if not out.parent.is_dir():
        raise ValueError(f"{out} given; its folder {out.parent} does not exist")
    if out.is_dir() and not (out / layout.MANIFEST).exists():
        foreign = [
            f.name for f in out.iterdir() if f.name != layout.LOCK and not PARTIAL.fullmatch(f.name)
        ]
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


def _found(out: Path, plan: dict) -> dict | None:
    """Manifest that is there already, held against the plan."""
    if not (out / layout.MANIFEST).exists():
        return None
    found, before = layout.read_manifest(out), json.loads(layout.dumps(plan))
    for key in (k for k in plan if k != "complete"):
        if found.get(key) != before[key]:
            raise ValueError(f"{out} holds another dataset: {_difference(found, before, key)}")
    return found


def _done(out: Path, plan: dict, found: dict | None) -> dict[int, dict]:
    """Records, by number, of the models that are finished and undamaged."""
    records = (found or {}).get("records") or [_read(out, n) for n in range(len(plan["models"]))]
    return {n: r for n, r in enumerate(records) if r is not None and _whole(out, r)}


def _laid_out(out: Path, plan: dict) -> bool:
    files = layout.metadata_files(plan).items()
    return all((out / n).is_file() and (out / n).read_bytes() == data for n, data in files)


def _difference(found: dict, plan: dict, key: str) -> str:
    there, here = found.get(key), plan[key]
    if isinstance(there, dict):
        names = sorted(k for k in {*there, *here} if there.get(k) != here.get(k))
        return "; ".join(f"{key} {k} is {there.get(k)} there and {here.get(k)} here" for k in names)
    return f"its {key} differ"


def _tidy(out: Path, plan: dict) -> None:
    """Remove what a killed run left half-written; files of other names are not ours."""
    inside = (f for k in (*layout.array_kinds(plan), RECORDS) for f in (out / k).rglob("*.part"))
    for file in (*out.glob("*.part"), *inside):
        if PARTIAL.fullmatch(file.name) and file.is_file():
            file.unlink(missing_ok=True)


def _record(number: int) -> str:
    return f"{RECORDS}/{number:06d}.json"


def _read(out: Path, number: int) -> dict | None:
    """Record of a finished model, or None."""
    try:
        record = json.loads((out / _record(number)).read_bytes())
        return record if isinstance(record["shards"], dict) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _whole(out: Path, record: dict) -> bool:
    """Whether all shards of a record are there, byte for byte."""
    try:
        return all(
            layout.digest((out / name).read_bytes()) == shard["sha256"]
            for name, shard in record["shards"].items()
        )
    except OSError:
        return False


def finish_model(out: str, shared: dict, number: int, record: dict, stacks: dict | None) -> dict:
    """Write the shards of a model, then the record that says so; the record as it is read back."""
    files = {} if stacks is None else layout.view_files(shared, number, stacks)
    layout.put(Path(out), files)
    shards = {n: {"bytes": len(d), "sha256": layout.digest(d)} for n, d in files.items()}
    data = layout.dumps({**record, "shards": shards})
    layout.put(Path(out), {_record(number): data})
    return json.loads(data)


def portable(error: Exception, root: str | None) -> str:
    """An error's message without the folder, which differs from one machine to the next."""
    return str(error).replace(f"{root}/", "").replace(str(root), ".") if root else str(error)


def _finish(out: Path, plan: dict, records: list[dict]) -> dict:
    """Gather the records into the manifest, and only then call the dataset complete."""
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
