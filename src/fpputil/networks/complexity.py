"""What a network is made of: its cost and its feature maps (chapter 8).

Everything is measured on a forward pass of black photographs, not read off the settings.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from fpputil.checks import whole
from fpputil.networks.sfnet import SFNet

Shape = tuple[int, int, int]
"""Channels, height and width of a feature map."""


@dataclass(frozen=True)
class Cost:
    """Parameters of a network, and multiply-adds of its convolutions for one set of photographs."""

    parameters: int
    multiply_adds: int


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


def cost(network: nn.Module, size: tuple[int, int]) -> Cost:
    """What a network holds, and what one set of photographs costs it. Chapter 8.

    Parameters
    ----------
    network : nn.Module
        With `frames`, the numbers of photographs it takes; left as it was.
    size : (H, W)
        Of the photographs, pixels. What the network adds to them counts too.

    Raises
    ------
    ValueError
        If the size is not two whole numbers of 1 or more.
    """
    with FlopCounterMode(display=False) as counter:
        _run(deepcopy(network), size)
    parameters = sum(p.numel() for p in network.parameters())
    return Cost(parameters, counter.get_total_flops() // 2)


def trace(network: SFNet, size: tuple[int, int]) -> tuple[Half, Half]:
    """Shapes of the feature maps of both halves, high pitch first; as for `cost`. Chapter 8."""
    network, seen = deepcopy(network), {}  # so that the hooks go with the copy

    def note(module, given, made):
        seen[module] = _shapes(given), _shapes(made)

    for part in (*network.encoders, *network.decoders):
        for module in part.modules():
            module.register_forward_hook(note)
    _run(network, size)
    high, low = zip(network.encoders, network.decoders, strict=True)
    return _half(seen, *high), _half(seen, *low)


def _half(seen, encoder, decoder) -> Half:
    ((taken,), features), ((deepest, skips), output) = seen[encoder], seen[decoder]
    up, refined = ([seen[m][1] for m in part] for part in (decoder.up, decoder.levels))
    return Half(taken, features, deepest, skips, up, refined, output)


def _shapes(given):
    """Shapes of a tensor or of nested sequences of tensors, without the number of sets."""
    return tuple(given.shape[1:]) if isinstance(given, Tensor) else [_shapes(g) for g in given]


def _run(network, size) -> None:
    height, width = (whole(side, n, 1) for side, n in zip(("height", "width"), size, strict=True))
    weight = next(network.parameters())
    with torch.no_grad():
        network.eval()(weight.new_zeros(1, sum(network.frames), height, width))
