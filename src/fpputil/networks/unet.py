"""Blocks that every network here is built of: encoder, decoder, room for any size (chapter 8)."""

from collections.abc import Sequence
from copy import deepcopy

import torch
from torch import Tensor, nn

from fpputil.checks import not_negative, whole

GROUP = 4  # channels that are normalised together


def convolutions(before: int, after: int, normalised: bool = False) -> nn.Sequential:
    """Two 3 x 3 convolutions with zero padding and ReLU, between so many channels.

    `normalised`, each is followed by group normalisation, which no other image of a batch changes.
    """
    layers = []
    for channels in (before, after):
        layers.append(nn.Conv2d(channels, after, 3, padding=1))
        if normalised:
            layers.append(nn.GroupNorm(max(1, after // GROUP), after))
        layers.append(nn.ReLU(inplace=True))
    return nn.Sequential(*layers)


class Encoder(nn.Module):
    """Pairs of convolutions with max-pooling between them, to `widths` channels, finest first."""

    def __init__(self, frames: int, widths: Sequence[int], normalised: bool = False):
        super().__init__()
        pairs = zip((frames, *widths[:-1]), widths, strict=True)
        self.levels = nn.ModuleList(convolutions(*pair, normalised) for pair in pairs)

    def forward(self, x: Tensor) -> list[Tensor]:
        """Features of every level, finest first: (B, widths[k], H / 2^k, W / 2^k)."""
        features = []
        for k, level in enumerate(self.levels):
            x = level(nn.functional.max_pool2d(x, 2) if k else x)
            features.append(x)
        return features


class Decoder(nn.Module):
    """Transposed convolutions upward, joined at each level by the features of an encoder.

    Channels: `bottom` of the deepest features, `widths` of each level, `skips` of the features that
    join at each level but the deepest, `outputs` of the last, 1 x 1 convolution; finest first.
    """

    def __init__(
        self,
        bottom: int,
        widths: Sequence[int],
        skips: Sequence[int],
        outputs: int,
        normalised: bool = False,
    ):
        super().__init__()
        below, widths = (*widths[1:-1], bottom), widths[:-1]
        pairs = zip(below, widths, strict=True)
        self.up = nn.ModuleList(nn.ConvTranspose2d(b, w, 2, stride=2) for b, w in pairs)
        pairs = zip(widths, skips, strict=True)
        self.levels = nn.ModuleList(convolutions(w + s, w, normalised) for w, s in pairs)
        self.out = nn.Conv2d(widths[0], outputs, 1)

    def forward(self, x: Tensor, features: Sequence[Tensor]) -> Tensor:
        """Outputs (B, outputs, H, W) of the deepest features and the others', finest first."""
        for up, level, skip in reversed(list(zip(self.up, self.levels, features))):  # noqa: B905
            x = level(torch.cat([up(x), skip], 1))
        with torch.autocast(x.device.type, enabled=False):
            return self.out(x.float())


class UNet(nn.Module):
    """One encoder of so many frames, and for each number of outputs a decoder. Chapter 9.

    Other options as of `SFNet`.

    >>> network = UNet(3, (6, 1), base=2, levels=2, dropout=0.1)
    >>> [tuple(maps.shape) for maps in network(torch.zeros(1, 3, 12, 16))]
    [(1, 6, 12, 16), (1, 1, 12, 16)]
    """

    def __init__(
        self,
        frames: int,
        outputs: Sequence[int],
        base: int,
        levels: int,
        dropout: float,
        normalised: bool = False,
    ):
        super().__init__()
        self.frames = (whole("frames", frames, 1),)
        widths = widths_of(base, levels)
        self.encoder = Encoder(frames, widths, normalised)
        self.dropout = dropout_of(dropout)
        self.decoders = nn.ModuleList(
            Decoder(widths[-1], widths, widths[:-1], whole("outputs", n, 1), normalised)
            for n in outputs
        )
        initialise(self)

    def forward(self, frames: Tensor) -> list[Tensor]:
        """Of photographs (B, F, H, W) the outputs of each decoder, (B, C, H, W) float32."""
        taken(frames, self.frames)
        height, width = frames.shape[-2:]
        features = self.encoder(padded(frames, 2 ** (len(self.encoder.levels) - 1)))
        deepest = self.dropout(features[-1])
        return [d(deepest, features[:-1])[..., :height, :width] for d in self.decoders]


def widths_of(base: int, levels: int) -> list[int]:
    """Channels of each level, finest first: doubling from `base`."""
    return [whole("base", base, 1) * 2**k for k in range(whole("levels", levels, 2, 16))]


def dropout_of(share: float) -> nn.Dropout:
    """Dropout of a share of the deepest features, from 0 to below 1."""
    if not_negative("dropout", share) >= 1:
        raise ValueError(f"dropout {share} given; a share from 0 to below 1 is needed")
    return nn.Dropout(share)


def taken(frames: Tensor, numbers: Sequence[int]) -> None:
    """Raise unless frames are as many photographs as a network of `numbers` takes."""
    if frames.ndim != 4 or frames.shape[1] != sum(numbers):
        raise ValueError(
            f"frames of shape {tuple(frames.shape)} given; this network takes "
            f"(B, {sum(numbers)}, H, W), {numbers[0]} of the high pitch first"
        )


def padded(frames: Tensor, multiple: int) -> Tensor:
    """Frames (B, F, H, W) with zeros to the right and below, both sides multiples of `multiple`."""
    height, width = (-side % multiple for side in frames.shape[-2:])
    return nn.functional.pad(frames, (0, width, 0, height))


def initialise(network: nn.Module) -> None:
    """He's normal initialisation for ReLU, biases zero; draws from torch's generator."""
    for layer in network.modules():
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d):
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
            nn.init.zeros_(layer.bias)


def lowered(network: nn.Module, dtype: torch.dtype) -> nn.Module:
    """A copy for measuring that keeps its weights in `dtype`, the last convolutions in float32.

    It makes what autocast makes, without casting every weight for every photograph. Chapter 8.
    """
    copy = deepcopy(network).to(dtype, memory_format=torch.channels_last)
    for part in copy.modules():
        if isinstance(part, Decoder):
            part.out.float()
    return copy
