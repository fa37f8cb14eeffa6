"""Machine parts from a seed: twenty families of solids, each a few cuts from raw stock.

A family draws its dimensions (mm) from a NumPy generator and returns a closed manifold3d solid,
about 120 mm long. Its docstring ends with the genus, the number of through holes (Chapter 2).
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import trimesh
from manifold3d import CrossSection, JoinType, Manifold, OpType

from .stock import (
    SEGMENTS,
    around,
    at,
    block,
    corners,
    gear_section,
    hexagon,
    outline,
    rod,
    slab,
    thread,
    turned,
)


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
    return (
        base + wall + ribs - holes - at(bore, [(x, leg / 2 - 2 * t, 0.75 * rise) for x in spread])
    )


def flange(rng: np.random.Generator) -> Manifold:
    """Weld-neck flange with a bolt circle. Genus: 1 + bolts (4, 6, 8 or 12)."""
    rim, bore, wall, t, h = rng.uniform([48, 12, 5, 8, 22], [65, 22, 9, 14, 55])
    neck = bore + wall
    face = rng.uniform(0.6, 0.68) * rim
    body = turned([(bore, -2), (face, -2), (face, 0), (rim - 1, 0), (rim, 1), (rim, t - 1),
                   (rim - 1, t), (neck + 8, t), (neck, t + 10), (neck, h - 3), (neck - 3, h),
                   (bore, h)])  # fmt: skip
    count = int(rng.choice([4, 6, 8, 12]))
    radius = min(0.1 * rim, 0.5 * rim * np.sin(np.pi / count))
    return body - around(rod(radius, 3 * t, -t), count, (face + rim) / 2 + 1)


def gear(rng: np.random.Generator) -> Manifold:
    """Spur or helical gear with hub and lightening holes. Genus: 1 + holes (0, 4, 5 or 6)."""
    teeth, t = int(rng.integers(16, 45)), rng.uniform(12, 28)
    rim = rng.uniform(48, 62)
    twist = float(rng.choice([0, 0, 18, -18]))
    wheel = gear_section(2 * rim / teeth, teeth).extrude(t, 8 if twist else 0, twist)
    hub, web, root = rng.uniform(0.3, 0.42) * rim, 0.25 * t, rim - 5.0 * rim / teeth - 4
    groove = turned([(hub, -1), (root, -1), (root, web), (hub, web)])
    body = wheel - groove.mirror((0, 0, 1)).translate((0, 0, t)) - groove + rod(hub, 1.5 * t)
    bore = rod(hub * 0.55, 4 * t, -t) + block(hub * 0.35, hub * 0.7, 4 * t).translate(
        (0, hub * 0.35, -t)
    )
    count = int(rng.choice([0, 4, 5, 6]))
    holes = around(rod((root - hub) * 0.32, 2 * t, -1), count, (hub + root) / 2)
    return body - bore - holes


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
    places = [
        (side * x / 2 - 2 * t, row * 0.16 * y, 0.5 * z) for row in (-1, 1) for side in (-1, 1)
    ]
    holes = at(rod(0.5 * boss, z, 0.5 * z), inset)
    return body - holes - at(port, places[: int(rng.integers(1, 5))])


def knob(rng: np.random.Generator) -> Manifold:
    """Star or fluted hand knob on a collar with a blind bore. Genus: 0."""
    rim, h, stem = rng.uniform([45, 24, 16], [60, 38, 22])
    count = int(rng.choice([3, 4, 5, 6, 8, 24]))
    crown = rng.uniform(4, 9)
    body = turned([(0, 0), (rim - 4, 0), (rim, 4), (rim, h - crown), (rim - crown / 2, h - 1.5),
                   (rim - 2 * crown, h), (rim * 0.4, h + 1), (0, h + 1)])  # fmt: skip
    reach = rim * np.pi / count * 0.55
    scallops = around(rod(reach, 3 * h, -h), count, rim + 0.35 * reach)
    collar = turned([(0, -30), (stem - 2, -30), (stem, -28), (stem, -8), (stem + 8, 0), (0, 2)])
    return body - scallops + collar - rod(0.5 * stem, 30, -31)


def shaft(rng: np.random.Generator) -> Manifold:
    """Stepped shaft with chamfers, grooves and a keyway. Genus: 0, or 1 where it is hollow."""
    count = int(rng.integers(4, 8))
    lengths = rng.uniform(14, 32, count)
    lengths *= rng.uniform(110, 140) / lengths.sum()
    radii = np.interp(np.arange(count), [0, count // 2, count - 1], [10, 26, 8])
    radii = radii * rng.uniform(0.75, 1.2, count)
    z = np.r_[0, np.cumsum(lengths)]
    profile = [(0, 0)]
    for r, a, b in zip(radii, z[:-1], z[1:], strict=True):
        profile += [(r - 1, a), (r, a + 1), (r, b - 1), (r - 1, b)]
    body = turned([*profile, (0, z[-1])])
    r, mid = radii[0], z[1] / 2
    key = slab(lengths[0] * 0.7, r * 0.5, r, r * 0.24).rotate((0, 90, 0))
    groove = rod(60, 2.5) - rod(radii[-1] * 0.85, 2.5)
    body = body - key.translate((r * 0.6, 0, mid)) - groove.translate((0, 0, z[-1] - 6))
    return body - rod(4, 2 * z[-1], -9) if rng.random() < 0.3 else body


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


def tee(rng: np.random.Generator) -> Manifold:
    """Pipe elbow, tee or cross with collars. Genus: openings (2 to 4) - 1."""
    bore, wall, reach = rng.uniform([12, 3, 45], [22, 6, 62])
    r = bore + wall
    collar = [(r, reach - 14), (r + 4, reach - 12), (r + 4, reach - 1), (r + 3, reach), (0, reach)]
    arm = turned([(0, 0), (r, 0), *collar])
    turns = [(0, 90, 0), (90, 0, 0), (0, -90, 0), (-90, 0, 0)][: int(rng.integers(2, 5))]
    arms = [arm.rotate(turn) for turn in turns]
    bores = [rod(bore, 2 * reach).rotate(turn) for turn in turns]
    solid = Manifold.batch_boolean([*arms, Manifold.sphere(r, SEGMENTS)], OpType.Add)
    return Manifold.batch_boolean([solid, *bores, Manifold.sphere(bore, SEGMENTS)], OpType.Subtract)


def bolt(rng: np.random.Generator) -> Manifold:
    """Threaded bolt with a hexagon or a socket head. Genus: 0."""
    r, pitch, length, shank = rng.uniform([11, 5, 50, 15], [16, 7, 75, 35])
    head = hexagon(2 * r, 1.3 * r, 2.5)
    if rng.random() < 0.5:
        socket = CrossSection.circle(0.9 * r, 6).extrude(r).translate((0, 0, 0.7 * r))
        head = turned([(0, 0), (1.7 * r, 0), (1.7 * r, 1.4 * r), (1.6 * r, 1.5 * r),
                       (0, 1.5 * r)]) - socket  # fmt: skip
    screw = thread(r, pitch, length).translate((0, 0, -length - shank))
    end = -length - shank
    tip = turned([(0, end), (0.5 * r, end), (1.1 * r, end + 0.6 * r), (1.1 * r, 0), (0, 0)])
    return head + rod(r, shank + 2, -shank - 1) + (screw ^ tip)


def nut(rng: np.random.Generator) -> Manifold:
    """Hexagon nut: plain, with a collar, or castellated; inside thread. Genus: 1."""
    r, h = rng.uniform([50, 30], [62, 50])
    bore = rng.uniform(0.5, 0.6) * r
    kind = rng.integers(3)
    body = hexagon(r, h, 5)
    if kind == 1:
        body = body + turned(
            [(0, 0), (1.2 * r, 0), (1.2 * r, 3), (0.9 * r, 0.35 * h), (0, 0.35 * h)]
        )
    if kind == 2:
        tower = turned(
            [
                (0, h - 2),
                (0.82 * r, h - 2),
                (0.82 * r, 1.4 * h),
                (0.78 * r, 1.45 * h),
                (0, 1.45 * h),
            ]
        )
        slot = block(r, 0.22 * r, h).translate((r / 2, 0, 1.15 * h))
        body = body + tower - around(slot, 6)
    return body - thread(bore, 0.2 * h, 2 * h).translate((0, 0, -0.1 * h))


def pulley(rng: np.random.Generator) -> Manifold:
    """Belt pulley with V grooves, a dished web and holes. Genus: 1 + holes (0, 3 to 6)."""
    rim, hub = rng.uniform([50, 15], [64, 22])
    grooves, depth = int(rng.integers(1, 4)), rng.uniform(8, 12)
    width = 16.0 * grooves + 5
    belt = [(rim - depth * v, 16 * i + z) for i in range(grooves)
            for z, v in ((5, 0), (9, 1), (12, 1), (16, 0))]  # fmt: skip
    body = turned([(0, 0), (rim, 0), *belt, (rim, width), (0, width)])
    inner, web = rim - depth - 5, width * 0.33
    dish = turned([(hub, 1), (inner - 3, 1), (inner, -web), (hub - 3, -web)]).translate(
        (0, 0, width)
    )
    body = (
        body - dish - dish.mirror((0, 0, 1)).translate((0, 0, width)) + rod(hub * 0.85, width + 8)
    )
    holes = around(rod((inner - hub) * 0.36, width), rng.choice([0, 3, 4, 5, 6]), (inner + hub) / 2)
    return body - holes - rod(hub * 0.5, 3 * width, -width)


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


def wheel(rng: np.random.Generator) -> Manifold:
    """Spoked handwheel with or without a crank handle. Genus: 1 + spokes (3 to 7)."""
    rim, section, hub = rng.uniform([50, 5, 13], [62, 8, 18])
    spokes = int(rng.integers(3, 8))
    ring = CrossSection.circle(section, 32).translate((rim - section, 0)).revolve(SEGMENTS)
    drop = rng.uniform(0, 12)
    spoke = Manifold.cylinder(rim - section, 0.8 * section, 0.55 * section, 32).rotate((0, 90, 0))
    spoke = spoke.rotate((0, float(np.degrees(np.arctan2(drop, rim))), 0)).scale((1, 1, 0.7))
    body = around(spoke.translate((0, 0, drop)), spokes) + ring
    body = body + turned([(0, -8), (hub - 2, -8), (hub, -6), (hub, drop + 7), (hub - 2, drop + 9),
                          (0, drop + 9)])  # fmt: skip
    if rng.random() < 0.5:
        grip = turned([(0, 0), (4, 0), (4, 10), (7, 14), (8, 30), (6, 40), (0, 42)])
        body = body + grip.translate((rim - section, 0, 0))
    return body - rod(0.5 * hub, 80, -30)


def clevis(rng: np.random.Generator) -> Manifold:
    """Fork end with a cross pin hole and a threaded shank. Genus: 2."""
    width, reach, gap = rng.uniform([32, 38, 0.35], [46, 55, 0.5])
    ear = block(width, width, reach).translate((0, 0, 0))
    ear = ear + rod(width / 2, width).rotate((0, 90, 0)).translate((-width / 2, 0, reach))
    slot = block(gap * width, 2 * width, 2 * reach).translate((0, 0, 0.3 * reach))
    body = (ear ^ turned([(0, 0), (0.5 * width, 0), (0.72 * width, 0.3 * reach), (0.72 * width, 9 * reach),
                          (0, 9 * reach)])) - slot  # fmt: skip
    pin = rod(rng.uniform(0.2, 0.3) * width, 2 * width).rotate((0, 90, 0))
    shank = thread(0.3 * width, 5, 45).translate((0, 0, -50)) + rod(0.38 * width, 8, -7)
    return body - pin.translate((-width, 0, reach)) + shank


def camshaft(rng: np.random.Generator) -> Manifold:
    """Shaft with egg-shaped cams at different angles. Genus: 0, or 1 where it is hollow."""
    r, count, width = rng.uniform(9, 12), int(rng.integers(2, 6)), rng.uniform(9, 14)
    base, lift = rng.uniform([14, 8], [18, 16])
    round_ = CrossSection.circle(base, SEGMENTS)
    nose = CrossSection.circle(0.45 * base, SEGMENTS).translate((base * 0.55 + lift, 0))
    cam = CrossSection.batch_hull([round_, nose]).extrude(width)
    pitch = 110 / count
    solids = [turned([(0, -12), (r - 1, -12), (r, -11), (r, 116), (r - 1, 117), (0, 117)])]
    step = float(rng.choice([90, 120, 137]))
    solids += [cam.rotate((0, 0, i * step)).translate((0, 0, i * pitch + 4)) for i in range(count)]
    solids += [rod(r + 3, 5, (i + 1) * pitch - 3) for i in range(count)]
    body = Manifold.batch_boolean(solids, OpType.Add)
    return body - rod(0.5 * r, 300, -99) if rng.random() < 0.4 else body


def ports(rng: np.random.Generator) -> Manifold:
    """Hydraulic block: a main bore crossed by ports from above. Genus: ports (2 to 5) + 5."""
    x, y, z = rng.uniform([95, 45, 40], [125, 65, 60])
    main = rod(rng.uniform(0.13, 0.18) * z, 3 * x, -x).rotate((0, 90, 0))
    radius = rng.uniform(4, 6.5)
    bore = rod(radius, z) + turned(
        [(0, z / 2 - 4), (radius + 3, z / 2 - 4), (radius + 3, z), (0, z)]
    )
    spread = np.linspace(-0.32, 0.32, rng.integers(2, 6)) * x
    screws = at(rod(2.7, 3 * z, -z), corners(x / 2 - 6, y / 2 - 6))
    body = slab(x, y, z, 3).translate((0, 0, -z / 2))
    flat = block(0.3 * x, 2 * y, 0.2 * z).translate((0.35 * x + 0.2, 0, 0.3 * z + 0.1))
    body = body - main - screws - at(bore, [(s, 0, 0) for s in spread])
    return body - flat if rng.random() < 0.4 else body


def fan(rng: np.random.Generator) -> Manifold:
    """Impeller: thin twisted blades on a hub, with or without a back plate. Genus: 1."""
    rim, h, t = rng.uniform([50, 22, 1.6], [62, 36, 2.6])
    hub = rng.uniform(13, 18)
    blade = CrossSection.square((rim - hub + 3, t)).translate((hub - 3, -t / 2))
    blades = around(blade.extrude(h, 12, rng.uniform(25, 60)), int(rng.integers(5, 12)))
    body = blades + turned([(0, -3), (hub, -3), (hub, h), (hub - 4, h + 5), (0, h + 5)])
    if rng.random() < 0.5:
        body = body + turned([(0, -3), (rim + 1, -3), (rim + 1, 0), (hub + 6, 1), (0, 4)])
    return body - rod(0.4 * hub, 90, -30)


def pillow(rng: np.random.Generator) -> Manifold:
    """Pillow block: bearing seat on a foot with two slots. Genus: 3."""
    bore, wall, width = rng.uniform([17, 7, 30], [24, 11, 45])
    foot, rise = rng.uniform(125, 145), bore + wall + rng.uniform(4, 14)
    seat = rod(bore + wall, width).rotate((90, 0, 0)).translate((0, width / 2, rise))
    cheek = outline([(-bore - wall, rise), (-bore - wall - 14, 5), (bore + wall + 14, 5),
                     (bore + wall, rise)])  # fmt: skip
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
    circles = [
        CrossSection.circle(r).translate((x, 0))
        for x, r in ((0, 0.75 * big), (length, 0.8 * small))
    ]
    beam = CrossSection.batch_hull(circles)
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
    legs = [CrossSection.batch_hull([CrossSection.circle(t / 2, 24).translate(p) for p in pair])
            for pair in pairwise(line)]  # fmt: skip
    sheet = (legs[0] + legs[1] + legs[2]).extrude(x).rotate((90, 0, 90)).translate((-x / 2, 0, 0))
    columns, rows = int(rng.integers(3, 7)), int(rng.integers(1, 3))
    size = 0.6 * x / columns, 0.4 * web / rows
    slot = slab(*size, 6 * t, 0.45 * min(size))
    places = [((i + 0.5) / columns * x - x / 2, (j + 0.5) / rows * 0.8 * web - 0.4 * web, -3 * t)
              for i in range(columns) for j in range(rows)]  # fmt: skip
    return sheet - at(slot, places)


FAMILIES: dict[str, Callable[[np.random.Generator], Manifold]] = {
    build.__name__: build
    for build in (bracket, flange, gear, housing, knob, shaft, lattice, tee, bolt, nut, pulley,
                  heatsink, wheel, clevis, camshaft, ports, fan, pillow, conrod, channel)
}  # fmt: skip


def part(seed: int, family: str | None = None) -> trimesh.Trimesh:
    """Machine part number ``seed``, a closed mesh about 120 mm long, centred on the origin.

    Parameters
    ----------
    seed : int
        Not negative. Chooses the family and all dimensions; equal seeds give equal meshes,
        byte for byte.
    family : str, optional
        A name out of `FAMILIES`, instead of the family the seed would choose.

    Returns
    -------
    trimesh.Trimesh
        Watertight, normals outwards; vertices (V, 3) in mm.

    Raises
    ------
    ValueError
        If ``family`` is not in `FAMILIES`.

    Notes
    -----
    Chapter 2.
    """
    rng = np.random.default_rng(seed)
    drawn = list(FAMILIES)[rng.integers(len(FAMILIES))]
    family = drawn if family is None else family
    if family not in FAMILIES:
        raise ValueError(f"family {family!r} given; the families are {', '.join(FAMILIES)}")
    made = FAMILIES[family](rng).to_mesh64()
    mesh = trimesh.Trimesh(made.vert_properties[:, :3], made.tri_verts, process=False)
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    return mesh
