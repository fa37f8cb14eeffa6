"""A folder of photographs to a folder of results: what `fpp decode` does (chapter 12)."""

from __future__ import annotations

import json
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tifffile
from tqdm.std import tqdm

from fpputil.calibration import Pose
from fpputil.capture.depth import diagnose_points, locate, trusted
from fpputil.capture.faults.diagnosis import diagnose, mirrored, of_files
from fpputil.capture.faults.findings import MOUNTED, Finding
from fpputil.capture.measurement import Measurement, measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.relief import (
    DEGREES,
    largest_part,
    phase_difference,
    remove_ground,
    save_relief,
)
from fpputil.capture.unwrapping import check_projector, check_size
from fpputil.decoding.triangulation import depth_of
from fpputil.files import folder_whole
from fpputil.optics.system import System

SPECK = 25  # pixels of a part of the picture that is left out of the points if it has fewer
BRIDGE = 8.0  # times the usual edge of a triangle, above which one bridges a step in depth


@dataclass(frozen=True, eq=False)
class DecodedFolder:
    """What became of a folder of photographs.

    Parameters
    ----------
    out, summary : Path and dict
        Where the results lie; what ``summary.json`` says, under ``decoded`` whether phases do.
    measurements, findings : tuples of Measurement and Finding
        Of each axis of the patterns; what speaks against them.
    points : (H, W, 3) array or None
        World coordinates, mm; NaN outside mask and measuring range. None without a system, or if
        the phases or the points are wrong.
    """

    out: Path
    summary: dict
    measurements: tuple[Measurement, ...]
    findings: tuple[Finding, ...]
    points: np.ndarray | None


