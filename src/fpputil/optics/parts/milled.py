"""Families of parts from the mill, the mould and the press."""

from itertools import pairwise

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold, OpType

from fpputil.optics.parts.stock import at, block, corners, outline, rod, slab, thread, turned


def bracket(rng: np.random.Generator) -> Manifold:
    """Angle bracket with two gussets. Genus: holes of the base and the wall, 3 to 8."""
    width, leg, rise, t = rng.uniform([60, 70, 60, 5], [110, 100, 100, 9])
    base = slab(width, leg, t, 6)
    wall = slab(width, rise, t, 6).rotate((90, 0, 0)).translate((0, leg / 2, rise / 2))
    wall = wall + block(width, t, rise / 2).translate((0, (leg - t) / 2, 0))
    fall = rng.uniform(0.4, 0.7) * np.array([leg, rise])
    rib = outline([(0, 0), (0, fall[1]), (-fall[0], 0)]).extrude(t).rotate((90, 0, 90))
    ribs = at(rib, [(s * width * 0.42 - t / 2, leg / 2 - t / 2, t / 2) for s in (-1, 1)])
    spread = np.linspace(-0.24, 0.24, rng.integers(2, 5)) * width
    holes = at(rod(rng.uniform(3, 0.06 * width), 4 * t, -t), [(x, -leg / 4, 0) for x in spread])
    spread = np.linspace(-0.24, 0.24, rng.integers(1, 5)) * width if rng.random() < 0.8 else [0]
    bore = rod(rng.uniform(4, 6), 4 * t).rotate((-90, 0, 0))
    bores = at(bore, [(x, leg / 2 - 2 * t, 0.75 * rise) for x in spread])
    return base + wall + ribs - holes - bores


def housing(rng: np.random.Generator) -> Manifold:
    """Open cast box with screw bosses and ports in its walls. Genus: ports, 1 to 4."""
    x, y, z = rng.uniform([90, 60, 35], [125, 90, 60])
    t, boss = rng.uniform([2.5, 5], [4.5, 7])
    shell = slab(x, y, z, 10) - slab(x - 2 * t, y - 2 * t, z, 10 - t).translate((0, 0, t))
    lip = slab(x + 10, y + 10, t, 12) - slab(x - 8, y - 8, t, 8)
    inset = corners(x / 2 - t - 0.7 * boss, y / 2 - t - 0.7 * boss)
    seat = rod(rng.uniform(0.12, 0.2) * y, 0.3 * z)
    body = shell + lip.translate((0, 0, z - t)) + at(rod(boss, z), inset) + seat
    port = rod(rng.uniform(0.08, 0.13) * y, 4 * t).rotate((0, 90, 0))
    signs = [(side, row) for row in (-1, 1) for side in (-1, 1)]
    places = [(side * x / 2 - 2 * t, row * 0.16 * y, 0.5 * z) for side, row in signs]
    holes = at(rod(0.5 * boss, z, 0.5 * z), inset)
    return body - holes - at(port, places[: int(rng.integers(1, 5))])


def lattice(rng: np.random.Generator) -> Manifold:
    """Cubic lattice of square struts or round ones. Genus: struts - nodes + 1."""
    nodes = rng.integers(2, 5, 3)
    gap, width = rng.uniform([26, 5], [38, 9])
    square, ball = rng.random(2) < 0.5
    joint = Manifold.sphere(0.8 * width, 20) if ball else Manifold.cube((1.3 * width,) * 3, True)
    node = np.stack(np.meshgrid(*map(np.arange, nodes), indexing="ij"), -1).reshape(-1, 3)
    solids = [at(joint, node * gap)]
    for axis, turn in enumerate([(0, 90, 0), (-90, 0, 0), (0, 0, 0)]):
        length = (nodes[axis] - 1) * gap
        bar = block(width, width, length) if square else rod(width / 2, length, facets=20)
        starts = node[node[:, axis] == 0] * gap
        solids.append(at(bar.rotate(turn), starts))
    return Manifold.batch_boolean(solids, OpType.Add)


def heatsink(rng: np.random.Generator) -> Manifold:
    """Heat sink: plate fins under 3 mm, or pins, on a base with screw holes. Genus: 4."""
    x, y, h, t = rng.uniform([100, 70, 25, 1.4], [125, 110, 50, 2.8])
    base = slab(x, y, 6, 5) - at(rod(2.5, 20, -5), corners(x / 2 - 7, y / 2 - 7))
    count = int(rng.integers(7, 13))
    span = np.linspace(-0.5, 0.5, count) * (x - 32)
    if rng.random() < 0.6:
        fin = block(t, y, h).translate((0, 0, 5))
        return base + at(fin, [(s, 0, 0) for s in span])
    pin = rod(1.2 * t, h, 5, facets=20)
    rows = np.linspace(-0.5, 0.5, count - 2) * (y - 10)
    return base + at(pin, [(s, r, 0) for s in span for r in rows])


