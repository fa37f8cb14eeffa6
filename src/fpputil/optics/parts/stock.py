"""Raw stock and cutters of the machine parts: sections, turned solids, patterns of copies.

Lengths are in mm. Cuts overshoot the face they leave through: where two faces only nearly
coincide, a skin of 1e-9 mm would stay behind (Chapter 2).
"""

from collections.abc import Iterable

import numpy as np
import trimesh
from manifold3d import CrossSection, FillRule, JoinType, Manifold, OpType

SEGMENTS = 72  # facets of a full turn


def outline(points: Iterable) -> CrossSection:
    """Planar section bounded by ``points``, (K, 2) in mm, in either winding."""
    return CrossSection([np.asarray(points, float)], FillRule.NonZero)


def turned(profile: Iterable) -> Manifold:
    """Solid turned on a lathe about z: ``profile`` lists (radius, z) in mm."""
    return outline(profile).revolve(SEGMENTS)


def rod(radius: float, length: float, z: float = 0.0, facets: int = SEGMENTS // 2) -> Manifold:
    """Cylinder about z from ``z`` to ``z + length``, mm."""
    return Manifold.cylinder(length, radius, radius, facets).translate((0, 0, z))


def block(x: float, y: float, z: float) -> Manifold:
    """Box of edges x, y, z mm, standing centred on the plane z = 0."""
    return Manifold.cube((x, y, z), True).translate((0, 0, z / 2))


def slab(x: float, y: float, z: float, fillet: float) -> Manifold:
    """Box as `block` whose four upright edges are rounded to the radius ``fillet``."""
    core = CrossSection.square((x - 2 * fillet, y - 2 * fillet), True)
    return core.offset(fillet, JoinType.Round, 2.0, SEGMENTS // 2).extrude(z)


def at(solid: Manifold, points: Iterable) -> Manifold:
    """Union of copies of ``solid`` moved to ``points`` (K, 3) in mm."""
    return Manifold.batch_boolean([solid.translate(tuple(p)) for p in points], OpType.Add)


def around(solid: Manifold, count: int, radius: float = 0.0) -> Manifold:
    """Union of ``count`` copies at distance ``radius`` along x, spread evenly about z."""
    arm = solid.translate((radius, 0, 0))
    turns = np.arange(count) * 360.0 / count
    return Manifold.batch_boolean([arm.rotate((0, 0, a)) for a in turns], OpType.Add)


def corners(x: float, y: float) -> list[tuple[float, float, float]]:
    """The four points (+-x, +-y, 0) in mm."""
    return [(sx * x, sy * y, 0.0) for sx in (-1, 1) for sy in (-1, 1)]


def gear_section(module: float, teeth: int) -> CrossSection:
    """Involute spur gear, pressure angle 20 degrees; ``module`` in mm is pitch diameter / teeth."""
    pitch = module * teeth / 2
    base = pitch * np.cos(np.radians(20))
    r = np.linspace(base, pitch + module, 7)
    roll = np.sqrt((r / base) ** 2 - 1)
    half = np.pi / (2 * teeth) + np.tan(np.radians(20)) - np.radians(20) - roll + np.arctan(roll)
    r = np.r_[min(base, pitch - 1.25 * module), r]
    half = np.r_[half[0], half]
    angle = np.r_[-half, half[::-1]] + 2 * np.pi / teeth * np.arange(teeth)[:, None]
    r = np.tile(np.r_[r, r[::-1]], teeth)
    return outline(np.c_[r * np.cos(angle.ravel()), r * np.sin(angle.ravel())])


def hexagon(radius: float, height: float, chamfer: float) -> Manifold:
    """Hexagonal prism, mm, its corners chamfered at 30 degrees from above."""
    top = radius * np.cos(np.pi / 6)
    cone = [(0, 0), (radius + 1, 0), (radius + 1, height - chamfer), (top, height), (0, height)]
    return CrossSection.circle(radius, 6).extrude(height) ^ turned(cone)


def thread(radius: float, pitch: float, length: float) -> Manifold:
    """Screw of outer ``radius``, one turn in ``pitch`` mm, flanks of 60 degrees."""
    angle = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    r = radius - 0.6 * pitch * np.abs(angle / np.pi - 1)
    section = outline(np.c_[r * np.cos(angle), r * np.sin(angle)])
    return section.extrude(length, int(12 * length / pitch), 360 * length / pitch)


def to_mesh(solid: Manifold) -> trimesh.Trimesh:
    """Closed mesh of a solid, vertices (V, 3) float64 in mm, in the solid's order."""
    made = solid.to_mesh64()
    return trimesh.Trimesh(made.vert_properties[:, :3], made.tri_verts, process=False)
