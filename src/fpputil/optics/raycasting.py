"""Mesh and system to view, by Embree's ray casting (chapter 2)."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from fpputil.checks import not_negative, positive, whole
from fpputil.optics.shapes import check_mesh
from fpputil.optics.system import System
from fpputil.optics.view import View

Albedo = float | np.ndarray | Callable[[np.ndarray], np.ndarray]


class Tree(NamedTuple):
    """A mesh, vertices (V, 3) in mm and faces (F, 3), with Embree's tree over them."""

    vertices: np.ndarray
    faces: np.ndarray
    scene: EmbreeScene


def bvh(mesh: trimesh.Trimesh) -> Tree:
    """Embree's tree over the faces of a mesh, a bounding volume hierarchy, for many views.

    Embree works in float32: keep the world's origin near the rig.
    """
    check_mesh(mesh, "mesh")
    vertices, faces = np.array(mesh.vertices, np.float64), np.array(mesh.faces)
    scene = EmbreeScene()
    TriangleMesh(scene, vertices.astype(np.float32), faces.astype(np.int32))
    return Tree(vertices, faces, scene)


def raycast(
    mesh: trimesh.Trimesh | Tree,
    system: System,
    *,
    albedo: Albedo = 0.9,
    specular: float = 0.0,
    shininess: float = 30.0,
    white_at: float = 400.0,
    supersample: int = 1,
) -> View:
    """See a mesh through a system: one ray a pixel, one shadow ray back to the projector.

    A pixel is in the mask if its ray meets the outside of a face that the projector lights:
    facing it, within its image, and not in the shadow of another face; a view without such a pixel
    is refused. The measuring range of the system is not asked.

    Parameters
    ----------
    mesh : trimesh.Trimesh or Tree
        Vertices in world coordinates, mm; the result of ``bvh(mesh)`` if several views share it.
    system : System
    albedo : float, (F,) array or callable
        Diffuse reflectance: of all, of each face, or a function of points (P, 3), mm, to (P,).
    specular, shininess : float
        Weight and exponent of Blinn's highlight.
    white_at : float
        Distance from the projector, mm, at which a white face square to the light reads 255.
    supersample : int
        s casts s x s rays a pixel, so that pixels on an edge mix what they see.

    Examples
    --------
    >>> from fpputil.optics import preset, shapes
    >>> view = raycast(shapes.plane(660), preset("tiny").system)
    >>> view.depth.shape, round(float(view.depth[60, 80]), 3)
    ((120, 160), 660.0)
    """
    whole("supersample", supersample, 1)
    not_negative("specular", specular)
    positive("shininess", shininess)
    positive("white_at", white_at, "mm")
    s, camera = supersample, system.camera
    K = camera.K * ((s,), (s,), (1,))
    K[:2, 2] += (s - 1) / 2
    # Refused, if it has too many pixels, before any ray is cast.
    finer = replace(camera, width=camera.width * s, height=camera.height * s, K=K)
    tree = mesh if isinstance(mesh, Tree) else bvh(mesh)
    look = albedo, specular, shininess, white_at
    view = _cast(tree, system, *look)
    if s == 1:
        return view
    return replace(view, fine=_cast(tree, replace(system, camera=finer), *look))


def _cast(tree, system, albedo, specular, shininess, white_at) -> View:
    camera, projector = system.camera, system.projector
    rays = camera.rays().reshape(-1, 3)
    hit = np.flatnonzero(np.isfinite(rays[:, 0]))
    face = _run(tree.scene, camera.centre, rays[hit], "INTERSECT")
    hit, face = hit[face >= 0], face[face >= 0]
    if hit.size == 0:
        raise outside_view(tree.vertices)
    rays = rays[hit]
    corners = tree.vertices[tree.faces[face]]
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
    lit[lit] = _run(tree.scene, projector.centre, beam[lit], "OCCLUDED", 1 - 2e-4) < 0
    hit, face, points, normal, pixel = (a[lit] for a in (hit, face, points, normal, pixel))
    beam, distance, cosine, rays = (a[lit] for a in (beam, distance, cosine, rays))

    value = reflectance(albedo, len(tree.faces), points)
    shade = (value[face] if value.ndim and not callable(albedo) else value) * cosine
    if specular:
        half = -_unit(_unit(beam) + _unit(rays))
        shade = shade + specular * np.clip(_dot(normal, half), 0, 1) ** shininess
    shade = shade * (white_at / distance) ** 2
    depth = points @ camera.R[2] + camera.t[2]

    def image(values, empty, dtype=np.float32):
        out = np.full((camera.height, camera.width), empty, dtype)
        out.flat[hit] = values
        return out

    column, row = image(pixel[:, 0], np.nan), image(pixel[:, 1], np.nan)
    return View(column, row, image(shade, 0), image(depth, np.nan), image(True, False, bool))


def _run(scene, origin, directions, query, far=None) -> np.ndarray:
    origins = np.broadcast_to(origin.astype(np.float32), directions.shape).copy()
    far = None if far is None else np.full(len(directions), far, np.float32)
    return scene.run(origins, directions.astype(np.float32), far, query=query)


def reflectance(albedo: Albedo, faces: int, points: np.ndarray | None = None) -> np.ndarray:
    """Albedo as float64: (), (F,), or (P,) if it is a function of points (P, 3), mm."""
    value = np.asarray(albedo(points) if callable(albedo) else albedo, np.float64)
    if value.shape not in ([(len(points),)] if callable(albedo) else [(), (faces,)]):
        raise ValueError(
            f"albedo of shape {value.shape} given; it is a number, one for each of the {faces} "
            "faces, or a function of points (P, 3) that returns (P,)"
        )
    if not (np.isfinite(value) & (value >= 0)).all():
        raise ValueError(
            "albedo with NaN, infinite or negative values given; all must be 0 or more"
        )
    return value


def outside_view(vertices: np.ndarray) -> ValueError:
    """The error for a mesh, vertices (V, 3), mm, that no ray of the camera meets."""
    low, high = (f(vertices, axis=0).round(1).tolist() for f in (np.min, np.max))
    return ValueError(f"mesh from {low} to {high} mm given; it lies outside the view of the camera")


def _dot(a, b):
    return np.einsum("ij,ij->i", a, b)


def _unit(a):
    return a / np.linalg.norm(a, axis=1, keepdims=True)
