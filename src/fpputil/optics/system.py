"""The virtual system: a camera and a projector as two pinholes (Table 2; chapter 2).

The camera is the world: x right, y down, z forward, millimetres.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from fpputil.checks import conform, finite, one_line, one_or_more, positive
from fpputil.files import write_whole
from fpputil.optics import opencv_files
from fpputil.optics.pinhole import Pinhole, camera_matrix


class Pitches(NamedTuple):
    """The four pitches of the method, projector pixels a period. Chapter 5.

    Examples
    --------
    >>> preset("paper").pitches
    Pitches(high=15, mid=114, zmin=304, unit=912)
    >>> preset("paper").pitches.descending
    (912, 114, 15)
    """

    high: float
    mid: float
    zmin: float
    unit: float

    @property
    def descending(self) -> tuple[float, float, float]:
        """Those of multi-frequency unwrapping, longest first: unit, mid, high."""
        return self.unit, self.mid, self.high


MATRIX = ((finite,) * 3,) * 3
PINHOLE = {
    "width": one_or_more,
    "height": one_or_more,
    "K": MATRIX,
    "R": MATRIX,
    "t": (finite,) * 3,
    "distortion": [finite],
}
"""Entries of camera and projector in a system file, and their form."""

FORM = {"camera": PINHOLE, "projector": PINHOLE, "z_min": positive, "z_max": positive}
"""Of a system file."""

LONGEST = 20_000  # letters of OpenCV YAML: its parser ends the process in lists 50,000 deep

FREQUENCIES = Pitches._fields
"""Names of the pitches, in the order of a dataset's targets and stored photographs."""

PITCHES = dict.fromkeys(FREQUENCIES, positive)
"""Form of the pitches in JSON."""

STEPS = 15
"""Steps of the frames that targets are decoded from, as in the paper."""

SIZE = 240.0
"""Diameter in mm of the ball that a placed mesh fills. At `CENTRE` every pose of it is inside the
camera's view (a ball of 285 mm would touch it) and the measuring range, z 480 to 820 mm."""

CENTRE = (0.0, 0.0, 650.0)
"""Where the middle of that ball lies, mm."""

Frame = tuple[str, int, int]
"""A photograph by name: frequency, number of steps, which step. ("high", 4, 2) is shifted by pi."""


@dataclass(frozen=True, eq=False)
class System:
    """Camera, projector and the measuring range between two planes of the camera.

    Parameters
    ----------
    camera, projector : Pinhole
    z_min, z_max : float
        Measuring range along the camera's axis, mm. Objects lie wholly inside it.
    """

    camera: Pinhole
    projector: Pinhole
    z_min: float
    z_max: float

    def __post_init__(self):
        if not 0 < self.z_min < self.z_max < np.inf:
            raise ValueError(
                f"measuring range {self.z_min} to {self.z_max} mm given; "
                "it needs 0 < z_min < z_max, both finite"
            )

    def points_at(self, z: float | np.ndarray) -> np.ndarray:
        """World points seen by each camera pixel on the plane z (mm) of the camera, (H, W, 3)."""
        rays = self.camera.rays() @ self.camera.R.T
        local = rays * (np.asarray(z, np.float64)[..., None] / rays[..., 2:])
        return (local - self.camera.t) @ self.camera.R

    def columns_at(self, z: float | np.ndarray) -> np.ndarray:
        """Projector column that lights each camera pixel on the plane z (mm), (H, W).

        Examples
        --------
        >>> [float(table2(160).columns_at(z)[60, 80].round(1)) for z in (480.0, 820.0)]
        [397.3, 484.2]
        """
        return self.projector.project(self.points_at(z))[..., 0]

    def lit_at(self, z: float | np.ndarray) -> np.ndarray:
        """Where the plane z (mm) has a projector column, (H, W) bool; rows are not asked."""
        columns = self.columns_at(z)
        return (columns >= -0.5) & (columns <= self.projector.width - 0.5)

    def columns_per_mm(self, z: float | np.ndarray) -> np.ndarray:
        """Sensitivity ``|d column / d z|`` at depth z, (H, W), projector pixels per mm."""
        step = 0.1  # mm
        return np.abs(self.columns_at(z + step) - self.columns_at(z - step)) / (2 * step)

    def mirrored(self) -> System:
        """The same system with the projector on the other side of the camera. Chapter 5.

        Its pose is mirrored at the plane x = 0 of the camera; its lens is left as it is.

        Examples
        --------
        >>> right = preset("paper").system
        >>> [round(s.projector.centre[0]) for s in (right, right.mirrored())]
        [45, -45]
        """
        mirror, camera, projector = np.diag([-1.0, 1.0, 1.0]), self.camera, self.projector
        R = projector.R @ camera.R.T  # of the projector in the camera's frame
        t = mirror @ (projector.t - R @ camera.t)
        R = mirror @ R @ mirror
        return replace(self, projector=replace(projector, R=R @ camera.R, t=t + R @ camera.t))

    def save(self, path: str | os.PathLike) -> None:
        """Write the system as JSON (``.json``) or OpenCV YAML (``.yml``, ``.yaml``)."""
        path = Path(path)
        if path.suffix == ".xml":
            raise ValueError(f"{path.name} given; a system is written as .json, .yml or .yaml")
        plain = json.dumps(system_to_dict(self), indent=2) + "\n"
        write_whole(path, (_to_yaml(self) if _is_yaml(path) else plain).encode())

    @classmethod
    def load(cls, path: str | os.PathLike) -> System:
        """Read a system written by `save`; ValueError if the file is not whole."""
        path = Path(path)
        if not path.is_file():
            raise FileNotFoundError(f"{path} given; there is no such system file")
        try:
            parse = _from_yaml if _is_yaml(path) else json.loads
            return system_from_dict(parse(path.read_text(encoding="utf-8")))
        except Exception as error:  # OpenCV's parser has errors of its own
            if said := _of_others(path):
                raise ValueError(said) from error
            raise ValueError(
                f"{path} given; a system file holds camera, projector, z_min and z_max whole "
                f"({type(error).__name__}: {one_line(error)})"
            ) from error


