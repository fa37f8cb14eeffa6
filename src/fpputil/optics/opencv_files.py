"""Systems of others: K, D, R and T as OpenCV's samples and their kin write them (chapter 12)."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

LONGEST = 20_000  # letters of a file: OpenCV falls into brackets without end
LEAST = 1.0  # mm between camera and projector, under which T is in another unit
NEARLY = 1e-3  # of a rotation's entries, written with few digits

CAMERA, PROJECTOR = ("1", "cam", "cam1", "camera"), ("2", "proj", "pro", "cam2", "projector")
MATRIX = ("k", "m", "cm", "mtx", "cameramatrix", "intrinsics", "intrinsicmatrix", "intrinsic")
DISTORTION = ("d", "kc", "dist", "distortion", "distorsion", "distcoeffs", "distcoeff",
              "distcoef", "distortioncoefficients")  # fmt: skip
SIZE = ("size", "imagesize", "resolution")
ALONE = {
    "camera": {"K": ("cameramatrix",), "D": ("distortioncoefficients",), "size": ("imagesize",)}
}
ROTATION = ("r", "rotation", "rotationmatrix", "projectorr", "projr")
TRANSLATION = ("t", "translation", "translationvector", "projectort", "projt")
NUMBERS = {"K": (9,), "D": (4, 5, 8, 12, 14), "size": (2,), "R": (3, 9), "T": (3,)}
NUMBERS |= dict.fromkeys(("width", "height"), (1,))
"""Of what is looked for how many numbers it may have: k1 may be a matrix or a coefficient."""


def read_entries(path: Path) -> dict[str, np.ndarray]:
    """Numbers and matrices of an OpenCV YAML or XML file or of JSON, by their names.

    A name inside another one follows it: ``camera_K``.

    Raises
    ------
    ValueError
        If the file is none of them, or is longer than files of matrices are.
    """
    text = path.read_text(encoding="utf-8-sig")
    if len(text) > LONGEST:
        raise ValueError(f"{len(text)} letters; at most {LONGEST} are read: keep K, D, R, T")
    if path.suffix.lower() == ".json":
        return dict(_of_json(json.loads(text)))
    if not text.lstrip().startswith(("%YAML", "<?xml")):
        text = f"%YAML:1.0\n---\n{text}"
    store = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    return dict(_of_node(store.root()))


def _of_json(value, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    if isinstance(value, dict) and not {"rows", "data"} <= set(value):
        for key, entry in value.items():
            yield from _of_json(entry, f"{name}_{key}" if name else key)
        return
    if isinstance(value, dict):
        value = np.reshape(value["data"], (int(value["rows"]), -1)).tolist()
    numbers = np.array(value, object)
    if numbers.size and all(isinstance(n, int | float) for n in numbers.ravel()):
        yield name, numbers.astype(np.float64)


def _of_node(node, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    if node.isMap() and "dt" in node.keys():
        yield name, np.asarray(node.mat(), np.float64)
    elif node.isMap() and {"rows", "data"} <= set(node.keys()):
        (_, data), rows = *_of_node(node.getNode("data")), int(node.getNode("rows").real())
        yield name, data.reshape(rows, -1)
    elif node.isMap():
        for key in node.keys():
            yield from _of_node(node.getNode(key), f"{name}_{key}" if name else key)
    elif node.isSeq():
        parts = [value for k in range(node.size()) for _, value in _of_node(node.at(k))]
        if parts and len({part.shape for part in parts}) == 1:
            yield name, np.stack(parts)
    elif node.isInt() or node.isReal():
        yield name, np.array(node.real())


def matrices_of(entries: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """K, D and size of camera and projector, and R and T, out of entries by any usual name.

    >>> entries = {"M1": np.eye(3), "D1": np.zeros(5), "proj_K": np.eye(3), "T": np.ones(3)}
    >>> list(matrices_of(entries))
    ['camera K', 'camera D', 'projector K', 'T']
    """
    plain = {re.sub(r"[^a-z0-9]", "", name.lower()): value for name, value in entries.items()}
    wanted = {}
    for who, marks in (("camera", CAMERA), ("projector", PROJECTOR)):
        for what, names in (("K", MATRIX), ("D", DISTORTION), ("size", SIZE)):
            each = [name for n in names for m in marks for name in (n + m, m + n)]
            wanted[f"{who} {what}"] = (*each, *ALONE.get(who, {}).get(what, ()))
        for side in ("width", "height"):
            each = [name for m in marks for name in (side + m, m + side, f"image{side}{m}")]
            wanted[f"{who} {side}"] = (*each, f"image{side}") if who == "camera" else tuple(each)
    wanted |= {"R": ROTATION, "T": TRANSLATION}
    found = {}
    for role, names in wanted.items():
        for name in names:
            fits = name in plain and plain[name].size in NUMBERS[role.split()[-1]]
            if fits and role not in found and np.isfinite(plain[name]).all():
                found[role] = plain[name]
    for who in ("camera", "projector"):
        sides = [found.pop(f"{who} {side}", None) for side in ("width", "height")]
        if None not in [side if side is None else 0 for side in sides]:
            found.setdefault(f"{who} size", np.array(sides))
    return found


def missing_of(matrices: dict[str, np.ndarray]) -> list[str]:
    """What a system needs and these matrices do not say; distortion may be absent."""
    needed = ("camera K", "projector K", "R", "T", "camera size", "projector size")
    return [role for role in needed if role not in matrices]


def rotation_of(R: np.ndarray) -> np.ndarray:
    """Rotation, (3, 3), of a matrix written with few digits, or of a rotation vector."""
    if R.size == 3:
        return Rotation.from_rotvec(R.ravel()).as_matrix()
    if R.shape != (3, 3) or np.linalg.det(R) <= 0:
        raise ValueError(f"R {R.tolist()} given; a (3, 3) rotation or its vector is needed")
    nearest = Rotation.from_matrix(R).as_matrix()
    if np.abs(nearest - R).max() > NEARLY:
        raise ValueError(f"R {R.tolist()} given; a rotation is orthonormal with det +1")
    return nearest
