"""SIDO, one photograph to phase-shifted frames and a coarse absolute phase (chapter 9)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from fpputil.networks.unet import UNet

STEPS = 5
"""Frames that come out; the paper took five, a divisor of the dataset's fifteen."""


class SIDO(nn.Module):
    """Single input, double output: one encoder, two decoders. Section 6.2 of the paper; chapter 9.

    Parameters
    ----------
    plane : bool
        Whether a photograph of the reference plane goes in beside that of the object.
    base, levels, dropout
        As of `SFNet`.
    """

    def __init__(self, plane: bool = True, base: int = 8, levels: int = 6, dropout: float = 0.1):
        super().__init__()
        self.net = UNet(1 + plane, (STEPS, 1), base, levels, dropout)
        self.frames = self.net.frames

    def forward(self, frames: Tensor) -> Tensor:
        """Of photographs (B, F, H, W): (B, STEPS + 1, H, W), the frames, then the phase."""
        return torch.cat(self.net(frames), 1)