def decode_folder(
    folder: str | Path,
    out: str | Path | None = None,
    system: System | None = None,
    *,
    patterns: Patterns | None = None,
    full: float | None = None,
    channel: str = "grey",
    accept: bool = False,
    reference: str | Path | None = None,
    relief: str | None = None,
    report: bool = True,
    pictures: bool = True,
    mesh: bool = False,
    min_area: int = SPECK,
    lone: float | None = None,
    max_sigma: float | None = None,
    force: bool = False,
    progress: bool = False,
    **how,
) -> DecodedFolder:
    """Decode a folder of photographs into a new folder, as `fpp decode` does. Chapter 12.

    ``decoded.npz`` holds the arrays of `Measurement.arrays`, and with a system ``depth`` and
    ``depth_sigma``, mm; a TIFF file each the same. ``points.ply`` holds the points. If a finding
    is severe, only ``report.html`` and ``summary.json`` are written.

    Parameters
    ----------
    folder, out : path
        Photographs, and a new folder; by default ``FOLDER-decoded``.
    system : System, optional
        For points and depths, and the minimum phase.
    patterns, full, channel, **how
        As of `open_capture`; threshold, gamma and noise as of `measure`.
    reference : path, optional
        Photographs of a plane under the same patterns; the difference of the phases is written.
    relief : {"plane", "cubic"}, optional
        Write the phase (or that difference) less a plane or a cubic ground, as a picture and a
        mesh: a shape without a calibration, in radians.
    accept, report, pictures, mesh, force, progress : bool
        Write phases although they are wrong; write ``report.html``; write TIFF files; write
        ``mesh.ply``; take the place of an earlier decoding; show a bar in a terminal.
    min_area, lone, max_sigma
        Of the points, as of `clean_points`.

    Raises
    ------
    ValueError
        As of `open_capture`, `measure` and `folder_whole`, or if there is no point to write.

    Examples
    --------
    >>> import tempfile
    >>> from fpputil.capture import Patterns, photograph_into
    >>> from fpputil.optics import fringe_set, preset, raycast, shapes
    >>> system = preset("tiny").system
    >>> view = raycast(shapes.sphere(100, [0, 0, 660]), system)
    >>> patterns = Patterns((912, 1140), fringe_set((912, 114, 24), 4))
    >>> with tempfile.TemporaryDirectory() as room:
    ...     photograph_into(f"{room}/shots", view, patterns, system)
    ...     result = decode_folder(f"{room}/shots", f"{room}/out", system, report=False)
    ...     sorted(path.name for path in result.out.iterdir())[-3:]
    ['depth_sigma.tif', 'points.ply', 'summary.json']
    >>> result.summary["decoded"], result.points.shape
    (True, (120, 160, 3))
    """
    start, folder = time.perf_counter(), Path(folder)
    capture = open_capture(folder, patterns, full, channel)
    plane = None
    if reference is not None:
        plane = open_capture(reference, capture.patterns, full, channel)
    if plane is not None and plane.size != capture.size:
        raise ValueError(
            f"{reference} has photographs of {plane.size[1]} x {plane.size[0]}, {folder} of "
            f"{capture.size[1]} x {capture.size[0]}; the camera must stay the same"
        )
    if relief not in (None, *DEGREES):
        raise ValueError(f"relief {relief!r} given; one of {', '.join(DEGREES)} is needed")
    if system is not None:
        if capture.patterns.unwrap == "spatial":
            raise ValueError("a system given; a phase that is unwrapped in space gives no points")
        check_size(system, capture.size)
        check_projector(system, capture.patterns.projector)
    if folder.name in ("", ".."):  # which name no folder
        folder = Path(os.path.abspath(folder))
    out = folder.with_name(f"{folder.name}-decoded") if out is None else Path(out)
    with folder_whole(out, "fpp decode", force, [folder]) as partial:
        axes, total = capture.patterns.axes, sum(f.steps for f in capture.patterns.fringes)
        quiet = None if progress else True
        with tqdm(total=total, unit="photo", leave=False, disable=quiet) as bar:
            how |= {"system": system, "each": bar.update}
            measurements = tuple(measure(capture, axis, **how) for axis in axes)
        findings = (*_findings(measurements, capture, system), *of_files(capture))
        planes = ()
        if plane is not None:
            del how["each"]
            planes = tuple(measure(plane, axis, **how) for axis in axes)
            findings += tuple(
                finding._replace(message=f"in {reference}, {finding.message}")
                for finding in _findings(planes, plane, system)
            )
        points = depth = located = None
        if system is not None and (accept or not any(f.severe for f in findings)):
            located = locate(measurements, system)
            findings += tuple(diagnose_points(located, measurements, system))
        decoded = accept or not any(f.severe for f in findings)
        summary = {
            "decoded": decoded,
            "findings": [f._asdict() for f in findings],
            "numbers": {one.axis: one.numbers() for one in measurements},
        }
        if decoded:
            arrays = {k: v for one in measurements for k, v in one.arrays().items()}
            shapes = {one.axis: one.Phi for one in measurements}
            for one, other in zip(measurements, planes, strict=False):  # or none
                difference = phase_difference(one, other)
                shapes[one.axis] = arrays[f"{one.axis}_difference"] = difference
            for axis, shape in shapes.items() if relief else ():
                if capture.patterns.unwrap == "spatial":  # of others the turns are not known
                    shape = largest_part(shape)
                shape = remove_ground(shape, DEGREES[relief]).astype(np.float32)
                arrays[f"{axis}_relief"] = shape
                save_relief(partial, f"{axis}_relief", shape)
                summary.setdefault("relief", []).append(f"{axis}_relief.ply")
            if located is not None:
                points, sigma = located.points, located.sigma
                sigma[~(good := trusted(located, system))] = points[~good] = np.nan
                limits = {"max_sigma": max_sigma, "lone": lone, "min_area": min_area}
                points, summary["removed"] = _cleaned(points, sigma, limits)
                depth = depth_of(points, system)
                colours = capture.colours()
                if colours is None:  # the average of the fringes stands in
                    colours = np.stack([measurements[0].average.astype(np.uint8)] * 3, axis=2)
                summary["points"] = _save_points(partial / "points.ply", points, colours, sigma)
                if mesh:
                    _save_mesh(partial / "mesh.ply", points, colours)
                arrays |= {"depth": depth.astype("f4"), "depth_sigma": sigma.astype("f4")}
            np.savez(partial / "decoded.npz", **arrays)
            for key, values in arrays.items() if pictures else ():
                if values.dtype.kind != "f":  # a mask as 0 and 255, a reason as it is
                    values = values.astype(np.uint8) * (255 if values.dtype == bool else 1)
                tifffile.imwrite(partial / f"{key}.tif", values, photometric="minisblack")
        if report:
            from fpputil.capture.report import page  # draws

            name = os.fsencode(folder.name).decode(errors="backslashreplace")  # in any locale
            html = page(f"Decoding of {name}", measurements, findings, depth)
            data = html.encode("utf-8", "backslashreplace")  # of names that are not UTF-8
            (partial / "report.html").write_bytes(data)
        summary["seconds"] = round(time.perf_counter() - start, 2)
        text = json.dumps(summary, indent=1) + "\n"
        (partial / "summary.json").write_text(text, encoding="utf-8")
    return DecodedFolder(out, summary, measurements, findings, points)


