"""PSNet: one photograph of a pitch to the others of its phase shift (chapter 9)."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn

from fpputil.checks import whole
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Pixels, mean_squared
from fpputil.networks.targets import TARGETS, Method, check_errors, phase_of, placed
from fpputil.networks.unet import UNet, taken
from fpputil.optics.system import STEPS, Frame


class PSNet(nn.Module):
    """Two networks side by side, one for each pitch, that share nothing. Section 6.2; chapter 9.

    Of each, a photograph goes in, `extra` channels beside it, and `predicted` photographs come
    out. If these lack one, it is step 0, the photograph itself. Other options as of `SFNet`.

    >>> PSNet(base=2, levels=2)(torch.zeros(1, 2, 12, 16)).shape
    torch.Size([1, 2, 15, 12, 16])
    """

    def __init__(
        self,
        base: int = 8,
        levels: int = 6,
        dropout: float = 0.1,
        normalised: bool = False,
        predicted: int = STEPS - 1,
        extra: int = 0,
    ):
        super().__init__()
        options = (base, levels, dropout, normalised)
        self.nets = nn.ModuleList(UNet(1 + extra, (predicted,), *options) for _ in range(2))
        self.frames = (1 + extra,) * 2
        self.whole = predicted == STEPS

    def forward(self, frames: Tensor) -> Tensor:
        """Of photographs (B, 2, H, W), the high pitch first: all steps, (B, 2, STEPS, H, W)."""
        taken(frames, self.frames)
        steps = []
        for net, shot in zip(self.nets, frames.split(self.frames, 1), strict=True):
            (others,) = net(shot)
            steps.append(others if self.whole else torch.cat([shot[:, :1], others], 1))
        return torch.stack(steps, 1)


@dataclass(frozen=True)
class PSNetMethod(Method):
    """PSNet: a photograph at the high and at the unit pitch, each to all steps of it.

    Its loss counts each photograph, and each difference of two neighbouring steps, the last and
    the first among them. Both weigh the same: ours, as the paper does not say.

    Parameters
    ----------
    errors : str
        "grey": photographs come out, and errors count in grey levels, a pixel with the square of
        its modulation. "fringe", ours: the fringe of `fringes_of` comes out at every step, so
        that all pixels and both networks count alike.
    unit_step : int
        Which step of the unit pitch is photographed, if errors count in the "fringe". The
        objects of the presets stand where step 0 is nearly black.
    base, levels, dropout, normalised
        As of `SFNet`.
    coordinates
        As of `Method`.
    """

    base: int = 8
    levels: int = 6
    dropout: float = 0.1
    normalised: bool = False
    coordinates: bool = False
    errors: str = "grey"
    unit_step: int = 0

    reference: ClassVar[str] = "unit"

    def __post_init__(self):
        super().__post_init__()
        check_errors(self.errors)
        if whole("unit_step", self.unit_step, 0, STEPS - 1) and self.errors == "grey":
            raise ValueError(
                f"unit_step {self.unit_step} with errors in grey levels given; step 0 is needed"
            )

    @property
    def photographs(self) -> tuple[Frame, ...]:
        """Photographs that go in, as `SynthFringe` names them."""
        return (("high", STEPS, 0), ("unit", STEPS, self.unit_step))

    def network(self) -> nn.Module:
        predicted = STEPS - (self.errors == "grey")
        options = (self.levels, self.dropout, self.normalised)
        return PSNet(self.base, *options, predicted, 2 * self.coordinates)

    def inputs(self, frames: Tensor, geometry: Geometry) -> Tensor:
        return placed(frames, encoders=2) if self.coordinates else frames

    def phases(self, outputs: Tensor) -> tuple[Tensor, Tensor]:
        """phi of the high and of the unit pitch, radians, of outputs (B, 2, steps, ...)."""
        return phase_of(outputs[:, 0]), phase_of(outputs[:, 1])

    def absolute_phase(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, by two-frequency unwrapping (paper, Eq. 4-7)."""
        high, unit = self.phases(outputs)
        return geometry.from_frequencies({"high": high, "unit": unit})

    def phase_in_range(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        high, unit = self.phases(outputs)
        Phi = geometry.absolute_phase(high, unit, geometry.Phi_min["unit"], "unit")
        return geometry.confined(Phi)

    def losses(self, outputs: Tensor, batch: dict, geometry: Geometry) -> dict[str, Tensor]:
        """Mean squared errors of steps, and of neighbours' differences, (B,) each."""
        pixels = Pixels.of(batch["mask"])
        target = TARGETS[self.errors]
        true = [target(batch, name, STEPS, geometry) for name in ("high", "unit")]
        true, predicted = (pixels.of_images(a) for a in (torch.stack(true, 1), outputs))
        e = predicted - true
        if self.errors == "grey":
            e = e[..., 1:]  # step 0 is as it was photographed, with its noise
            around = torch.cat([e[..., :1], e.diff(dim=-1), e[..., -1:]], -1)
        else:
            around = e - e.roll(1, dims=-1)
        parts = {
            "frames": mean_squared(pixels, e, torch.zeros_like(e)),
            "steps": mean_squared(pixels, around, torch.zeros_like(around)),
        }
        return {**parts, "total": sum(parts.values())}
