"""SIDO: one photograph to five, and a coarse absolute phase for the order (chapter 9)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn

from fpputil.decoding.unwrap import absolute_phase, fringe_order
from fpputil.networks import sido
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Pixels, mean_squared
from fpputil.networks.targets import noiseless, phase_of
from fpputil.optics.system import STEPS, Frame


@dataclass(frozen=True)
class SIDOMethod:
    """SIDO: a photograph of the high pitch to five of its steps and a coarse absolute phase.

    The coarse phase is that of the unit pitch, so both decoders answer in numbers of order one.
    The paper does not say at which pitch, nor how the two losses are weighed: ours.

    Parameters
    ----------
    plane : bool
        Whether a photograph of the empty plane z_max goes in beside that of the object.
    base, levels, dropout
        As of `SFNet`.
    """

    plane: bool = True
    base: int = 10
    levels: int = 6
    dropout: float = 0.1

    photographs: ClassVar[tuple[Frame, ...]] = (("high", STEPS, 0),)
    reference: ClassVar[None] = None

    def __post_init__(self):
        with torch.device("meta"):
            self.network()  # its options are checked there

    def network(self) -> nn.Module:
        """The network, its weights drawn from torch's generator."""
        return sido.SIDO(self.plane, self.base, self.levels, self.dropout)

    def inputs(self, frames: Tensor, geometry: Geometry) -> Tensor:
        """What the network sees of photographs (B, 1, H, W): that of the plane, too."""
        if not self.plane:
            return frames
        low, high = geometry.extremes
        light = torch.where(
            geometry.Phi_plane.isfinite(), 255 / 2 * (1 + geometry.Phi_plane.cos()), 0
        )
        return torch.cat([frames, ((light - low) / (high - low)).expand_as(frames)], 1)

    def phases(self, outputs: Tensor) -> tuple[Tensor, None]:
        """phi_h (B, ...) of outputs (B, 6, ...), radians; there is no second wrapped phase."""
        return phase_of(outputs[:, : sido.STEPS]), None

    def absolute_phase(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, (B, H, W): its order is that of the coarse phase."""
        phi_h, _ = self.phases(outputs)
        ratio = geometry.pitches.unit / geometry.pitches.high
        return absolute_phase(phi_h, fringe_order(phi_h, outputs[:, sido.STEPS], ratio))

    def losses(self, outputs: Tensor, batch: dict, geometry: Geometry) -> dict[str, Tensor]:
        """Mean squared errors of photographs and of coarse phase, and their sum, (B,) each."""
        pixels = Pixels.of(batch["mask"])
        found = pixels.of_images(outputs)
        frames = pixels.of_images(noiseless(batch, "high", sido.STEPS, geometry))
        coarse = batch["Phi"][pixels.mask] * (geometry.pitches.high / geometry.pitches.unit)
        parts = {
            "frames": mean_squared(pixels, found[:, : sido.STEPS], frames),
            "phase": mean_squared(pixels, found[:, sido.STEPS], coarse),
        }
        return {**parts, "total": sum(parts.values())}
