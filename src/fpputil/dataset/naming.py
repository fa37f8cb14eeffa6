"""Which dataset results are about, on whatever processor it was made (chapter 10)."""

from __future__ import annotations

from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from fpputil.dataset.store import Store
from fpputil.dataset.synthfringe import SynthFringe

VIEWS = "views.npz"
"""File beside results: "data", the name of their dataset, and the truth of some of its test views,
NUMBER-mask, NUMBER-Phi and so on."""

ROUNDED = {"mask": 0, "Phi": 1e-3, "modulation": 0.1}  # radians, grey levels
FEW = 1e-3
"""Views are the same if no more than this share of their pixels, 0 to 1, differs by more than
`ROUNDED`: the last bit of a phase may carry a grey level or the edge of a mask with it."""


def dataset_name(store: Store, path: Path) -> str:
    """Checksum by which results name a dataset.

    It is the dataset's own, unless its test views are, rounding apart, those that a file `VIEWS`
    keeps: then it is the one named there. Another kind of processor rounds the last bit of some
    phases otherwise, and a single bit makes another checksum.

    Parameters
    ----------
    store : Store
        The dataset.
    path : Path
        The file `VIEWS`, there or not.

    Raises
    ------
    ValueError
        If the file is cut or of something else.
    """
    content = store.manifest["content"]
    if not path.is_file():
        return content
    try:
        with np.load(path, allow_pickle=False) as file:
            kept = dict(file)
        name = str(kept.pop("data"))
        numbers = {key.split("-")[0] for key in kept}
        if not numbers:
            raise ValueError("no view in it")
        views = {n: {k: kept[f"{n}-{k}"] for k in ROUNDED} for n in numbers}
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise ValueError(f"{path} keeps no test views ({error}); remove it") from error
    return name if name == content or _has(store, views) else content


def _has(store: Store, views: dict[str, dict[str, np.ndarray]]) -> bool:
    seen = SynthFringe(store.path, "test")
    place = {str(number): k for k, number in enumerate(seen.indices)}
    return views.keys() <= place.keys() and all(_same(seen[place[n]], v) for n, v in views.items())


def _same(item: dict, kept: dict[str, np.ndarray]) -> bool:
    if item["mask"].shape != kept["mask"].shape:
        return False
    near = [abs(item[k].numpy().astype(float) - kept[k]) <= most for k, most in ROUNDED.items()]
    return np.all(near, axis=0).mean() >= 1 - FEW
