"""SFNet, the symmetric fusion network: two photographs to two wrapped phases (chapter 8)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from fpputil.checks import whole
from fpputil.networks.unet import (
    Decoder,
    Encoder,
    dropout_of,
    initialise,
    padded,
    taken,
    widths_of,
)

MIXING = ("none", "deepest", "every level")


class SFNet(nn.Module):
    """Two encoders, their features joined, two decoders. Section 4.1, Fig. 2; chapter 8.

    Parameters
    ----------
    frames : (int, int)
        Photographs of the high and of the low pitch: (1, 1), (2, 2) or (3, 3) in Table 5.
    base : int
        Channels of the finest level; each level below has twice as many. Not in the paper.
    levels : int
        Pairs of convolutions in each encoder; the paper's 12 convolutions are 6 levels.
    dropout : float
        Share of the joined deepest features dropped in training. Not in the paper.
    mixing : str
        Whose features a decoder sees: of its own encoder ("none", row A of Table 4), of both at
        the "deepest" level (as the paper's text has it), or of both at "every level".
    outputs : int
        Channels each decoder ends in, 1 or more: 2 for M and D, 1 for a phase predicted directly.

    Raises
    ------
    ValueError
        If a number is not positive, the dropout not in [0, 1), or the mixing unknown.
    """

    def __init__(
        self,
        frames: tuple[int, int] = (1, 1),
        base: int = 8,
        levels: int = 6,
        dropout: float = 0.1,
        mixing: str = "deepest",
        outputs: int = 2,
    ):
        super().__init__()
        self.frames = tuple(whole("frames", n, 1) for n in frames)
        if len(self.frames) != 2:
            raise ValueError(f"frames {frames} given; one number for each of the two pitches")
        if mixing not in MIXING:
            raise ValueError(f"mixing {mixing!r} given; one of {', '.join(MIXING)} is needed")
        self.mixing, outputs = mixing, whole("outputs", outputs, 1)
        widths = widths_of(base, levels)
        bottom = widths[-1] * (1 if mixing == "none" else 2)
        skips = [w * (2 if mixing == "every level" else 1) for w in widths[:-1]]
        self.encoders = nn.ModuleList(Encoder(n, widths) for n in self.frames)
        self.dropout = dropout_of(dropout)
        self.decoders = nn.ModuleList(Decoder(bottom, widths, skips, outputs) for _ in range(2))
        initialise(self)

    def forward(self, frames: Tensor) -> Tensor:
        """Numerators and denominators of both phases.

        Parameters
        ----------
        frames : (B, F, H, W) tensor
            Photographs, 0 to 1, those of the high pitch first; any size.

        Returns
        -------
        (B, 2, outputs, H, W) float32 tensor
            High pitch, then refined reference; of each M, then D.
        """
        taken(frames, self.frames)
        height, width = frames.shape[-2:]
        room = padded(frames, 2 ** (len(self.encoders[0].levels) - 1))
        pyramids = [
            encoder(part)
            for encoder, part in zip(self.encoders, room.split(self.frames, 1), strict=True)
        ]
        joined = [
            torch.cat(pair, 1) if self._mixed(k) else None
            for k, pair in enumerate(zip(*pyramids, strict=True))
        ]
        outputs = []
        for decoder, own in zip(self.decoders, pyramids, strict=True):
            *skips, deepest = (o if j is None else j for o, j in zip(own, joined, strict=True))
            outputs.append(decoder(self.dropout(deepest), skips))
        return torch.stack(outputs, 1)[..., :height, :width]

    def _mixed(self, level: int) -> bool:
        """Whether both decoders see the features of both encoders at a level."""
        deepest = level == len(self.encoders[0].levels) - 1
        return self.mixing == "every level" or (self.mixing == "deepest" and deepest)
