"""Machine parts from a seed: twenty families of solids, each a few cuts from raw stock.

A family draws its dimensions (mm) from a NumPy generator and returns a closed manifold3d solid,
about 120 mm long. Its docstring ends with the genus, the number of through holes (Chapter 2).
"""

from collections.abc import Callable

import numpy as np
import trimesh
from manifold3d import Manifold

from fpputil.checks import seeded
from fpputil.optics.parts import milled, turned
from fpputil.optics.parts.stock import to_mesh

NAMES = """
    bracket flange gear housing knob shaft lattice tee bolt nut
    pulley heatsink wheel clevis camshaft ports fan pillow conrod channel
""".split()
FAMILIES: dict[str, Callable[[np.random.Generator], Manifold]] = {
    name: getattr(milled, name, None) or getattr(turned, name) for name in NAMES
}
"""The makers of parts by name; a seed draws one by its place."""


def family_of(seed: int) -> str:
    """The family that part number ``seed`` belongs to, without making the part."""
    return NAMES[seeded(seed).integers(len(NAMES))]


def part(seed: int, family: str | None = None) -> trimesh.Trimesh:
    """Machine part number ``seed``, a watertight mesh about 120 mm long around the origin.

    The seed, not negative, chooses the family, unless one out of `FAMILIES` is named, and all
    dimensions; equal seeds give equal meshes, byte for byte. Chapter 2.

    >>> part(7, "gear").is_watertight
    True
    """
    rng = seeded(seed)
    drawn = NAMES[rng.integers(len(NAMES))]
    family = drawn if family is None else family
    if family not in FAMILIES:
        raise ValueError(f"family {family!r} given; the families are {', '.join(FAMILIES)}")
    mesh = to_mesh(FAMILIES[family](rng))
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    return mesh
