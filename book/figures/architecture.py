"""The figure of SFNet in chapter 8: every feature map of a forward pass, and the ways between them.

``python book/figures/architecture.py`` writes ``book/assets/sfnet.svg``.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Patch, Rectangle
from torch import Tensor

from fpputil.networks.complexity import cost
from fpputil.networks.sfnet import SFNet, SFNetMethod
from fpputil.plotting import COLOURS, INK

OUT = Path(__file__).parents[1] / "assets" / "sfnet.svg"
STYLE = {"svg.hashsalt": "sfnet", "svg.fonttype": "path", "font.family": "DejaVu Sans"}

PITCHES, TARGETS = ("high pitch", "low pitch"), ("high pitch", "refined reference")
COLOUR, JOINED, PLAIN = (COLOURS[0], COLOURS[1]), COLOURS[3], COLOURS[5]
OPEN = "#b9c3cb"  # opaque, for lines end behind it; seen on white and on dark

# Lengths in inches; the two halves of the drawing mirror each other about y = 0.
PAGE, MARGIN = 8.0, 1.05
TALLEST, WIDEST, NARROWEST = 0.5, 0.7, 0.05
DEEPEST, GAP, LANE = 0.36, 0.16, 0.055
SMALL = 6.5  # points

TURNS = {
    "straight": "arc3",
    "down": "angle,angleA=90,angleB=0,rad=0",
    "across": "angle,angleA=0,angleB=90,rad=0",
}


Shape = tuple[int, int, int]
"""Channels, height and width of a feature map."""


@dataclass(frozen=True)
class Half:
    """Feature maps of one encoder and one decoder; lists finest first.

    Parameters
    ----------
    input, deepest, output : Shape
        Into the encoder, into the decoder, out of the decoder.
    encoder : list of L Shapes
        After the convolutions of each level.
    skips, up, decoder : lists of L - 1 Shapes
        Features that join, after each transposed convolution, after the convolutions.
    """

    input: Shape
    encoder: Sequence[Shape]
    deepest: Shape
    skips: Sequence[Shape]
    up: Sequence[Shape]
    decoder: Sequence[Shape]
    output: Shape


def trace(network: SFNet, size: tuple[int, int]) -> tuple[Half, Half]:
    """Shapes of the feature maps of both halves, high pitch first, of photographs (H, W)."""
    network, shapes = deepcopy(network).eval(), {}  # so that the hooks go with the copy

    def note(module, inputs, outputs):
        shapes[module] = _shapes(inputs), _shapes(outputs)

    for part in (*network.encoders, *network.decoders):
        for module in part.modules():
            module.register_forward_hook(note)
    with torch.no_grad():
        network(torch.zeros(1, sum(network.frames), *size))
    high, low = zip(network.encoders, network.decoders, strict=True)
    return _half(shapes, *high), _half(shapes, *low)


def _half(shapes, encoder, decoder) -> Half:
    ((first,), features), ((deepest, skips), output) = shapes[encoder], shapes[decoder]
    up, refined = ([shapes[m][1] for m in part] for part in (decoder.up, decoder.levels))
    return Half(first, features, deepest, skips, up, refined, output)


def _shapes(tensors):
    """Shapes of a tensor or of nested sequences of tensors, without the number of sets."""
    if isinstance(tensors, Tensor):
        return tuple(tensors.shape[1:])
    return [_shapes(tensor) for tensor in tensors]


def draw(network: SFNet, size: tuple[int, int]) -> Figure:
    """Figure of the feature maps of a network and of the ways between them.

    A block grows with its channels in width and with its rows in height, both by a root.

    Parameters
    ----------
    network : SFNet
    size : (H, W)
        Of the photographs, pixels.
    """
    halves, spent = trace(network, size), cost(network, size)
    top = _rows(halves[0])[0] + TALLEST / 2 + 0.2
    figure = Figure(figsize=(PAGE, 2 * top), layout="none")
    ax: Axes = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, PAGE), ylim=(-top, top), aspect="equal")
    ax.axis("off")
    ends = [(_draw_encoder(ax, h, k), _draw_decoder(ax, h, k)) for k, h in enumerate(halves)]
    _draw_bottom(ax, halves[0], ends)
    _draw_skips(ax, ends)
    _explain(ax, halves[0], spent, size)
    return figure


def _box(shape: Shape, half: Half) -> tuple[float, float]:
    """Width and height of a map; roots, or the deepest ones would be too small to see."""
    width = WIDEST * (shape[0] / half.encoder[-1][0] / 2) ** 0.5  # joined, they are twice as many
    return max(width, NARROWEST), TALLEST * (shape[1] / half.input[1]) ** 0.4


def _rows(half: Half) -> list[float]:
    """Where the levels stand above y = 0, finest first."""
    heights = [_box(shape, half)[1] for shape in half.encoder]
    rows = [DEEPEST]
    for lower, upper in zip(heights[:0:-1], heights[-2::-1], strict=True):
        rows.append(rows[-1] + (lower + upper) / 2 + GAP)
    return rows[::-1]


def _columns(half: Half) -> tuple[list[float], list[float]]:
    """Where the maps stand from the left: input and encoder, output and decoder, finest first."""
    first, last, *widths = (_box(s, half)[0] for s in (half.input, half.output, *half.encoder))
    left = [MARGIN + first / 2, MARGIN + first + GAP + widths[0] / 2]
    right = [PAGE - MARGIN - last / 2, PAGE - MARGIN - last - GAP - widths[0] / 2]
    for before, width in pairwise(widths):
        left.append(left[-1] + GAP + width / 2)
        right.append(right[-1] - GAP / 2 - before)
    return left, right


def _draw_encoder(ax, half: Half, which: int) -> list[Rectangle]:
    """The way down; the blocks that skips start from."""
    outward, colour = (1, -1)[which], COLOUR[which]
    rows, (start, *xs) = [outward * y for y in _rows(half)], _columns(half)[0]
    first = _block(ax, half.input, half, (start, rows[0]), PLAIN)
    _label(ax, f"{PITCHES[which]}\n{_text(half.input)}", MARGIN - 0.05, rows[0], "right")
    blocks = []
    for shape, *at in zip(half.encoder, xs, rows, strict=True):
        blocks.append(_block(ax, shape, half, at, colour))
        _label(ax, _text(shape), _right(blocks[-1]), at[1] + 0.08 * outward, "left")
    _way(ax, first, blocks[0])
    for a, b in pairwise(blocks):
        _way(ax, a, b, "down")
    return blocks


def _draw_decoder(ax, half: Half, which: int) -> list[Rectangle]:
    """The way up; the blocks that skips end at."""
    outward, colour = (1, -1)[which], COLOUR[which]
    rows, (end, *xs) = [outward * y for y in _rows(half)][:-1], _columns(half)[1]
    last = _block(ax, half.output, half, (end, rows[0]), PLAIN)
    _label(ax, f"{TARGETS[which]}\n{_text(half.output)}", _right(last), rows[0], "left")
    above = [last]
    for shape, up, (x, left), y in zip(half.decoder, half.up, pairwise(xs), rows, strict=True):
        block = _block(ax, shape, half, (x, y), colour)
        _way(ax, block, above[-1])
        above.append(_block(ax, up, half, (left, y), colour, OPEN))
        _way(ax, above[-1], block, head="-")
        if y == rows[0]:  # the output stands where its label would
            _label(ax, _text(shape), x, y + (TALLEST / 2 + 0.09) * outward, "center")
        else:
            _label(ax, _text(shape), _right(block), y, "left")
    return above[1:]


def _draw_bottom(ax, half: Half, ends) -> None:
    """From the deepest features, joined in the middle, to both decoders."""
    encoder, up = ends[0]
    beside = up[-1].get_x() - LANE * (2 * len(up) + 1)
    x = (_right(encoder[-1]) + beside) / 2
    joined = _block(ax, half.deepest, half, (x, 0), JOINED)
    _label(ax, f"joined {_text(half.deepest)}", joined.get_x() - 0.06, 0, "right")
    for encoder, up in ends:
        _way(ax, encoder[-1], joined, "across")
        _way(ax, joined, up[-1], "across")


def _draw_skips(ax, ends) -> None:
    """Skips from each encoder to the decoder of the same half."""
    for colour, (encoder, up) in zip(COLOUR, ends, strict=True):
        for a, b in zip(encoder, up, strict=False):
            _way(ax, a, b, colour=colour)


def _block(ax, shape, half, centre, colour, fill=None) -> Rectangle:
    width, height = _box(shape, half)
    corner = (centre[0] - width / 2, centre[1] - height / 2)
    look = {"facecolor": fill or colour, "edgecolor": colour, "linewidth": 0.8, "zorder": 3}
    return ax.add_patch(Rectangle(corner, width, height, **look))


def _way(
    ax,
    a,
    b,
    turn="straight",
    head="-|>",
    colour=INK,
):
    """An arrow from the middle of a block, which hides its start, to the edge of another."""
    ends = {"posA": a.get_center(), "posB": b.get_center(), "patchB": b, "shrinkB": 0}
    _arrow(ax, colour, head, connectionstyle=TURNS[turn], shrinkA=0, **ends)


def _arrow(ax, colour, head="-|>", **path):
    look = {"arrowstyle": head, "mutation_scale": 6, "linewidth": 0.7, "zorder": 2}
    ax.add_patch(FancyArrowPatch(color=colour, **look, **path))


def _label(ax, text, x, y, align):
    ax.text(x, y, text, ha=align, va="center", fontsize=SMALL)


def _text(shape) -> str:
    return " × ".join(map(str, shape))


def _right(block) -> float:
    return block.get_x() + block.get_width() + 0.05


def _explain(ax, half, spent, size):
    """What the blocks and lines mean, and what the network costs."""
    handles = [
        Patch(facecolor=COLOUR[0], label="after two 3 × 3 convolutions"),
        Patch(facecolor=OPEN, edgecolor=COLOUR[0], label="after a transposed convolution"),
        Line2D([], [], color=COLOUR[0], linewidth=0.7, label="skip"),
    ]
    place = {"loc": "center left", "bbox_to_anchor": (0, 0.5), "fontsize": SMALL}
    ax.legend(handles=handles, handlelength=1.2, **place)
    padded = "" if half.input[1:] == size else f", padded to {_text(half.input[1:])}"
    lines = [
        f"{_text(size)} pixels{padded}",
        f"{spent.parameters:,} parameters",
        f"{spent.multiply_adds:,} multiply-adds",
    ]
    _label(ax, "\n".join(lines), PAGE - 0.1, 0, "right")


def write(path: Path = OUT) -> None:
    """Write the figure that chapter 8 shows; the same bytes every time."""
    torch.manual_seed(0)
    with mpl.rc_context(STYLE):
        figure = draw(SFNetMethod().network(), (120, 160))
        figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    write()