def _findings(measurements, capture, system) -> tuple[Finding, ...]:
    """What speaks against the phases of all axes; a mirror once, and no direction beside it."""
    by = {m.axis: m for m in measurements}
    both = mirrored(by["column"], by["row"], system) if len(by) == 2 else []
    alone = [f for one in measurements for f in diagnose(one, capture, system)]
    return (*both, *(f for f in alone if not (both and f.code in MOUNTED)))


def board_pose(
    folder: str | Path,
    patterns: Patterns | None = None,
    *,
    full: float | None = None,
    channel: str = "grey",
    accept: bool = False,
    **how,
) -> tuple[Pose, tuple[int, int]]:
    """A calibration board as the photographs of one folder show it. Chapter 12.

    Parameters
    ----------
    folder, patterns
        As of `open_capture`, of fringes along columns and rows, or one of them, on one pose of the
        board.
    full, channel, **how
        As of `open_capture`; threshold, gamma and noise as of `measure`.
    accept : bool
        Take the pose although a finding is severe.

    Returns
    -------
    Pose, (width, height)
        What `fpputil.calibration.calibrate` takes, called like the folder; the projector's pixels.

    Raises
    ------
    ValueError
        If the fringes are unwrapped in space, or a finding is severe; how the projector hangs is
        none.
    """
    capture = open_capture(folder, patterns, full, channel)
    if capture.patterns.unwrap == "spatial":
        raise ValueError(f"{folder} is unwrapped in space; a calibration needs absolute columns")
    measured = {axis: measure(capture, axis, **how) for axis in capture.patterns.axes}
    wrong = any(f.severe for m in measured.values() for f in diagnose(m, capture, ignored=MOUNTED))
    if wrong and not accept:
        found = [f for m in measured.values() for f in diagnose(m, capture) if f.severe]
        severe = [f.where + f.message for f in found]
        raise ValueError(f"{folder}: {'; '.join(severe)}")
    plain = np.mean([m.average for m in measured.values()], axis=0)
    maps = [measured[k].coordinate if k in measured else None for k in ("column", "row")]
    pose = Pose(plain, *maps, Path(folder).name)
    return pose, capture.patterns.projector


def _cleaned(points, sigma, limits) -> tuple[np.ndarray, dict[str, int]]:
    """`clean_points`, which must leave some where there were some."""
    from fpputil.decoding.pointcloud import clean_points  # loads trimesh

    points, removed = clean_points(points, sigma, **limits)
    if not np.isfinite(points).any() and any(removed.values()):
        lost = ", ".join(f"{n} {why}" for why, n in removed.items())
        raise ValueError(f"no point is left: {lost}; give min_area or another limit")
    return points, removed


def _save_mesh(path: Path, points, colours) -> None:
    """Write triangles between neighbours as PLY, but for those that bridge a step in depth."""
    from fpputil.decoding.pointcloud import save_ply, surface, typical_edge

    save_ply(path, surface(points, BRIDGE * typical_edge(points), colours))


def _save_points(path: Path, points, colours, sigma) -> int:
    """Write the finite points as PLY, each with the `sigma` of its depth, mm; returns how many."""
    from fpputil.decoding.pointcloud import save_ply  # loads trimesh

    keep = np.isfinite(points).all(axis=-1) & np.isfinite(sigma)
    if not keep.any():
        raise ValueError("no point inside the measuring range; is the system the capture's own?")
    save_ply(path, points[keep], colours[keep], {"sigma": sigma[keep]})
    return int(keep.sum())
