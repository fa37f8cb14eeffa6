"""What shines and what is shone upon: the nodes of projectors and surfaces in Blender.

`fpputil.optics.blender` photographs them.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from fpputil.optics.blender.studio import METRE, add
from fpputil.optics.fringes import Fringe
from fpputil.optics.pinhole import Pinhole


def skin(bpy):
    """A matt material; its reflectance is the face's value "albedo" outside, and 0 inside.

    So a face seen from behind is black, as in the ray caster.
    """
    material, tree, diffuse = _material(bpy, "BsdfDiffuse")
    albedo = tree.nodes.new("ShaderNodeAttribute")
    albedo.attribute_name = "albedo"
    op = maths(tree)
    outside = op("SUBTRACT", 1.0, tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"])
    tree.links.new(op("MULTIPLY", albedo.outputs["Fac"], outside), diffuse.inputs["Color"])
    return material


def paint(bpy, colour):
    """A matt material of linear red, green, blue."""
    material, _, diffuse = _material(bpy, "BsdfDiffuse")
    diffuse.inputs["Color"].default_value = (*colour, 1.0)
    return material


def veil(bpy, colour, alpha: float):
    """What is seen through: a shine of linear red, green, blue that hides the share ``alpha``."""
    material, tree, mix = _material(bpy, "MixShader")
    material.cycles.emission_sampling = "NONE"  # it is seen, it does not light
    shine = tree.nodes.new("ShaderNodeEmission")
    shine.inputs["Color"].default_value = (*colour, 1.0)
    mix.inputs[0].default_value = alpha
    tree.links.new(tree.nodes.new("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[1])
    tree.links.new(shine.outputs[0], mix.inputs[2])
    return material


def glow_by_depth(bpy):
    """A material that shines with its distance along the camera's axis, metres."""
    material, tree, shine = _material(bpy, "Emission")
    depth = tree.nodes.new("ShaderNodeCameraData").outputs["View Z Depth"]
    tree.links.new(depth, shine.inputs["Color"])
    return material


def projector(bpy, pinhole: Pinhole, white_at: float):
    """The lamp of a projector: a point that throws an image. What it throws, `throw` says.

    A lamp of power P lights a white face, square to it at distance d, to ``P / (4 pi^2 d^2)``.
    """
    light = bpy.data.lights.new("projector", "SPOT")
    light.energy = 4 * np.pi**2 * (white_at / METRE) ** 2
    light.spot_size, light.spot_blend, light.shadow_soft_size = np.pi, 0.0, 0.0
    add(bpy, light, pinhole)
    return light


def daylight(bpy, eye: Pinhole, sky: float, sun: float) -> None:
    """Light from all around, and a broad sun above the eye's left shoulder."""
    world = bpy.data.worlds.new("sky")
    _, background = _surface(world, "Background", "OutputWorld")
    background.inputs["Color"].default_value = (sky, sky, sky, 1.0)
    bpy.context.scene.world = world
    light = bpy.data.lights.new("sun", "SUN")
    light.energy, light.angle = sun, np.radians(20)
    turn = Rotation.from_euler("xyz", (40, -30, 0), degrees=True).as_matrix()
    add(bpy, light, replace(eye, R=turn @ eye.R, t=-turn @ eye.R @ eye.centre))


def throw(light, pinhole: Pinhole, image: Callable) -> None:
    """Wire a projector's lamp: ``image(tree, u, v)`` makes the socket of the colour at (u, v)."""
    tree, shine = _surface(light, "Emission", "OutputLight")
    op = maths(tree)
    u, v = _pixel(tree, pinhole.K)
    inside = 1.0
    for at, size in ((u, pinhole.width), (v, pinhole.height)):
        inside = op("MULTIPLY", inside, op("GREATER_THAN", at, -0.5))
        inside = op("MULTIPLY", inside, op("LESS_THAN", at, size - 0.5))
    tree.links.new(image(tree, u, v), shine.inputs["Color"])
    tree.links.new(inside, shine.inputs["Strength"])