def from_blender(position_m, euler_deg) -> tuple[np.ndarray, np.ndarray]:
    """Pose of a Blender camera or light as R (world to local) and centre (mm) in CV axes.

    Blender: metres, rotation Rz Ry Rx, the object looks along its -z with +y up. Chapter 2.
    """
    to_world = Rotation.from_euler("xyz", euler_deg, degrees=True).as_matrix()
    return np.diag([1.0, -1.0, -1.0]) @ to_world.T, 1000 * np.asarray(position_m, np.float64)


def table2(camera_width: int = 640) -> System:
    """The paper's virtual system (Table 2) with the camera `camera_width` pixels wide.

    Positions, rotations, resolutions and the 12 mm lens are the paper's. Sensor width 7.2 mm,
    projector focal length 1.4 x 912 pixels and the measuring range 480 to 820 mm are ours.
    """
    R_c, c_c = from_blender((0, 0, 0), (90, 0, 90))
    R_p, c_p = from_blender((-0.15, 0.045, 0), (90, 0, 95))
    R, centre = R_p @ R_c.T, R_c @ (c_p - c_c)
    w, h = camera_width, camera_width * 3 // 4
    camera = Pinhole(w, h, camera_matrix(12 / 7.2 * w, w, h))
    projector = Pinhole(912, 1140, camera_matrix(1.4 * 912, 912, 1140), R, -R @ centre)
    return System(camera, projector, 480.0, 820.0)


@dataclass(frozen=True, eq=False)
class Preset:
    """A system, its pitches, and the ball that its objects fill, by a name.

    Every pose of a ball of `size` mm at `centre` is inside the camera's view and the measuring
    range.
    """

    name: str
    system: System
    pitches: Pitches
    centre: tuple[float, float, float] = CENTRE
    size: float = SIZE


def preset(name: str) -> Preset:
    """The preset "tiny" (160 x 120), "small" (320 x 240), "paper" (640 x 480), or "near".

    The last sees 160 x 120 pixels, too, of objects half as far away and half as large: a
    millimetre of depth is about as many projector columns as the tables of the paper say, and an
    object spans 1.8 periods of pitch 114. Chapter 10.

    Examples
    --------
    >>> preset("paper").system.camera.width, preset("paper").pitches.high
    (640, 15)
    """
    known = {"tiny": (160, 24), "small": (320, 18), "paper": (640, 15), "near": (160, 32)}
    if name not in known:
        raise ValueError(f"preset {name!r} given; the presets are {', '.join(known)}")
    width, high = known[name]
    system, pitches = table2(width), Pitches(high, 114, 304, 912)
    if name == "near":
        return Preset(name, replace(system, z_min=275.0, z_max=405.0), pitches, (30, 0, 340), 120)
    return Preset(name, system, pitches)


def _is_yaml(path: Path) -> bool:
    if path.suffix not in (".json", ".yml", ".yaml", ".xml"):
        raise ValueError(f"{path.name} given; a system file ends in .json, .yml or .yaml")
    return path.suffix != ".json"


