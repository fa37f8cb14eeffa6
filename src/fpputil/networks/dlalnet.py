"""DLALNet, three photographs to numerator and denominator of each (chapter 9)."""

from __future__ import annotations

from torch import Tensor, nn

from fpputil.networks.unet import UNet


class DLALNet(nn.Module):
    """One encoder, one decoder, three pitches at once. Section 6.2 of the paper; chapter 9.

    Parameters
    ----------
    base, levels, dropout
        As of `SFNet`.
    """

    def __init__(self, base: int = 8, levels: int = 6, dropout: float = 0.1):
        super().__init__()
        self.net = UNet(3, (6,), base, levels, dropout)
        self.frames = self.net.frames

    def forward(self, frames: Tensor) -> Tensor:
        """Of photographs (B, 3, H, W) of three pitches: M, then D of each, (B, 3, 2, H, W)."""
        return self.net(frames)[0].unflatten(1, (3, 2))
