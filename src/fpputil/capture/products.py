"""What a decoded capture leaves on disk: arrays, 16-bit pictures, points (chapter 12)."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from fpputil.capture.measurement import Measurement
from fpputil.decoding.triangulation import depth_of, triangulate
from fpputil.decoding.unwrap import TWO_PI
from fpputil.files import write_whole
from fpputil.optics.system import System

TOP = 65535
PLAIN = (cv2.IMWRITE_TIFF_COMPRESSION, 1)  # phases and modulations hardly shrink, and take long


def arrays(scan: Measurement) -> dict[str, np.ndarray]:
    """Arrays of a scan by name: float32 with NaN outside the mask, but for mask and reason."""
    inside = {"wrapped": scan.wrapped, "Phi": scan.Phi, "sigma": scan.sigma}
    inside["coordinate"] = scan.coordinate
    found = {k: np.where(scan.mask, v, np.nan).astype(np.float32) for k, v in inside.items()}
    found |= {"modulation": scan.modulation, "mask": scan.mask, "reason": scan.reason}
    return {f"{scan.axis}_{name}": value for name, value in found.items()}


def save_pictures(folder: Path, found: dict[str, np.ndarray]) -> dict[str, dict]:
    """Write floats as 16-bit TIFF: ``value = offset + scale level``, and level 0 has none.

    Masks become 0 and 255, reasons their numbers, in 8 bit.

    Parameters
    ----------
    folder : Path
    found : dict of (H, W) or (P, H, W) arrays
        A stack becomes a file of P pages.

    Returns
    -------
    dict
        Of each file its offset and scale.
    """
    scales = {}
    for name, values in found.items():
        if values.dtype.kind != "f":
            done, data = cv2.imencode(
                ".tif", values.astype(np.uint8) * (255 if values.dtype == bool else 1)
            )
            write_whole(folder / f"{name}.tif", data.tobytes())
            continue
        known = np.isfinite(values)
        low, high = (float(f(values[known])) if known.any() else 0.0 for f in (np.min, np.max))
        scale = (high - low) / (TOP - 1) or 1.0
        level = np.where(known, 1 + np.rint((np.where(known, values, low) - low) / scale), 0)
        pages = list(np.atleast_3d(level.astype(np.uint16)) if level.ndim == 3 else [level])
        pages = [np.ascontiguousarray(p, np.uint16) for p in pages]
        file = f"{name}.tif"
        done, data = cv2.imencodemulti(".tif", pages, PLAIN)
        write_whole(folder / file, data.tobytes())
        scales[file] = {"offset": low - scale, "scale": scale}
    return scales


def measured_points(scan: Measurement, system: System) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, depth and its uncertainty of a scan of vertical fringes. Chapter 12.

    Returns
    -------
    points : (H, W, 3) array
        World coordinates, mm; NaN outside the mask and the measuring range.
    depth, sigma : (H, W) arrays
        mm; sigma is that of the column, from noise alone, over ``|dcolumn/dz|``.
    """
    points = triangulate(scan.coordinate.astype(np.float64), system)
    depth = depth_of(points, system)
    with np.errstate(invalid="ignore"):
        outside = ~((depth >= system.z_min) & (depth <= system.z_max))
    points[outside], depth[outside] = np.nan, np.nan
    column = scan.sigma * (scan.fringes[scan.finest].pitch / TWO_PI)
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma = column / system.columns_per_mm(np.where(outside, system.z_min, depth))
    return points, depth, np.where(outside, np.nan, sigma)


def save_points(path: Path, points, colours, sigma) -> int:
    """Write the finite points as binary PLY with colour and `sigma`, mm, of each.

    Parameters
    ----------
    points : (H, W, 3) array
        mm.
    colours : (H, W, 3) uint8 array
        Red, green, blue.
    sigma : (H, W) array
        Standard deviation of the depth, mm.

    Returns
    -------
    int
        Number of points.

    Raises
    ------
    ValueError
        If no point is finite.
    """
    keep = np.isfinite(points).all(axis=-1) & np.isfinite(sigma)
    if not keep.any():
        raise ValueError("no point inside the measuring range; is the system the capture's own?")
    kinds = [(n, "<f4") for n in ("x", "y", "z", "sigma")]
    kinds += [(n, "u1") for n in ("red", "green", "blue")]
    out = np.empty(keep.sum(), kinds)
    for n, name in enumerate(("x", "y", "z")):
        out[name] = points[keep][:, n]
    out["sigma"] = sigma[keep]
    for n, name in enumerate(("red", "green", "blue")):
        out[name] = colours[keep][:, n]
    lines = [f"property {'uchar' if t == 'u1' else 'float'} {n}" for n, t in kinds]
    head = ["ply", "format binary_little_endian 1.0", "comment mm", f"element vertex {len(out)}"]
    write_whole(path, "\n".join([*head, *lines, "end_header\n"]).encode() + out.tobytes())
    return len(out)
