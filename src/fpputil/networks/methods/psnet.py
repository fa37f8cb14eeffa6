"""PSNet: one photograph of a pitch to the others of its phase shift (chapter 9)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn

from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Pixels, mean_squared
from fpputil.networks.psnet import PSNet
from fpputil.networks.targets import noiseless, phase_of
from fpputil.optics.system import STEPS, Frame


@dataclass(frozen=True)
class PSNetMethod:
    """PSNet: step 0 at the high and at the unit pitch, each to all steps of it.

    Its loss counts each photograph, and each difference of two neighbouring steps, the last and
    the first among them. Both weigh the same: ours, as the paper does not say.

    Parameters
    ----------
    base, levels, dropout
        As of `SFNet`.
    """

    base: int = 8
    levels: int = 6
    dropout: float = 0.1

    photographs: ClassVar[tuple[Frame, ...]] = (("high", STEPS, 0), ("unit", STEPS, 0))
    reference: ClassVar[str] = "unit"

    def __post_init__(self):
        with torch.device("meta"):
            self.network()  # its options are checked there

    def network(self) -> nn.Module:
        """Both networks, their weights drawn from torch's generator."""
        return PSNet(STEPS, self.base, self.levels, self.dropout)

    def inputs(self, frames: Tensor, geometry: Geometry) -> Tensor:
        """What the networks see of photographs (B, 2, H, W): those."""
        return frames

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
        true, found = (pixels.of_images(a) for a in (torch.stack(true, 1), outputs))
        e = found[..., 1:] - true[..., 1:]  # step 0 is as it was photographed, with its noise
        around = torch.cat([e[..., :1], e.diff(dim=-1), e[..., -1:]], -1)
        parts = {
            "frames": mean_squared(pixels, e, torch.zeros_like(e)),
            "steps": mean_squared(pixels, around, torch.zeros_like(around)),
        }
        return {**parts, "total": sum(parts.values())}