def clevis(rng: np.random.Generator) -> Manifold:
    """Fork end with a cross pin hole and a threaded shank. Genus: 2."""
    width, reach, gap = rng.uniform([32, 38, 0.35], [46, 55, 0.5])
    ear = block(width, width, reach)
    ear = ear + rod(width / 2, width).rotate((0, 90, 0)).translate((-width / 2, 0, reach))
    slot = block(gap * width, 2 * width, 2 * reach).translate((0, 0, 0.3 * reach))
    far, wide = 9 * reach, 0.72 * width
    envelope = turned([(0, 0), (0.5 * width, 0), (wide, 0.3 * reach), (wide, far), (0, far)])
    body = (ear ^ envelope) - slot
    pin = rod(rng.uniform(0.2, 0.3) * width, 2 * width).rotate((0, 90, 0))
    shank = thread(0.3 * width, 5, 45).translate((0, 0, -50)) + rod(0.38 * width, 8, -7)
    return body - pin.translate((-width, 0, reach)) + shank


def ports(rng: np.random.Generator) -> Manifold:
    """Hydraulic block: a main bore crossed by ports from above. Genus: ports (2 to 5) + 5."""
    x, y, z = rng.uniform([95, 45, 40], [125, 65, 60])
    main = rod(rng.uniform(0.13, 0.18) * z, 3 * x, -x).rotate((0, 90, 0))
    radius = rng.uniform(4, 6.5)
    bore = rod(radius, z) + rod(radius + 3, z, z / 2 - 4)
    spread = np.linspace(-0.32, 0.32, rng.integers(2, 6)) * x
    screws = at(rod(2.7, 3 * z, -z), corners(x / 2 - 6, y / 2 - 6))
    body = slab(x, y, z, 3).translate((0, 0, -z / 2))
    flat = block(0.3 * x, 2 * y, 0.2 * z).translate((0.35 * x + 0.2, 0, 0.3 * z + 0.1))
    body = body - main - screws - at(bore, [(s, 0, 0) for s in spread])
    return body - flat if rng.random() < 0.4 else body


def pillow(rng: np.random.Generator) -> Manifold:
    """Pillow block: bearing seat on a foot with two slots. Genus: 3."""
    bore, wall, width = rng.uniform([17, 7, 30], [24, 11, 45])
    foot, rise = rng.uniform(125, 145), bore + wall + rng.uniform(4, 14)
    seat = rod(bore + wall, width).rotate((90, 0, 0)).translate((0, width / 2, rise))
    half = bore + wall
    cheek = outline([(-half, rise), (-half - 14, 5), (half + 14, 5), (half, rise)])
    body = seat + cheek.extrude(0.7 * width).rotate((90, 0, 0)).translate((0, 0.35 * width, 0))
    slot = slab(16, 9, 40, 4.4).translate((0, 0, -9))
    slots = at(slot, [(s * (foot / 2 - 14), 0, 0) for s in (-1, 1)])
    ring = rod(bore - 4, 2 * width, -width) + rod(bore, width, 4 - width / 2)
    body = body + slab(foot, width, 11, 6) - slots
    return body - ring.rotate((90, 0, 0)).translate((0, 0, rise))


def conrod(rng: np.random.Generator) -> Manifold:
    """Connecting rod: two eyes joined by an I-beam. Genus: 2."""
    length, big, small, t = rng.uniform([75, 22, 12, 14], [95, 30, 18, 22])
    eyes = rod(big, t) + rod(small, t).translate((length, 0, 0))
    ends = [CrossSection.circle(0.75 * big), CrossSection.circle(0.8 * small)]
    beam = CrossSection.batch_hull([ends[0], ends[1].translate((length, 0))])
    pocket = beam.offset(-4, JoinType.Round, 2.0, 32).extrude(t)
    beam = beam.extrude(0.8 * t).translate((0, 0, 0.1 * t))
    eyes_only = rod(big + 3, 9 * t, -t) + rod(small + 3, 9 * t, -t).translate((length, 0, 0))
    beam = beam - (at(pocket, [(0, 0, 0.6 * t), (0, 0, -0.6 * t)]) - eyes_only)
    bores = rod(rng.uniform(0.65, 0.75) * big, 3 * t, -t)
    return beam + eyes - bores - rod(0.6 * small, 3 * t, -t).translate((length, 0, 0))


def channel(rng: np.random.Generator) -> Manifold:
    """Bent sheet under 3 mm, a U or Z section, with slots. Genus: slots, 3 to 12."""
    x, web, rise, t = rng.uniform([100, 45, 20, 1.4], [130, 70, 45, 2.8])
    second = float(rng.choice([-1, 1]))
    line = [(-web / 2, rise), (-web / 2, 0), (web / 2, 0), (web / 2, second * rise)]
    ends = [CrossSection.circle(t / 2, 24).translate(p) for p in line]
    legs = [CrossSection.batch_hull(list(pair)) for pair in pairwise(ends)]
    sheet = (legs[0] + legs[1] + legs[2]).extrude(x).rotate((90, 0, 90)).translate((-x / 2, 0, 0))
    columns, rows = int(rng.integers(3, 7)), int(rng.integers(1, 3))
    size = 0.6 * x / columns, 0.4 * web / rows
    slot = slab(*size, 6 * t, 0.45 * min(size))
    xs = (np.arange(columns) + 0.5) / columns * x - x / 2
    ys = (np.arange(rows) + 0.5) / rows * 0.8 * web - 0.4 * web
    return sheet - at(slot, [(x, y, -3 * t) for x in xs for y in ys])
