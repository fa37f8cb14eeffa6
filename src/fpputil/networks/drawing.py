"""A figure of the feature maps of a network, as they are when it runs (chapter 8)."""

from __future__ import annotations

from itertools import pairwise

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Patch, Rectangle
from matplotlib.path import Path

from fpputil.networks.complexity import Half, Shape, cost, trace
from fpputil.networks.sfnet import SFNet
from fpputil.plotting import COLOURS

PITCHES, TARGETS = ("high pitch", "low pitch"), ("high pitch", "refined reference")
COLOUR, JOINED, PLAIN = (COLOURS[0], COLOURS[1]), COLOURS[3], COLOURS[5]

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


def draw(network: SFNet, size: tuple[int, int], ax: Axes | None = None) -> Axes:
    """Figure of the feature maps of a network and of the ways between them. Chapter 8.

    A block grows with its channels in width and with its rows in height, both by a root.

    Parameters
    ----------
    network : SFNet
        Left as it was.
    size : (H, W)
        Of the photographs, pixels.
    ax : Axes, optional
        By default of a new figure, 8 inches wide; the labels need as much of any other.

    Returns
    -------
    Axes
        Its artists have the gids "map", "way", "skip", "crossing" and "label".
    """
    halves, spent = trace(network, size), cost(network, size)
    top = _rows(halves[0])[0] + TALLEST / 2 + 0.2
    if ax is None:
        ax = plt.figure(figsize=(PAGE, 2 * top), layout="none").add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, PAGE), ylim=(-top, top), aspect="equal")
    ax.axis("off")
    ends = [(_draw_encoder(ax, h, k), _draw_decoder(ax, h, k)) for k, h in enumerate(halves)]
    _draw_bottom(ax, halves[0], ends)
    _draw_skips(ax, halves, ends)
    _explain(ax, halves[0], spent, size)
    return ax


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
        above.append(_block(ax, up, half, (left, y), colour, "white"))
        _way(ax, above[-1], block, head="-")
        if y == rows[0]:  # the output stands where its label would
            _label(ax, _text(shape), x, y + (TALLEST / 2 + 0.09) * outward, "center")
        else:
            _label(ax, _text(shape), _right(block), y, "left")
    return above[1:]


def _draw_bottom(ax, half: Half, ends) -> None:
    """From the deepest features to the decoders: joined in the middle, or each to its own."""
    if half.deepest == half.encoder[-1]:
        for encoder, up in ends:
            _way(ax, encoder[-1], up[-1], "across")
        return
    encoder, up = ends[0]
    x = (_right(encoder[-1]) + _lanes(up)) / 2
    joined = _block(ax, half.deepest, half, (x, 0), JOINED)
    _label(ax, f"joined {_text(half.deepest)}", joined.get_x() - 0.06, 0, "right")
    for encoder, up in ends:
        _way(ax, encoder[-1], joined, "across")
        _way(ax, joined, up[-1], "across")


def _draw_skips(ax, halves, ends) -> None:
    """Skips to the decoder of the same half, and, where more channels come in, to the other."""
    for which, (half, (encoder, up)) in enumerate(zip(halves, ends, strict=True)):
        for k, (a, b, joins) in enumerate(zip(encoder, up, half.skips, strict=False)):
            _way(ax, a, b, colour=COLOUR[which], gid="skip")
            if joins[0] > half.encoder[k][0]:
                _cross(ax, b, _lanes(up) + LANE * (2 * k + which), COLOUR[1 - which])


def _cross(ax, block, lane, colour) -> None:
    """From the skip of the other half along a lane to a block of this one."""
    y = block.get_center()[1]
    beside = y - 0.05 if y > 0 else y + 0.05
    path = Path([(lane, -y), (lane, beside), (block.get_x(), beside)])
    _arrow(ax, colour, "crossing", path=path)
    ax.plot(lane, -y, ".", markersize=4, color=colour)


def _lanes(up) -> float:
    """Where the lanes of the crossings begin from the left."""
    return up[-1].get_x() - LANE * (2 * len(up) + 1)


def _block(ax, shape, half, centre, colour, fill=None) -> Rectangle:
    width, height = _box(shape, half)
    corner = (centre[0] - width / 2, centre[1] - height / 2)
    look = {"facecolor": fill or colour, "edgecolor": colour, "linewidth": 0.8, "zorder": 3}
    return ax.add_patch(Rectangle(corner, width, height, gid="map", **look))


def _way(ax, a, b, turn="straight", head="-|>", colour="black", gid="way"):
    """An arrow from the middle of a block, which hides its start, to the edge of another."""
    ends = {"posA": a.get_center(), "posB": b.get_center(), "patchB": b, "shrinkB": 0}
    _arrow(ax, colour, gid, head, connectionstyle=TURNS[turn], shrinkA=0, **ends)


def _arrow(ax, colour, gid, head="-|>", **path):
    look = {"arrowstyle": head, "mutation_scale": 6, "linewidth": 0.7, "zorder": 2}
    ax.add_patch(FancyArrowPatch(color=colour, gid=gid, **look, **path))


def _label(ax, text, x, y, align):
    ax.text(x, y, text, ha=align, va="center", fontsize=SMALL, gid="label")


def _text(shape) -> str:
    return " × ".join(map(str, shape))


def _right(block) -> float:
    return block.get_x() + block.get_width() + 0.05


def _explain(ax, half, spent, size):
    """What the blocks and lines mean, and what the network costs."""
    handles = [
        Patch(facecolor=COLOUR[0], label="after two 3 × 3 convolutions"),
        Patch(facecolor="white", edgecolor=COLOUR[0], label="after a transposed convolution"),
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
