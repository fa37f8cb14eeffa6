"""Reading a finished SynthFringe dataset, view by view, and checking its files (chapter 7)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from fpputil.dataset import layout
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import System, system_from_dict
from fpputil.optics.view import View


@dataclass(frozen=True, eq=False)
class Store:
    """A finished dataset, read view by view: its folder, and its manifest."""

    path: Path
    manifest: dict

    @cached_property
    def name(self) -> str:
        """Name of the dataset: SHA-256 of its plan, the same on whatever processor it was made."""
        return layout.plan_name(self.manifest)

    @property
    def checksum(self) -> str:
        """SHA-256 of all its shards; another processor may round the last bit of a phase."""
        return self.manifest["content"]

    @cached_property
    def system(self) -> System:
        """Camera, projector and measuring range of all views."""
        return system_from_dict(self.manifest["system"])

    @cached_property
    def fringes(self) -> tuple[Fringe, ...]:
        """Fringes of the stored photographs; none if frames are synthesised from the view."""
        return tuple(Fringe(f["pitch"], f["steps"]) for f in self.manifest["frames"])

    @cached_property
    def _rays(self) -> np.ndarray:
        return self.system.camera.rays()

    @cached_property
    def _indices(self) -> dict[str, list[int]]:
        """Numbers of the views that show enough of their model, by split."""
        settings, indices = self.manifest["settings"], {split: [] for split in layout.SPLITS}
        pairs = zip(self.manifest["models"], self.manifest["records"], strict=True)
        for number, (model, record) in enumerate(pairs):
            lit = np.flatnonzero(np.array(record["lit"]) >= settings["least"])
            indices[model["split"]] += (number * settings["views"] + lit).tolist()
        return indices

    def splits(self) -> list[str]:
        """Names of the splits that have a view to show."""
        return [split for split in layout.SPLITS if self._indices[split]]

    def indices(self, split: str) -> np.ndarray:
        """Numbers of the views of a split that show enough of their model, (n,) int."""
        if split not in layout.SPLITS:
            raise ValueError(f"split {split!r} given; the splits are {', '.join(layout.SPLITS)}")
        if not self._indices[split]:
            raise ValueError(f"{self.path} holds no view of the split {split!r}")
        return np.array(self._indices[split])

    def _place(self, index: int) -> tuple[int, int]:
        """Model and pose of a view; ValueError if there is no such view."""
        models, views = (self.manifest["settings"][k] for k in ("models", "views"))
        if not 0 <= index < models * views:
            raise ValueError(f"view {index} given; {self.path} has views 0 to {models * views - 1}")
        return divmod(int(index), views)

    def array(self, name: str, index: int) -> np.ndarray:
        """One array of one view, (H, W) or for "frames" (F, H, W)."""
        place = self._place(index)
        try:
            return layout.read_array(self.path, self.manifest, name, *place)
        except (OSError, ValueError, RuntimeError) as error:
            raise ValueError(
                f"{name} of view {index} in {self.path} cannot be read "
                f"({type(error).__name__}: {error}); run: fpp dataset check {self.path}"
            ) from error

    def view(self, index: int) -> View:
        """What the camera sees in view `index`; photograph it under any pattern."""
        mask = self.array("mask", index)
        if not mask.any():
            raise ValueError(
                f"view {index} in {self.path} is empty: its model shows nothing there, or its "
                f"shard is missing; run: fpp dataset check {self.path}"
            )
        column, shade, depth = (self.array(n, index) for n in ("column", "shade", "depth"))
        camera, projector = self.system.camera, self.system.projector
        local = self._rays[mask] @ camera.R.T
        points = (local * (depth[mask] / local[:, 2])[:, None] - camera.t) @ camera.R
        row = np.full(mask.shape, np.nan, np.float32)
        row[mask] = projector.project(points)[:, 1]
        return View(column, row, shade.astype(np.float32), depth, mask)

    def photographs(self, index: int, fringes: Sequence[Fringe], noise: float = 0.0) -> np.ndarray:
        """Frames of view `index`, (N, H, W) uint8: synthesised, or the stored ones."""
        if not self.fringes:
            return self.view(index).frames(fringes, noise, self.describe(index)["noise_seed"])
        if noise:
            raise ValueError(f"noise {noise} given; {self.path} holds photographs as they are")
        wanted = [self.position(f, n) for f in fringes for n in range(f.steps)]
        return self.array("frames", index)[wanted]

    def position(self, fringe: Fringe, step: int) -> int:
        """Position of a photograph among the stored ones: equal pitch, equal shift."""
        shots = ((stored.pitch, shift) for stored in self.fringes for shift in stored.shifts)
        for place, (pitch, shift) in enumerate(shots):
            if pitch == fringe.pitch and math.isclose(shift, fringe.shifts[step], abs_tol=1e-8):
                return place
        raise ValueError(
            f"step {step} of {fringe.steps} at pitch {fringe.pitch} asked for; {self.path} holds "
            f"{[(f.pitch, f.steps) for f in self.fringes]} (pitch, steps)"
        )

    def describe(self, index: int) -> dict:
        """Model, split, pose (degrees about the paper's y and z) and noise seed of view `index`."""
        number, view = self._place(index)
        record = self.manifest["records"][number]
        drawn = {k: record[k][view] for k in ("pose", "noise_seed") if k in record}
        return {**self.manifest["models"][number], "number": number, **drawn}


def open_store(path: str | Path) -> Store:
    """A finished dataset; ValueError if it is not finished, damaged or too new. Chapter 7.

    >>> store = open_store("data/tiny")  # the one that ships with the book
    >>> store.splits(), len(store.indices("training"))
    (['training', 'validation', 'test', 'held-out'], 64)
    >>> store.view(0).mask.shape
    (120, 160)
    """
    store = _finished(path)
    try:
        _check(store)
    except ValueError as error:
        raise ValueError(layout.damaged(store.path, error)) from error
    return store


def _finished(path: str | Path) -> Store:
    path, manifest = Path(path), layout.read_manifest(path)
    if not manifest.get("complete"):
        raise ValueError(
            f"{path} is not finished; run the command that generates it again, it goes on"
        )
    return Store(path, manifest)


def _check(store: Store) -> None:
    """ValueError unless a manifest is whole, with a system and fringes that can be."""
    layout.check_manifest(store.manifest)
    _ = store.system, store.fringes


def check_files(path: str | Path) -> list[str]:
    """What is wrong with the files of a finished dataset, one line a fault. Chapter 7.

    Shards are held against their records, records against shards and seeds, and the arrays'
    metadata, which serve other readers, against what the same version of Zarr writes.

    >>> check_files("data/tiny")
    []
    """
    from fpputil.dataset.generation import complete, faults

    store = _finished(path)
    manifest, wrong, changed = store.manifest, [], "not as it was written"
    try:
        _check(store)
        for number, record in enumerate(manifest["records"]):
            wrong += faults(store.path, manifest, number, record)
        if not wrong and complete(store.path, manifest, manifest["records"]) != manifest:
            wrong.append(f"{layout.MANIFEST}: {changed}")
        shards = {name for record in manifest["records"] for name in record["shards"]}
        same = manifest["versions"]["zarr"] == layout.zarr.__version__
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        return [f"{layout.MANIFEST}: {changed} ({type(error).__name__}: {error})"]
    metadata = layout.metadata_files(manifest)
    for name, data in metadata.items():
        file = store.path / name
        if not file.is_file():
            wrong.append(f"{name}: missing")
        elif same and file.read_bytes() != data:
            wrong.append(f"{name}: {changed}")
    known = {*metadata, *shards, layout.MANIFEST, layout.LOCK}
    names = {f.relative_to(store.path).as_posix() for f in store.path.rglob("*") if f.is_file()}
    return wrong + [f"{name}: not part of the dataset" for name in sorted(names - known)]
