"""The files of a SynthFringe dataset: a manifest and Zarr arrays, one shard a model (chapter 7).

A view takes little room because no photograph is kept: column, shade, depth and mask say what
every pattern would look like. Zarr v3 shards keep one file an array and model, so that one writer
owns it whole; a CRC in every chunk makes a damaged one an error instead of a measurement.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import zarr
from numcodecs import blosc
from numcodecs.checksum32 import CRC32C
from zarr.codecs import BloscCodec, Crc32cCodec
from zarr.storage import MemoryStore

from fpputil.checks import (
    anything,
    conform,
    finite,
    natural,
    one_line,
    one_or_more,
    or_null,
    parse_json,
    positive,
    text,
)
from fpputil.files import write_whole
from fpputil.optics.system import FORM as SYSTEM
from fpputil.optics.system import PITCHES

FORMAT, VERSION = "SynthFringe", 1
MANIFEST, LOCK = "manifest.json", ".lock"
PLAN = ("settings", "system", "pitches", "frames", "models")
"""Entries of a manifest that decide what the dataset holds."""

SPLITS = ("training", "validation", "test", "held-out")
NO_CHUNK = 2**64 - 1  # Zarr's mark of an empty chunk
blosc.use_threads = False  # pictures are small, and threads do not survive the fork of a worker


def _split(name: str, value) -> None:
    if value not in SPLITS:
        raise ValueError(f"{name} {value!r} given; the splits are {', '.join(SPLITS)}")


SHARD = {"bytes": natural, "sha256": text}
RECORD = {"shards": {...: SHARD}, "lit": [natural], "white": natural, "notes": [text]}
VIEWS = {"lit": [natural], "pose": [(finite, finite)], "noise_seed": [natural]}
FORM = {
    "settings": {
        "preset": text,
        **dict.fromkeys(("models", "views", "least"), one_or_more),
        ...: anything,
    },
    "system": SYSTEM,
    "pitches": PITCHES,
    "frames": [{"pitch": positive, "steps": one_or_more}],
    "models": [{"name": text, "split": _split, ...: anything}],
    "versions": {...: text},
    "records": [{**RECORD, ...: anything}],
    "extremes": or_null((finite, finite)),
    "content": text,
    ...: anything,
}
"""Of a finished manifest; of `VIEWS` records hold one each a view, if they do."""

KINDS = {"column": "float32", "shade": "float16", "depth": "float32", "mask": "bool"}
"""Arrays of a view and their types. A shade of float16 is good to 1 part in 2000, a tenth of a
grey level; a column needs all of float32."""


def dumps(data) -> bytes:
    """JSON as every file of a dataset holds it: the same data give the same bytes."""
    return (json.dumps(data, indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode(
        errors="surrogatepass"  # a name that is not UTF-8
    )


def digest(data: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def put(path: Path, files: dict[str, bytes]) -> None:
    """Write files below the dataset, each whole or not at all."""
    for name, data in files.items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        write_whole(path / name, data)


def arrays(manifest: dict) -> dict[str, tuple[str, float, tuple[int, ...]]]:
    """Type, value of an empty pixel and (models, views, [photographs,] H, W) of each array."""
    camera, settings = manifest["system"]["camera"], manifest["settings"]
    views, image = (settings["models"], settings["views"]), (camera["height"], camera["width"])
    number = sum(f["steps"] for f in manifest["frames"])  # of photographs, if they were imported
    kinds = {k: (t, np.nan if t == "float32" else 0, views + image) for k, t in KINDS.items()}
    return kinds | ({"frames": ("uint8", 0, (*views, number, *image))} if number else {})


def empty_stacks(manifest: dict) -> dict[str, np.ndarray]:
    """Arrays (V, ...) of one model without anything to see."""
    return {k: np.full(shape[1:], empty, t) for k, (t, empty, shape) in arrays(manifest).items()}


def view_files(manifest: dict, at: int, stacks: dict[str, np.ndarray]) -> dict[str, bytes]:
    """Shards of model `at`, path to content, of (V, ...) arrays by name; none of an empty one."""
    return {k: v for k, v in _files(manifest, at, stacks).items() if "/c/" in k}


def metadata_files(manifest: dict) -> dict[str, bytes]:
    """The arrays' metadata, path to content, so that any Zarr reader finds them."""
    group = {"zarr_format": 3, "node_type": "group", "attributes": {}}
    files = {k: v for k, v in _files(manifest).items() if k.endswith("/zarr.json")}
    return {"zarr.json": dumps(group), **files}


def _files(manifest: dict, at: int = 0, stacks=()) -> dict[str, bytes]:
    """What Zarr writes of all arrays that hold the views of model `at`: path to content."""
    files = {}
    for name, (dtype, empty, (models, views, *rest)) in arrays(manifest).items():
        array = zarr.create_array(
            MemoryStore(files),
            name=name,
            shape=(models * views, *rest),
            shards=(views, *rest),
            chunks=(1, *rest),
            dtype=dtype,
            fill_value=empty,
            compressors=[BloscCodec(cname="zstd", clevel=3, shuffle="shuffle"), Crc32cCodec()],
            dimension_names=("view", "frame", "v", "u") if len(rest) == 3 else ("view", "v", "u"),
        )
        if name in stacks:
            array[at * views : (at + 1) * views] = stacks[name]
    return {k: v.to_bytes() for k, v in files.items()}


