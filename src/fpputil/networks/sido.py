"""SIDO: one photograph to five, and a coarse absolute phase for the order (chapter 9)."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn

from fpputil.decoding.unwrap import absolute_phase, fringe_order
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Pixels, mean_squared
from fpputil.networks.targets import Method, noiseless, phase_of
from fpputil.networks.unet import UNet
from fpputil.optics.system import STEPS, Frame

PREDICTED = 5
"""Frames that come out; the paper took five, a divisor of the dataset's fifteen."""


class SIDO(nn.Module):
    """Single input, double output: one encoder, two decoders. Section 6.2 of the paper; chapter 9.

    With `plane`, a photograph of the reference plane goes in beside that of the object. Other
    options as of `SFNet`.

    >>> SIDO(base=2, levels=2)(torch.zeros(1, 2, 12, 16)).shape
    torch.Size([1, 6, 12, 16])
    """

    def __init__(self, plane: bool = True, base: int = 8, levels: int = 6, dropout: float = 0.1):
        super().__init__()
        self.net = UNet(1 + plane, (PREDICTED, 1), base, levels, dropout)
        self.frames = self.net.frames

    def forward(self, frames: Tensor) -> Tensor:
        """Of photographs (B, F, H, W): (B, PREDICTED + 1, H, W), the frames, then the phase."""
        return torch.cat(self.net(frames), 1)


@dataclass(frozen=True)
class SIDOMethod(Method):
    """SIDO: a photograph of the high pitch to five of its steps and a coarse absolute phase.

    The coarse phase is that of the unit pitch, so both decoders answer in numbers of order one.
    The paper does not say at which pitch, nor how the two losses are weighed: ours.

    With `plane`, a photograph of the empty plane z_max goes in beside that of the object.
    """

    plane: bool = True
    base: int = 10
    levels: int = 6
    dropout: float = 0.1

    photographs: ClassVar[tuple[Frame, ...]] = (("high", STEPS, 0),)
    reference: ClassVar[None] = None

    def network(self) -> nn.Module:
        return SIDO(self.plane, self.base, self.levels, self.dropout)

    def inputs(self, frames: Tensor, geometry: Geometry) -> Tensor:
        """What the network sees of photographs (B, 1, H, W): that of the plane, too."""
        if not self.plane:
            return frames
        low, high = geometry.extremes
        Phi = geometry.Phi_plane
        light = torch.where(Phi.isfinite(), 255 / 2 * (1 + Phi.cos()), 0)
        return torch.cat([frames, ((light - low) / (high - low)).expand_as(frames)], 1)

    def phases(self, outputs: Tensor) -> tuple[Tensor, None]:
        """phi_h (B, ...) of outputs (B, 6, ...), radians; there is no second wrapped phase."""
        return phase_of(outputs[:, :PREDICTED]), None

    def absolute_phase(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, (B, H, W): its order is that of the coarse phase."""
        phi_h, _ = self.phases(outputs)
        ratio = geometry.pitches.unit / geometry.pitches.high
        return absolute_phase(phi_h, fringe_order(phi_h, outputs[:, PREDICTED], ratio))

    def losses(self, outputs: Tensor, batch: dict, geometry: Geometry) -> dict[str, Tensor]:
        """Mean squared errors of photographs and of coarse phase, and their sum, (B,) each."""
        pixels = Pixels.of(batch["mask"])
        predicted = pixels.of_images(outputs)
        frames = pixels.of_images(noiseless(batch, "high", PREDICTED, geometry))
        coarse = batch["Phi"][pixels.mask] * (geometry.pitches.high / geometry.pitches.unit)
        parts = {
            "frames": mean_squared(pixels, predicted[:, :PREDICTED], frames),
            "phase": mean_squared(pixels, predicted[:, PREDICTED], coarse),
        }
        return {**parts, "total": sum(parts.values())}
