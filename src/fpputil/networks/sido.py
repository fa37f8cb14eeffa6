"""SIDO: one photograph to five, and a coarse absolute phase for the order (chapter 9)."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn

from fpputil.checks import positive
from fpputil.decoding.unwrap import absolute_phase, fringe_order
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Pixels, mean_squared
from fpputil.networks.targets import TARGETS, Method, check_errors, phase_of
from fpputil.networks.unet import UNet
from fpputil.optics.system import STEPS, Frame

PREDICTED = 5
"""Frames that come out; the paper took five, a divisor of the dataset's fifteen."""


class SIDO(nn.Module):
    """Single input, double output: one encoder, two decoders. Section 6.2 of the paper; chapter 9.

    With `plane`, a photograph of the reference plane goes in beside that of the object, and
    `extra` channels beside both. Other options as of `SFNet`.

    >>> SIDO(base=2, levels=2)(torch.zeros(1, 2, 12, 16)).shape
    torch.Size([1, 6, 12, 16])
    """

    def __init__(
        self,
        plane: bool = True,
        base: int = 8,
        levels: int = 6,
        dropout: float = 0.1,
        normalised: bool = False,
        extra: int = 0,
    ):
        super().__init__()
        self.net = UNet(1 + plane + extra, (PREDICTED, 1), base, levels, dropout, normalised)
        self.frames = self.net.frames

    def forward(self, frames: Tensor) -> Tensor:
        """Of photographs (B, F, H, W): (B, PREDICTED + 1, H, W), the frames, then the phase."""
        return torch.cat(self.net(frames), 1)


@dataclass(frozen=True)
class SIDOMethod(Method):
    """SIDO: a photograph of the high pitch to five of its steps and a coarse absolute phase.

    The coarse phase is that of the unit pitch, so both decoders answer in numbers of order one.
    The paper does not say at which pitch, nor how the two losses are weighed: ours.

    Parameters
    ----------
    plane : bool
        Whether a photograph of the empty plane z_max goes in beside that of the object.
    errors : str
        "grey": photographs come out, and errors count in grey levels. "fringe", ours: the fringe
        of `fringes_of` comes out, so that all pixels count alike.
    phase_weight : float
        Weight of the squared error of the coarse phase, in radians of the unit pitch.
    base, levels, dropout, normalised
        As of `SFNet`.
    coordinates
        As of `Method`.
    """

    plane: bool = True
    base: int = 10
    levels: int = 6
    dropout: float = 0.1
    normalised: bool = False
    coordinates: bool = False
    errors: str = "grey"
    phase_weight: float = 1.0

    photographs: ClassVar[tuple[Frame, ...]] = (("high", STEPS, 0),)
    reference: ClassVar[None] = None

    def __post_init__(self):
        super().__post_init__()
        check_errors(self.errors)
        positive("phase_weight", self.phase_weight)

    def network(self) -> nn.Module:
        options = (self.levels, self.dropout, self.normalised, 2 * self.coordinates)
        return SIDO(self.plane, self.base, *options)

    def inputs(self, frames: Tensor, geometry: Geometry) -> Tensor:
        """What the network sees of photographs (B, 1, H, W): that of the plane, too."""
        seen = super().inputs(frames, geometry)
        if not self.plane:
            return seen
        low, high = geometry.extremes
        Phi = geometry.Phi_plane
        light = torch.where(Phi.isfinite(), 255 / 2 * (1 + Phi.cos()), 0)
        return torch.cat([seen, ((light - low) / (high - low)).expand_as(frames)], 1)

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
        frames = pixels.of_images(TARGETS[self.errors](batch, "high", PREDICTED, geometry))
        coarse = batch["Phi"][pixels.mask] * (geometry.pitches.high / geometry.pitches.unit)
        parts = {
            "frames": mean_squared(pixels, predicted[:, :PREDICTED], frames),
            "phase": mean_squared(pixels, predicted[:, PREDICTED], coarse),
        }
        return {**parts, "total": parts["frames"] + self.phase_weight * parts["phase"]}