def pattern(fringe: Fringe) -> Callable:
    """What `throw` needs for a fringe (paper, Eq. 1). Its node "shift" holds n / N of a turn.

    The values are float32: one halfway between two grey levels may go either way.
    """

    def image(tree, u, v):
        op = maths(tree)
        shift = tree.nodes.new("ShaderNodeValue")
        shift.name = "shift"
        i = u if fringe.axis == "column" else v
        i = op("FLOOR", op("ADD", i, 0.5)) if fringe.grid else i
        turns = op("FRACT", op("ADD", op("DIVIDE", i, fringe.pitch), shift.outputs[0]))
        value = op("ADD", 0.5, op("MULTIPLY", 0.5, op("COSINE", op("MULTIPLY", turns, 2 * np.pi))))
        if fringe.levels is not None:
            top = fringe.levels - 1
            value = op("DIVIDE", op("ROUND", op("MULTIPLY", value, top)), top)
        return value if fringe.gamma == 1 else op("POWER", value, fringe.gamma)

    return image


def address(pinhole: Pinhole) -> Callable:
    """What `throw` needs for ((u + 1/2) / width, (v + 1/2) / height, 1) as red, green, blue."""

    def image(tree, u, v):
        op = maths(tree)
        colour = tree.nodes.new("ShaderNodeCombineXYZ")
        tree.links.new(op("DIVIDE", op("ADD", u, 0.5), pinhole.width), colour.inputs[0])
        tree.links.new(op("DIVIDE", op("ADD", v, 0.5), pinhole.height), colour.inputs[1])
        colour.inputs[2].default_value = 1.0
        return colour.outputs[0]

    return image


def check_pinhole(pinhole: Pinhole, fringes: Iterable[Fringe] = ()) -> None:
    """ValueError unless a lamp can be this projector and throw these patterns."""
    for fringe in fringes:
        if fringe.defocus:
            raise ValueError(
                f"defocus {fringe.defocus} given; Blender's projector is always sharp, the ray "
                "caster's blurs"
            )
        if fringe.start:
            raise ValueError(
                f"start {fringe.start} given; Blender's projector shows cosines, the ray caster any"
            )
    if pinhole.distortion.any():
        raise ValueError(
            f"a projector with distortion {pinhole.distortion.tolist()} given; Blender's light "
            "goes straight, the ray caster's bends"
        )


def maths(tree) -> Callable:
    """A function that adds a node of arithmetic: operation, then numbers or sockets; a socket."""

    def op(operation, *values):
        node = tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            if isinstance(value, int | float):
                socket.default_value = value
            else:
                tree.links.new(value, socket)
        return node.outputs[0]

    return op


def _pixel(tree, K):
    """Sockets of the pixel (u, v) through which a lamp shines; it looks along its own -z."""
    op = maths(tree)
    axes = tree.nodes.new("ShaderNodeSeparateXYZ")
    towards = tree.nodes.new("ShaderNodeTexCoord").outputs["Normal"]
    tree.links.new(towards, axes.inputs[0])
    x, y, z = axes.outputs
    ahead = op("MULTIPLY", z, -1.0)
    right, down = op("DIVIDE", x, ahead), op("DIVIDE", y, z)
    (fx, skew, cx), (_, fy, cy) = K[:2].tolist()
    u = op("ADD", op("ADD", op("MULTIPLY", right, fx), op("MULTIPLY", down, skew)), cx)
    return u, op("ADD", op("MULTIPLY", down, fy), cy)


def _surface(thing, kind: str, output: str):
    """The node tree of a material, lamp or world, and the node, of a kind, that its surface is."""
    if thing.node_tree is None:
        thing.use_nodes = True
    tree = thing.node_tree
    tree.nodes.clear()  # Blender 5 makes some by itself
    node, out = tree.nodes.new(f"ShaderNode{kind}"), tree.nodes.new(f"ShaderNode{output}")
    tree.links.new(node.outputs[0], out.inputs["Surface"])
    return tree, node


def _material(bpy, kind: str):
    """A new material, its node tree, and the node of its surface."""
    material = bpy.data.materials.new("paint")
    return material, *_surface(material, kind, "OutputMaterial")
