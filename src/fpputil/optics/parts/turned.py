"""Families of parts from the lathe: most of each is a profile turned about z."""

import numpy as np
from manifold3d import CrossSection, Manifold, OpType

from fpputil.optics.parts.stock import (
    SEGMENTS,
    around,
    block,
    gear_section,
    hexagon,
    rod,
    slab,
    thread,
    turned,
)


def flange(rng: np.random.Generator) -> Manifold:
    """Weld-neck flange with a bolt circle. Genus: 1 + bolts (4, 6, 8 or 12)."""
    rim, bore, wall, t, h = rng.uniform([48, 12, 5, 8, 22], [65, 22, 9, 14, 55])
    neck = bore + wall
    face = rng.uniform(0.6, 0.68) * rim
    r = bore, face, face, rim - 1, rim, rim, rim - 1, neck + 8, neck, neck, neck - 3, bore
    z = -2, -2, 0, 0, 1, t - 1, t, t, t + 10, h - 3, h, h
    body = turned(np.c_[r, z])
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
    key = block(hub * 0.35, hub * 0.7, 4 * t).translate((0, hub * 0.35, -t))
    count = int(rng.choice([0, 4, 5, 6]))
    holes = around(rod((root - hub) * 0.32, 2 * t, -1), count, (hub + root) / 2)
    return body - rod(hub * 0.55, 4 * t, -t) - key - holes


def knob(rng: np.random.Generator) -> Manifold:
    """Star or fluted hand knob on a collar with a blind bore. Genus: 0."""
    rim, h, stem = rng.uniform([45, 24, 16], [60, 38, 22])
    count = int(rng.choice([3, 4, 5, 6, 8, 24]))
    crown = rng.uniform(4, 9)
    r = 0, rim - 4, rim, rim, rim - crown / 2, rim - 2 * crown, rim * 0.4, 0
    z = 0, 0, 4, h - crown, h - 1.5, h, h + 1, h + 1
    body = turned(np.c_[r, z])
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
        cap = [(0, 0), (1.7 * r, 0), (1.7 * r, 1.4 * r), (1.6 * r, 1.5 * r), (0, 1.5 * r)]
        socket = CrossSection.circle(0.9 * r, 6).extrude(r).translate((0, 0, 0.7 * r))
        head = turned(cap) - socket
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
        wide, low = 1.2 * r, 0.35 * h
        body = body + turned([(0, 0), (wide, 0), (wide, 3), (0.9 * r, low), (0, low)])
    if kind == 2:
        side, top = 0.82 * r, 1.45 * h
        tower = turned([(0, h - 2), (side, h - 2), (side, top - 2), (side - 2, top), (0, top)])
        body = body + tower
        slot = block(r, 0.22 * r, h).translate((r / 2, 0, 1.15 * h))
        body = body - around(slot, 6)
    return body - thread(bore, 0.2 * h, 2 * h).translate((0, 0, -0.1 * h))


def pulley(rng: np.random.Generator) -> Manifold:
    """Belt pulley with V grooves, a dished web and holes. Genus: 1 + holes (0, 3 to 6)."""
    rim, hub = rng.uniform([50, 15], [64, 22])
    grooves, depth = int(rng.integers(1, 4)), rng.uniform(8, 12)
    width = 16.0 * grooves + 5
    groove = ((5, 0), (9, 1), (12, 1), (16, 0))
    belt = [(rim - depth * v, 16 * i + z) for i in range(grooves) for z, v in groove]
    body = turned([(0, 0), (rim, 0), *belt, (rim, width), (0, width)])
    inner, web = rim - depth - 5, width * 0.33
    dish = turned([(hub, -1), (inner - 3, -1), (inner, web), (hub - 3, web)])
    body = body - dish - dish.mirror((0, 0, 1)).translate((0, 0, width))
    body = body + rod(hub * 0.85, width + 8)
    holes = around(rod((inner - hub) * 0.36, width), rng.choice([0, 3, 4, 5, 6]), (inner + hub) / 2)
    return body - holes - rod(hub * 0.5, 3 * width, -width)


def wheel(rng: np.random.Generator) -> Manifold:
    """Spoked handwheel with or without a crank handle. Genus: 1 + spokes (3 to 7)."""
    rim, section, hub = rng.uniform([50, 5, 13], [62, 8, 18])
    spokes = int(rng.integers(3, 8))
    ring = CrossSection.circle(section, 32).translate((rim - section, 0)).revolve(SEGMENTS)
    drop = rng.uniform(0, 12)
    spoke = Manifold.cylinder(rim - section, 0.8 * section, 0.55 * section, 32).rotate((0, 90, 0))
    spoke = spoke.rotate((0, float(np.degrees(np.arctan2(drop, rim))), 0)).scale((1, 1, 0.7))
    body = around(spoke.translate((0, 0, drop)), spokes) + ring
    side = [(hub - 2, -8), (hub, -6), (hub, drop + 7), (hub - 2, drop + 9)]
    body = body + turned([(0, -8), *side, (0, drop + 9)])
    if rng.random() < 0.5:
        grip = turned([(0, 0), (4, 0), (4, 10), (7, 14), (8, 30), (6, 40), (0, 42)])
        body = body + grip.translate((rim - section, 0, 0))
    return body - rod(0.5 * hub, 80, -30)


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
