"""A file, changed at random: its bytes, or its structure."""

import copy
import json
import math
import tomllib
from pathlib import Path

DEEP = b"[" * 100_000
VALUES = (None, True, -1, 0, 1.5, 1e308, 10**20, math.nan, "x", "1.0", "", [], {}, [[[]], 1], 1e-9)


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
