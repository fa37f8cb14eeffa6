"""Photographs stored beside the book, for machines without Blender."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from fpputil import probe
from fpputil.files import write_whole


def stored(path: str | os.PathLike, make: Callable[[], np.ndarray]) -> np.ndarray:
    """A photograph made anew where Blender works, else read from its file.

    Where Blender works and there is no such file yet, it is written. An existing file is left
    alone: to store a changed photograph, delete the file first.

    Parameters
    ----------
    path : str or Path
        Ends in ``.png``, for uint8 (H, W) or RGB (H, W, 3), or in ``.npz``, for any array.
    make : callable
        Takes nothing, returns the photograph.

    Returns
    -------
    array
        What `make` returns, or returned when the file was written.

    Raises
    ------
    FileNotFoundError
        If Blender does not run here and there is no such file.
    ValueError
        If the name ends in neither, or the file cannot be read.
    """
    path = Path(path)
    if path.suffix not in (".png", ".npz"):
        raise ValueError(f"{path} given; a stored photograph ends in .png or .npz")
    if probe.blender_works():
        image = make()
        if not path.exists():
            write_whole(path, _encoded(path, image))
        return image
    if not path.is_file():
        raise FileNotFoundError(
            f"{path} given; there is no such stored photograph, and Blender does not run here"
        )
    return _decoded(path)


def _encoded(path: Path, image: np.ndarray) -> bytes:
    if path.suffix == ".npz":
        buffer = io.BytesIO()
        np.savez_compressed(buffer, image=image)
        return buffer.getvalue()
    if image.dtype != np.uint8 or image.shape[2:] not in ((), (3,)):
        raise ValueError(
            f"a photograph of {image.dtype} {image.shape} given for {path}; a .png holds uint8, "
            "(H, W) or (H, W, 3); a .npz holds any"
        )
    return cv2.imencode(".png", image[..., ::-1] if image.ndim == 3 else image)[1].tobytes()


def _decoded(path: Path) -> np.ndarray:
    if path.suffix == ".npz":
        try:
            with np.load(path) as file:
                return file["image"]
        except (OSError, KeyError, ValueError, zipfile.BadZipFile, EOFError) as error:
            raise ValueError(f"{path} given; it holds no stored photograph ({error})") from error
    image = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ValueError(f"{path} given; it holds no picture")
    return image[..., ::-1] if image.ndim == 3 else image
