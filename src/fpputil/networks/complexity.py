"""What a network costs, measured on a forward pass of black photographs (chapter 8)."""

from copy import deepcopy
from dataclasses import dataclass

import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from fpputil.checks import whole


@dataclass(frozen=True)
class Cost:
    """Parameters of a network, and multiply-adds of its convolutions for one set of photographs."""

    parameters: int
    multiply_adds: int


def cost(network: nn.Module, size: tuple[int, int]) -> Cost:
    """What a network holds, and what one set of photographs costs it. Chapter 8.

    Parameters
    ----------
    network : nn.Module
        With `frames`, the numbers of photographs it takes; left as it was.
    size : (H, W)
        Of the photographs, pixels. What the network adds to them counts too.

    Examples
    --------
    >>> from fpputil.networks import SFNet
    >>> cost(SFNet(base=2, levels=2), (8, 8))
    Cost(parameters=932, multiply_adds=30208)
    """
    height, width = (whole(side, n, 1) for side, n in zip(("height", "width"), size, strict=True))
    weight = next(network.parameters())
    black = weight.new_zeros(1, sum(network.frames), height, width)
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        deepcopy(network).eval()(black)
    parameters = sum(p.numel() for p in network.parameters())
    return Cost(parameters, counter.get_total_flops() // 2)
