"""Mesh and system to view, by Embree's ray casting (chapter 2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from fpputil.optics.pinhole import Pinhole
from fpputil.optics.system import System
from fpputil.optics.view import View

Albedo = float | np.ndarray | Callable[[np.ndarray], np.ndarray]


def bvh(mesh: trimesh.Trimesh) -> EmbreeScene:
    """Embree's tree over the faces of a mesh; build it once, cast many views.

    Raises
    ------
    ValueError
        If the mesh has no faces or has vertices that are not finite.
    """
    if len(mesh.faces) == 0:
        raise ValueError("mesh with 0 faces given; ray casting needs at least one triangle")
    if not np.isfinite(mesh.vertices).all():
        raise ValueError("mesh with NaN or infinite vertices given; all must be finite")
    scene = EmbreeScene()
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    TriangleMesh(scene, vertices.astype(np.float32), faces.astype(np.int32))
    return scene


def raycast(
    mesh: trimesh.Trimesh,
    system: System,
    *,
    albedo: Albedo = 0.9,
    specular: float = 0.0,
    shininess: float = 30.0,
    white_at: float = 400.0,
    supersample: int = 1,
    scene: EmbreeScene | None = None,
) -> View:
    """See a mesh through a system: one ray a pixel, one shadow ray back to the projector.

    A pixel is in the mask if its ray meets the outside of a face that the projector lights:
    facing it, within its image, and not in the shadow of another face.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Vertices in world coordinates, mm.
    system : System
        Camera and projector.
    albedo : float, (F,) array or callable
        Diffuse reflectance: one for all, one for each face, or a function of points
        (P, 3), mm, that returns (P,).
    specular, shininess : float
        Weight and exponent of Blinn's highlight.
    white_at : float
        Distance from the projector, mm, at which a white face square to the light reads 255.
    supersample : int
        s casts s x s rays a pixel, so that pixels on an edge mix what they see.
    scene : EmbreeScene, optional
        The result of ``bvh(mesh)``, if several views share it.

    Returns
    -------
    View

    Raises
    ------
    ValueError
        If the mesh is empty or not finite, lies outside the view, or no pixel of it is lit.
    """
    if int(supersample) != supersample or supersample < 1:
        raise ValueError(f"supersample {supersample} given; it is a whole number of 1 or more")
    scene = bvh(mesh) if scene is None else scene
    look = {"albedo": albedo, "specular": specular, "shininess": shininess, "white_at": white_at}
    view = _cast(mesh, system, scene, **look)
    if supersample == 1:
        return view
    finer = replace(system, camera=_finer(system.camera, supersample))
    return replace(view, fine=_cast(mesh, finer, scene, **look))


def _cast(mesh, system, scene, albedo, specular, shininess, white_at) -> View:
    camera, projector = system.camera, system.projector
    rays = camera.rays().reshape(-1, 3)
    face = _run(scene, camera.centre, rays, "INTERSECT")
    hit = np.flatnonzero(face >= 0)
    if hit.size == 0:
        low, high = mesh.bounds.round(1).tolist()
        raise ValueError(
            f"mesh from {low} to {high} mm given; it lies outside the view of the camera"
        )
    rays, face = rays[hit], face[hit]
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)[face]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    facing = _dot(normal, rays)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = _dot(normal, corners[:, 0] - camera.centre) / facing
    points = camera.centre + scale[:, None] * rays

    beam = points - projector.centre
    distance = np.linalg.norm(beam, axis=1)
    cosine = -_dot(normal, beam) / distance
    pixel = projector.project(points)
    lit = (facing < 0) & (cosine > 0) & projector.inside(pixel)
    lit[lit] = _run(scene, projector.centre, beam[lit], "OCCLUDED", 1 - 2e-4) < 0
    hit, face, points, normal, pixel = (a[lit] for a in (hit, face, points, normal, pixel))
    beam, distance, cosine, rays = (a[lit] for a in (beam, distance, cosine, rays))

    shade = _albedo(albedo, points, face) * cosine
    if specular:
        half = -_unit(_unit(beam) + _unit(rays))
        shade = shade + specular * np.clip(_dot(normal, half), 0, 1) ** shininess
    shade = shade * (white_at / distance) ** 2
    depth = points @ camera.R[2] + camera.t[2]
    return _view(camera, hit, pixel, shade, depth)


def _view(camera: Pinhole, hit, pixel, shade, depth) -> View:
    def image(values, empty, dtype=np.float32):
        out = np.full(camera.height * camera.width, empty, dtype)
        out[hit] = values
        return out.reshape(camera.height, camera.width)

    column, row = image(pixel[:, 0], np.nan), image(pixel[:, 1], np.nan)
    return View(column, row, image(shade, 0), image(depth, np.nan), image(True, False, bool))


def _run(scene, origin, directions, query, far=None) -> np.ndarray:
    origins = np.broadcast_to(origin.astype(np.float32), directions.shape).copy()
    far = None if far is None else np.full(len(directions), far, np.float32)
    return scene.run(origins, directions.astype(np.float32), far, query=query)


def _albedo(albedo: Albedo, points, face) -> np.ndarray:
    if callable(albedo):
        return np.asarray(albedo(points), np.float64)
    return np.asarray(albedo, np.float64) if np.ndim(albedo) == 0 else np.asarray(albedo)[face]


def _finer(camera: Pinhole, s: int) -> Pinhole:
    K = camera.K.copy()
    K[:2] *= s
    K[:2, 2] += (s - 1) / 2
    return replace(camera, width=camera.width * s, height=camera.height * s, K=K)


def _dot(a, b):
    return np.einsum("ij,ij->i", a, b)


def _unit(a):
    return a / np.linalg.norm(a, axis=1, keepdims=True)
