"""PSNet, one photograph to the other phase-shifted ones of its pitch (chapter 9)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from fpputil.networks.unet import UNet, taken


class PSNet(nn.Module):
    """Two networks side by side, one for each pitch, that share nothing. Section 6.2; chapter 9.

    Parameters
    ----------
    steps : int
        Of the phase shifting: one photograph goes in, the others come out.
    base, levels, dropout
        As of `SFNet`.
    """

    def __init__(self, steps: int = 15, base: int = 8, levels: int = 6, dropout: float = 0.1):
        super().__init__()
        self.nets = nn.ModuleList(UNet(1, (steps - 1,), base, levels, dropout) for _ in range(2))
        self.frames = (1, 1)

    def forward(self, frames: Tensor) -> Tensor:
        """Of photographs (B, 2, H, W), step 0 of each pitch: (B, 2, steps, H, W), 0 as it is."""
        taken(frames, self.frames)
        pairs = zip(self.nets, frames.split(1, 1), strict=True)
        return torch.stack([torch.cat([shot, *net(shot)], 1) for net, shot in pairs], 1)
