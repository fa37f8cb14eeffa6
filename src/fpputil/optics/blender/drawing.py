"""Pictures of the rig itself, as Blender shows it (Book: Blender; the paper's Fig. 6 b)."""

from collections.abc import Sequence

import numpy as np
import trimesh
from matplotlib.colors import to_rgba

from fpputil.checks import positive, whole
from fpputil.optics.blender import shaders, studio
from fpputil.optics.fringes import Fringe
from fpputil.optics.pinhole import Pinhole, looking
from fpputil.optics.shapes import check_mesh


def picture(
    bodies: Sequence[tuple[trimesh.Trimesh, object]],
    look_from,
    look_at,
    size: tuple[int, int] = (960, 640),
    angle: float = 30.0,
    *,
    projector: Pinhole | None = None,
    fringe: Fringe | None = None,
    white_at: float = 600.0,
    samples: int = 48,
) -> np.ndarray:
    """Picture of bodies in space by daylight, as `fpputil.plotting.bodies` draws it. Book: Blender.

    Parameters
    ----------
    bodies : sequence of (trimesh.Trimesh, colour)
        World coordinates, mm; colours as matplotlib takes them. One that is not opaque, such as
        ``("gold", 0.1)``, makes a veil of light, which shines and throws no shadow.
    look_from, look_at, size, angle
        As for `fpputil.optics.pinhole.looking`.
    projector, fringe : Pinhole, Fringe, optional
        Both or none: step 0 of the fringe is thrown on the bodies. A body around the projector's
        centre, such as its housing or the edges of its light, throws no shadow.
    white_at : float
        Distance from the projector, mm, at which a white face square to the light reads 255.
    samples : int
        Of each pixel.

    Returns
    -------
    (H, W, 3) uint8 array
        On white.
    """
    if not bodies:
        raise ValueError("no body given; a picture needs at least one")
    if (projector is None) != (fringe is None):
        raise ValueError("one of projector and fringe given; a picture needs both or none")
    if projector is not None:
        shaders.check_pinhole(projector, [fringe])
    eye = looking(look_from, look_at, size, angle)
    with studio.opened(eye, whole("samples", samples, 1)) as (bpy, shoot):
        settings = bpy.context.scene.cycles
        settings.max_bounces = 2  # light goes on from surface to surface
        # Veils let all of it through, without dice.
        settings.min_transparent_bounces = settings.transparent_max_bounces = 128
        shaders.daylight(bpy, eye, sky=0.3, sun=0.9)
        for mesh, colour in bodies:
            _stand(bpy, mesh, colour, None if projector is None else projector.centre)
        if projector is not None:
            lamp = shaders.projector(bpy, projector, positive("white_at", white_at, "mm"))
            shaders.throw(lamp, projector, shaders.pattern(fringe))
        light = shoot()
    light = np.clip(light[..., :3] + (1 - light[..., 3:]), 0, 1)
    srgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.rint(255 * srgb).astype(np.uint8)


def sheets(projector: Pinhole, pitch: float, reach: float) -> trimesh.Trimesh:
    """The sheets of light through the brightest columns of a fringe's step 0, `pitch` pixels apart.

    One triangle for each, `reach` mm along the projector's axis, to be drawn as a veil.
    """
    columns = np.arange(0, projector.width, positive("pitch", pitch, "projector pixels"))
    ends = np.stack(np.meshgrid(columns, (-0.5, projector.height - 0.5), indexing="ij"), -1)
    ends = projector.centre + positive("reach", reach, "mm") * projector.rays(ends)
    start = np.broadcast_to(projector.centre, (len(columns), 1, 3))
    corners = np.concatenate([start, ends], axis=1).reshape(-1, 3)
    return trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)


def _stand(bpy, mesh, colour, lamp) -> None:
    """Add a body of a colour; it throws no shadow if it is a veil or is around the lamp."""
    check_mesh(mesh, "mesh")
    *rgb, alpha = to_rgba(colour)
    rgb = np.array(rgb)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    material = shaders.paint(bpy, linear) if alpha == 1 else shaders.veil(bpy, linear, alpha)
    thing = studio.solid(bpy, mesh.triangles, material)
    low, high = mesh.bounds + ((-1,), (1,))
    around = lamp is not None and np.all((low <= lamp) & (lamp <= high))
    thing.visible_shadow = alpha == 1 and not around
    thing.visible_diffuse = alpha == 1
