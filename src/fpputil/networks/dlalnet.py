"""DLALNet: photographs of three pitches to numerator and denominator of each (chapter 9)."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn

from fpputil.decoding.phase import wrapped_phase
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Pixels, Weights, mean_squared
from fpputil.networks.targets import Method
from fpputil.networks.unet import UNet
from fpputil.optics.system import FREQUENCIES, STEPS, Frame

NAMES = ("high", "mid", "unit")


class DLALNet(nn.Module):
    """One encoder, one decoder, three pitches at once. Section 6.2 of the paper; chapter 9.

    `extra` channels go in beside the photographs. Other options as of `SFNet`.

    >>> DLALNet(base=2, levels=2)(torch.zeros(1, 3, 12, 16)).shape
    torch.Size([1, 3, 2, 12, 16])
    """

    def __init__(
        self,
        base: int = 8,
        levels: int = 6,
        dropout: float = 0.1,
        normalised: bool = False,
        extra: int = 0,
    ):
        super().__init__()
        self.net = UNet(3 + extra, (6,), base, levels, dropout, normalised)
        self.frames = self.net.frames

    def forward(self, frames: Tensor) -> Tensor:
        """Of photographs (B, 3, H, W) of three pitches: M, then D of each, (B, 3, 2, H, W)."""
        return self.net(frames)[0].unflatten(1, (3, 2))


@dataclass(frozen=True)
class DLALNetMethod(Method):
    """DLALNet: step 0 at the high, mid and unit pitch, each to its M and D.

    Without `weights` its loss is the plain squared error, as in the paper; with them it is SFNet's.
    Options of the network as of `SFNet`, coordinates as of `Method`.
    """

    base: int = 12
    levels: int = 6
    dropout: float = 0.1
    weights: Weights | None = None
    normalised: bool = False
    coordinates: bool = False

    photographs: ClassVar[tuple[Frame, ...]] = tuple((name, STEPS, 0) for name in NAMES)
    reference: ClassVar[str] = "unit"

    def network(self) -> nn.Module:
        extra = 2 * self.coordinates
        return DLALNet(self.base, self.levels, self.dropout, self.normalised, extra)

    def phases(self, outputs: Tensor) -> tuple[Tensor, Tensor]:
        """phi of high and unit pitch, radians, of outputs (B, 3, 2, ...) (paper, Eq. 3)."""
        phis = _wrapped(outputs)
        return phis["high"], phis["unit"]

    def absolute_phase(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, by three-frequency unwrapping (paper, Eq. 4-7)."""
        return geometry.from_frequencies(_wrapped(outputs))

    def phase_in_range(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        phis = _wrapped(outputs)
        by_mid = geometry.absolute_phase(phis["high"], phis["mid"], geometry.Phi_min["mid"], "mid")
        Phi = torch.where(geometry.named_by_range("mid"), by_mid, geometry.from_frequencies(phis))
        return geometry.confined(Phi)

    def losses(self, outputs: Tensor, batch: dict, geometry: Geometry) -> dict[str, Tensor]:
        """Mean squared error of M and D, or the losses of SFNet, (B,) each."""
        pixels = Pixels.of(batch["mask"])
        predicted = pixels.of_images(outputs)
        which = [FREQUENCIES.index(name) for name in NAMES]
        true = pixels.of_images(torch.stack([batch["M"][:, which], batch["D"][:, which]], 2))
        if self.weights is None:
            return {"total": mean_squared(pixels, predicted, true)}
        phi_h, _ = self.phases(predicted)
        components, targets = (a.flatten(1).unbind(1) for a in (predicted, true))
        Phi, true_Phi = self.absolute_phase(predicted, geometry), batch["Phi"][pixels.mask]
        return self.weights.losses(pixels, components, targets, phi_h, Phi, true_Phi)


def _wrapped(outputs: Tensor) -> dict[str, Tensor]:
    pairs = zip(NAMES, outputs.unbind(1), strict=True)
    return {name: wrapped_phase(*pair.unbind(1)) for name, pair in pairs}