def read_array(path: Path, manifest: dict, name: str, number: int, view: int) -> np.ndarray:
    """One array of one view of model `number`; an error if its shard is missing or damaged.

    Zarr's sharding codec ends a shard with the offset and size of every chunk, and a CRC. The
    Zarr library takes 3 ms to come to a chunk, ten times what is in it; a test holds both equal.
    """
    dtype, empty, (_, views, *shape) = arrays(manifest)[name]
    image = np.full(shape, empty, dtype)
    with path.joinpath(shard_name(manifest, name, number)).open("rb") as shard:
        end = shard.seek(-(16 * views + 4), 2)
        offset, size = map(int, _checked(shard.read()).view("<u8").reshape(views, 2)[view])
        if size == NO_CHUNK:
            return image
        if offset + size > end:
            raise ValueError(f"a chunk at {offset} of {size} bytes in a shard of {end}")
        shard.seek(offset)
        data = _checked(shard.read(size)).tobytes()
    held, length = (int.from_bytes(data[k : k + 4], "little") for k in (4, 12))  # by Blosc's head
    if (held, length) != (image.nbytes, len(data)):
        raise ValueError(f"a chunk of {held} bytes in {length}, not {image.nbytes} in {len(data)}")
    blosc.decompress(data, image)
    return image


def shard_name(manifest: dict, name: str, number: int) -> str:
    """File, below the dataset, of an array's views of model `number`."""
    return "/".join([name, "c", str(number), *["0"] * (len(arrays(manifest)[name][2]) - 2)])


def _checked(data: bytes) -> np.ndarray:
    """Bytes without the CRC at their end."""
    try:
        return CRC32C(location="end").decode(data)
    except RuntimeError:
        raise ValueError("its CRC is wrong") from None


def lit_and_white(stacks: dict[str, np.ndarray], least: int) -> dict:
    """What a record says of its views: lit pixels of each, and the brightest grey level of all."""
    lit = stacks["mask"].sum(axis=(1, 2))
    if "frames" in stacks:
        white = stacks["frames"].max()
    else:
        white = np.rint(255 * float(stacks["shade"][lit >= least].max(initial=0))).clip(max=255)
    return {"lit": lit.tolist(), "white": int(white)}


def content(records: Sequence[dict]) -> str:
    """One SHA-256 for all shards of a dataset, out of the records of its models."""
    lines = [f"{s['sha256']}  {name}" for r in records for name, s in sorted(r["shards"].items())]
    return digest("\n".join(lines).encode())


def plan_name(manifest: dict) -> str:
    """SHA-256 of what decides the content of a dataset, numbers to nine decimals."""
    plan = dumps({name: manifest[name] for name in PLAN})
    return digest(dumps(json.loads(plan, parse_float=lambda x: round(float(x), 9) + 0.0)))


def read_manifest(path: str | Path) -> dict:
    """Manifest of a dataset, finished or not; an error if it is none, damaged, or too new."""
    path = Path(path)
    if not path.is_dir():
        raise FileNotFoundError(f"{path} given; there is no such folder, a dataset is one")
    try:
        form = {"format": anything, "version": anything, ...: anything}
        manifest = parse_json((path / MANIFEST).read_bytes(), form)
    except FileNotFoundError:
        raise ValueError(f"{path} holds no {MANIFEST}; it is not a dataset") from None
    except ValueError as error:
        raise ValueError(damaged(path, error)) from error
    kind, version = manifest["format"], manifest["version"]
    if kind != FORMAT or version != VERSION:
        needed = f"{FORMAT!r} {VERSION} is needed, newer ones are read by a newer library"
        raise ValueError(f"{path} is of format {kind!r} {version}; {needed}")
    return manifest


def check_manifest(manifest: dict) -> None:
    """ValueError that names the entry which a finished manifest lacks, or has otherwise."""
    conform("", manifest, FORM)
    settings, records = manifest["settings"], manifest["records"]
    lengths = [settings["models"], len(manifest["models"]), len(records)]
    if len(set(lengths)) > 1:
        raise ValueError("settings.models {}, {} models, {} records".format(*lengths))
    for number, record in enumerate(records):
        for name in VIEWS.keys() & record.keys():
            conform(f"records.{number}.{name}", record[name], VIEWS[name])
            if (held := len(record[name])) != settings["views"]:
                raise ValueError(f"{held} entries in records.{number}.{name}")
    if (held := len(manifest["frames"])) not in (0, len(PITCHES)):
        raise ValueError(f"{held} entries in frames")


def damaged(path: Path, error: Exception) -> str:
    """How a dataset is refused whose manifest is not whole."""
    return f"{path / MANIFEST} is damaged ({one_line(error)}); generate anew"