def system_to_dict(system: System) -> dict:
    """A system as plain numbers, as JSON holds it."""

    def plain(pinhole):
        return {name: np.asarray(getattr(pinhole, name)).tolist() for name in PINHOLE}

    reach = {"z_min": system.z_min, "z_max": system.z_max}
    return {"camera": plain(system.camera), "projector": plain(system.projector), **reach}


def system_from_dict(data: dict) -> System:
    """The system of `system_to_dict`; ValueError if it is not whole."""
    conform("", data, FORM)
    pinholes = {name: Pinhole(**data[name]) for name in ("camera", "projector")}
    return System(**pinholes, z_min=float(data["z_min"]), z_max=float(data["z_max"]))


def _to_yaml(system: System) -> str:
    store = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for name, pinhole in (("camera", system.camera), ("projector", system.projector)):
        for entry in PINHOLE if pinhole.distortion.size else list(PINHOLE)[:-1]:
            store.write(f"{name}_{entry}", getattr(pinhole, entry))
    store.write("z_min", system.z_min)
    store.write("z_max", system.z_max)
    return store.releaseAndGetString()


def _from_yaml(text: str) -> dict:
    if len(text) > LONGEST:
        raise ValueError(f"{len(text)} letters; at most {LONGEST} are read")
    store = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)

    def value(key):
        node = store.getNode(key)
        if node.isNone() and key.endswith("_distortion"):
            return []
        if node.isNone():
            raise KeyError(key)
        if node.isInt():
            return int(node.real())
        return node.real() if node.isReal() else node.mat().squeeze().tolist()

    pinholes = {k: {n: value(f"{k}_{n}") for n in PINHOLE} for k in ("camera", "projector")}
    return {**pinholes, "z_min": value("z_min"), "z_max": value("z_max")}


def assemble_system(
    matrices: dict[str, np.ndarray],
    camera: tuple[int, int] | None,
    projector: tuple[int, int] | None,
    z_min: float,
    z_max: float,
    unit: float,
) -> System:
    """A system of the matrices of another program, as `matrices_of` finds them. Chapter 12.

    ``x_projector = R x_camera + T``, as OpenCV's stereo calibration of a camera and, second, a
    projector has it. Sizes (width, height), pixels, take the place of those in the matrices; the
    measuring range is in mm, and `unit` is how many mm that of T is.

    Raises
    ------
    ValueError
        If something is missing, and the message says what; or T is so short that its unit must
        be another one.
    """
    sizes = {"camera size": camera, "projector size": projector}
    matrices = matrices | {k: np.array(size) for k, size in sizes.items() if size is not None}
    if missing := opencv_files.missing_of(matrices):
        raise ValueError(f"no {', '.join(missing)} found or given; all are needed")
    T = matrices["T"].ravel() * unit
    if T.shape != (3,) or not np.linalg.norm(T) >= opencv_files.LEAST:
        raise ValueError(
            f"T {T.tolist()} mm given, {np.linalg.norm(T):.3g} mm long; the three coordinates of "
            "the camera in the projector's frame are needed: give the unit (--unit m)"
        )
    poses = (np.eye(3), np.zeros(3)), (opencv_files.rotation_of(matrices["R"]), T)
    pinholes = []
    for who, (R, t) in zip(("camera", "projector"), poses, strict=True):
        width, height = (int(side) for side in matrices[f"{who} size"].ravel())
        distortion = matrices.get(f"{who} D", np.zeros(0)).ravel()
        K = matrices[f"{who} K"].reshape(3, 3)
        pinholes.append(Pinhole(width, height, K, R, t, distortion))
    return System(*pinholes, z_min, z_max)


def _of_others(path: Path) -> str:
    """What to do with matrices of another program; "" if there are none."""
    try:
        entries = opencv_files.read_entries(path)
        matrices = opencv_files.matrices_of(entries)
    except Exception:  # no such file, either
        return ""
    if {"z_min", "z_max", "camera_R", "camera_t"} & set(entries):  # of ours, and damaged
        return ""
    if not {"camera K", "projector K", "R", "T"} & set(matrices):
        return ""
    missing = ", ".join(["measuring range", *opencv_files.missing_of(matrices)])
    return (
        f"{path} given; it holds {', '.join(matrices)} of another program, and no {missing}: "
        f"`fpp system convert {path.name} new.json --range NEAR FAR` makes a system of it "
        "(--camera WxH, --projector WxH, --more FILE, --unit)"
    )


def load_system(name: str | os.PathLike) -> System:
    """The system of a preset, by its name, or of a file. Chapter 2.

    Examples
    --------
    >>> path = getfixture("tmp_path") / "mine.json"
    >>> load_system("tiny").save(path)
    >>> load_system(path).camera.width
    160
    """
    if Path(name).suffix:
        return System.load(name)
    return preset(name).system
