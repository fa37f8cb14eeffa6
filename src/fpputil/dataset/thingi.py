"""Thingi10K on disk, as the package ``thingi10k`` keeps it, and its download."""

from __future__ import annotations

import os
from pathlib import Path

from fpputil.optics.shapes import formats

_LAYOUTS = (
    "thingi10k_npz_extracted/npz",
    "thingi10k_raw_extracted/Thingi10K/raw_meshes",
)
_CORRUPT = {49911, 74463, 77942, 286163}  # the package leaves these out as well


def default_cache() -> Path:
    """Where the package keeps its files unless told otherwise."""
    home = os.environ.get("XDG_CACHE_HOME", "~/.cache")
    home = os.environ.get("HF_HOME", os.path.join(home, "huggingface"))
    return Path(os.environ.get("HF_DATASETS_CACHE", os.path.join(home, "datasets"))).expanduser()


def found(cache: Path, fetch: bool) -> Path:
    """Folder of the files in the cache, after a download if there is none and ``fetch``.

    Raises
    ------
    FileNotFoundError
        If there is none.
    ImportError, RuntimeError
        As from `download`.
    """
    if fetch and unpacked(cache) is None:
        download(cache)
    root = unpacked(cache)
    if root is None:
        raise FileNotFoundError(
            f"{cache} does not hold Thingi10K; `pip install 'fpputil[thingi10k]'`, then ask for "
            "the download (--download), which takes some gigabytes"
        )
    return root


def unpacked(cache: Path) -> Path | None:
    """Folder of the files, NPZ before raw, if the package has marked them as complete."""
    for layout in _LAYOUTS:
        root = cache / layout
        if root.is_dir() and (cache / Path(layout).parts[0] / ".complete").is_file():
            return root
    return None


def ids(root: Path) -> dict[str, int]:
    """File name: number of the model, in the order of the numbers."""
    first = {}
    for name in sorted(os.listdir(root)):
        stem, _, suffix = name.rpartition(".")
        if stem.isascii() and stem.isdigit() and suffix.lower() in formats():
            first.setdefault(int(stem), name)
    return {first[number]: number for number in sorted(first.keys() - _CORRUPT)}


def download(cache: Path) -> None:
    """Have the package download the NPZ files and unpack them into the cache.

    Raises
    ------
    ImportError
        If the package is not installed.
    RuntimeError
        If it fails.
    """
    try:
        import thingi10k
    except ImportError as error:
        raise ImportError(
            f"the package thingi10k does not load ({error}); `pip install 'fpputil[thingi10k]'`"
        ) from error
    try:
        thingi10k.init(variant="npz", cache_dir=str(cache))
    except Exception as error:  # whatever the package, the hub or the network raises
        if unpacked(cache) is None:
            why = " ".join(str(error).split())
            raise RuntimeError(
                f"Thingi10K could not be downloaded ({why}); a connection to huggingface.co and "
                f"room for some gigabytes in {cache} are needed"
            ) from error
