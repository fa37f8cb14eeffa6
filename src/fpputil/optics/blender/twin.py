"""A mesh and a system photographed by Cycles, as the ray caster sees them (Book: Blender)."""

import os
import zipfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import trimesh

from fpputil import probe
from fpputil.checks import positive, whole
from fpputil.files import write_arrays
from fpputil.optics.blender import shaders, studio
from fpputil.optics.fringes import WHITE, Fringe
from fpputil.optics.raycasting import outside_view, reflectance
from fpputil.optics.shapes import check_mesh
from fpputil.optics.system import System
from fpputil.optics.view import View


def photograph(
    mesh: trimesh.Trimesh,
    system: System,
    fringes: Fringe | Iterable[Fringe],
    *,
    albedo: float | np.ndarray = 0.9,
    white_at: float = 400.0,
    samples: int = 1,
    quantise: bool = True,
) -> np.ndarray:
    """Photograph a mesh under fringes, one picture of Cycles for each pattern, as the paper does.

    The twin of ``raycast(mesh, system, albedo=..., white_at=...).frames(fringes)``, (N, H, W),
    uint8 or, not quantised, float64. Other arguments are as of `see`; the fringes have no defocus.

    One sample looks through the centre of each pixel, as the ray caster does. More are spread by
    Cycles' own filter, 1.5 pixels wide: neighbours mix, as in a real camera, and it is noise. Ray
    caster and Cycles differ in pixels within a hundredth of a pixel of an edge; there Cycles may
    also let a facet shade the one beside it, one pixel in a hundred thousand.
    """
    fringes = (fringes,) if isinstance(fringes, Fringe) else tuple(fringes)
    if not fringes:
        raise ValueError("no fringe given; a photograph needs at least one pattern")
    shaders.check_pinhole(system.projector, fringes)
    frames = []
    with _staged(mesh, system, albedo, white_at, samples) as (_, lamp, shoot):
        for fringe in fringes:
            shaders.throw(lamp, system.projector, shaders.pattern(fringe))
            for n in range(fringe.steps):
                lamp.node_tree.nodes["shift"].outputs[0].default_value = n / fringe.steps
                light = WHITE * shoot()[..., 0].astype(np.float64)
                light = np.rint(light.clip(0, WHITE)).astype(np.uint8) if quantise else light
                frames.append(light)
            if not np.any(frames):
                raise ValueError(
                    "no pixel is lit; at least one pixel must be seen and lit "
                    "(is the object in both images, and does it face the projector?)"
                )
    return np.stack(frames)


def see(
    mesh: trimesh.Trimesh,
    system: System,
    *,
    albedo: float | np.ndarray = 0.9,
    white_at: float = 400.0,
) -> View:
    """See a mesh through a system by Cycles: the twin of `fpputil.optics.raycasting.raycast`.

    The projector throws its own coordinates, (column, row, 1), as red, green and blue: one
    picture then serves every pattern. A second, of the depth, needs no projector.

    Arguments as of `raycast`; no distortion, no skew of the camera, an albedo for all or one for
    each face, (F,).
    """
    projector = system.projector
    with _staged(mesh, system, albedo, white_at, 1) as (bpy, lamp, shoot):
        shaders.throw(lamp, projector, shaders.address(projector))
        light = shoot()
        bpy.data.meshes[0].materials[0] = shaders.glow_by_depth(bpy)
        depth = shoot()[..., 0]
    shade = light[..., 2]
    mask = shade > 0
    address = light[..., :2].astype(np.float64) / np.where(mask, shade, np.nan)[..., None]
    column, row = np.moveaxis(address * (projector.width, projector.height) - 0.5, -1, 0)
    depth = np.where(mask, depth * studio.METRE, np.nan)
    return View(*(a.astype(np.float32) for a in (column, row, shade, depth)), mask)


def stored(path: str | os.PathLike, make: Callable[[], np.ndarray]) -> np.ndarray:
    """A photograph made anew where Blender works, else read from its NPZ file.

    Where Blender works and there is no such file yet, it is written. An existing file is left
    alone: to store a changed photograph, delete the file first.
    """
    path = Path(path)
    if probe.blender_works():
        image = make()
        if not path.exists():
            write_arrays(path, {"image": image})
        return image
    if not path.is_file():
        raise FileNotFoundError(
            f"{path} given; there is no such stored photograph, and Blender does not run here"
        )
    try:
        with path.open("rb") as file, np.load(file) as arrays:
            return arrays["image"]
    except (OSError, KeyError, ValueError, TypeError, zipfile.BadZipFile, EOFError) as error:
        raise ValueError(f"{path} given; it holds no stored photograph ({error})") from error


@contextmanager
def _staged(mesh, system: System, albedo, white_at: float, samples: int) -> Iterator[tuple]:
    """Blender with the mesh and the lamp of the projector; checked before it is started.

    Yields ``bpy``, the lamp, and the function of `studio.opened` that photographs.
    """
    check_mesh(mesh, "mesh")
    shaders.check_pinhole(system.projector)
    positive("white_at", white_at, "mm")
    if callable(albedo):
        raise ValueError(
            "albedo as a function given; Blender takes a number, or one for each face, and the "
            "ray caster takes functions"
        )
    albedo = np.broadcast_to(reflectance(albedo, len(mesh.faces)), len(mesh.faces))
    with studio.opened(system.camera, whole("samples", samples, 1)) as (bpy, shoot):
        studio.solid(bpy, mesh.triangles, shaders.skin(bpy), albedo=albedo)

        def seen():
            light = shoot()
            if not light[..., 3].any():
                raise outside_view(mesh.vertices)
            return light

        yield bpy, shaders.projector(bpy, system.projector, white_at), seen
