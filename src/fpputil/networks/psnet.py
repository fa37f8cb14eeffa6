"""PSNet: one photograph of a pitch to the others of its phase shift (chapter 9)."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn

from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Pixels, mean_squared
from fpputil.networks.targets import Method, noiseless, phase_of
from fpputil.networks.unet import UNet, taken
from fpputil.optics.system import STEPS, Frame


class PSNet(nn.Module):
    """Two networks side by side, one for each pitch, that share nothing. Section 6.2; chapter 9.

    Of each, one photograph goes in and the others of its phase shift come out. Options as of
    `SFNet`.

    >>> PSNet(base=2, levels=2)(torch.zeros(1, 2, 12, 16)).shape
    torch.Size([1, 2, 15, 12, 16])
    """

    def __init__(self, base: int = 8, levels: int = 6, dropout: float = 0.1):
        super().__init__()
        self.nets = nn.ModuleList(UNet(1, (STEPS - 1,), base, levels, dropout) for _ in range(2))
        self.frames = (1, 1)

    def forward(self, frames: Tensor) -> Tensor:
        """Of photographs (B, 2, H, W), step 0 of each pitch: (B, 2, steps, H, W), 0 as it is."""
        taken(frames, self.frames)
        pairs = zip(self.nets, frames.split(1, 1), strict=True)
        return torch.stack([torch.cat([shot, *net(shot)], 1) for net, shot in pairs], 1)


@dataclass(frozen=True)
class PSNetMethod(Method):
    """PSNet: step 0 at the high and at the unit pitch, each to all steps of it.

    Its loss counts each photograph, and each difference of two neighbouring steps, the last and
    the first among them. Both weigh the same: ours, as the paper does not say.
    Options as of `SFNet`.
    """

    base: int = 8
    levels: int = 6
    dropout: float = 0.1

    photographs: ClassVar[tuple[Frame, ...]] = (("high", STEPS, 0), ("unit", STEPS, 0))
    reference: ClassVar[str] = "unit"

    def network(self) -> nn.Module:
        return PSNet(self.base, self.levels, self.dropout)

    def phases(self, outputs: Tensor) -> tuple[Tensor, Tensor]:
        """phi of the high and of the unit pitch, radians, of outputs (B, 2, steps, ...)."""
        return phase_of(outputs[:, 0]), phase_of(outputs[:, 1])

    def absolute_phase(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, by two-frequency unwrapping (Eq. 4-7)."""
        high, unit = self.phases(outputs)
        return geometry.from_frequencies({"high": high, "unit": unit})

    def losses(self, outputs: Tensor, batch: dict, geometry: Geometry) -> dict[str, Tensor]:
        """Mean squared errors of steps 1 and on, and of neighbours' differences, (B,) each."""
        pixels = Pixels.of(batch["mask"])
        true = [noiseless(batch, name, STEPS, geometry) for name in ("high", "unit")]
        true, predicted = (pixels.of_images(a) for a in (torch.stack(true, 1), outputs))
        e = predicted[..., 1:] - true[..., 1:]  # step 0 is as it was photographed, with its noise
        around = torch.cat([e[..., :1], e.diff(dim=-1), e[..., -1:]], -1)
        parts = {
            "frames": mean_squared(pixels, e, torch.zeros_like(e)),
            "steps": mean_squared(pixels, around, torch.zeros_like(around)),
        }
        return {**parts, "total": sum(parts.values())}
