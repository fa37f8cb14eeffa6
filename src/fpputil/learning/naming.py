"""Which dataset results are about, on whatever processor it was made (chapter 10)."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from fpputil.learning.store import open_store
from fpputil.learning.synthfringe import SynthFringe

VIEWS = "views.npz"
"""File beside results with the truth of some test views: NUMBER-mask, NUMBER-Phi and so on."""

ROUNDED = {"mask": 0, "Phi": 1e-3, "modulation": 0.1}  # radians, grey levels
FEW = 1e-3
"""Views are the same if no more than this share of their pixels, 0 to 1, differs by more than
`ROUNDED`: the last bit of a phase may carry a grey level or the edge of a mask with it."""


def read_json(path: Path, *needed: str) -> dict:
    """A JSON file of results; ValueError with its path if it is cut or lacks what is needed."""
    try:
        found = json.loads(path.read_text())
        if lacking := [name for name in needed if name not in found]:
            raise ValueError(f"no {lacking[0]} in it")
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path} is no file of results ({error}); remove it") from error
    return found


def dataset_name(data: str | Path, files: Iterable[Path], views: Path) -> str:
    """Checksum by which results name a dataset.

    It is the dataset's own, unless there are results already and the test views beside them are
    these, rounding apart: then it is the one that they name. Another kind of processor rounds the
    last bit of some phases otherwise, and a single bit makes another checksum.

    Parameters
    ----------
    data : path
        A dataset.
    files : iterable of Path
        Files of results, there or not; the first that is there counts.
    views : Path
        The file `VIEWS` beside them, there or not.
    """
    content = open_store(data).manifest["content"]
    named = next((read_json(file, "data")["data"] for file in files if file.is_file()), content)
    return named if named == content or same_views(data, views) else content


def same_views(data: str | Path, path: Path) -> bool:
    """Whether a dataset has, rounding apart, the test views that a file `VIEWS` keeps.

    Raises
    ------
    ValueError
        If the file is cut or of something else.
    """
    if not path.is_file():
        return False
    seen = SynthFringe(data, "test")
    place = {str(number): k for k, number in enumerate(seen.indices)}
    try:
        with np.load(path, allow_pickle=False) as file:
            kept = {name: file[name] for name in file}
        numbers = {name.split("-")[0] for name in kept}
        views = {n: {k: kept[f"{n}-{k}"] for k in ROUNDED} for n in numbers}
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise ValueError(f"{path} keeps no test views ({error}); remove it") from error
    return numbers <= set(place) and all(_same(seen[place[n]], v) for n, v in views.items())


def _same(item: dict, kept: dict[str, np.ndarray]) -> bool:
    if item["mask"].shape != kept["mask"].shape:
        return False
    near = [abs(item[k].numpy().astype(float) - kept[k]) <= most for k, most in ROUNDED.items()]
    return np.all(near, axis=0).mean() >= 1 - FEW
