"""What a method answers to, its photographs as targets, and true phases (chapters 8 and 9)."""

from typing import Protocol

import torch
from torch import Tensor, nn

from fpputil.decoding.phase import numerator_denominator, wrapped_phase
from fpputil.decoding.unwrap import TWO_PI
from fpputil.networks.geometry import Geometry
from fpputil.networks.unet import dropout_of, widths_of
from fpputil.optics.system import FREQUENCIES, Frame


class Method(Protocol):
    """What training, evaluation and prediction ask of a method: a frozen dataclass of settings.

    Parameters
    ----------
    photographs : tuple of (frequency, steps, step)
        What is photographed, as `SynthFringe` names it.
    reference : str or None
        Frequency of the second wrapped phase, "refined" for the refined reference.
    base, levels, dropout, normalised
        Of its network.
    coordinates : bool
        Whether each encoder sees where in the picture a pixel is, too: ours.
    """

    photographs: tuple[Frame, ...]
    reference: str | None
    base: int
    levels: int
    dropout: float
    normalised: bool
    coordinates: bool

    def __post_init__(self):
        widths_of(self.base, self.levels)  # before any memory is taken for the network
        dropout_of(self.dropout)

    def network(self) -> nn.Module:
        """The network, its weights drawn from torch's generator."""

    def inputs(self, frames: Tensor, geometry: Geometry) -> Tensor:
        """What the network sees of photographs (B, F, H, W): those, if nothing else is said."""
        return placed(frames) if self.coordinates else frames

    def losses(self, outputs: Tensor, batch: dict, geometry: Geometry) -> dict[str, Tensor]:
        """Losses of each image by name, (B,) each; "total" is the one to minimise."""

    def phases(self, outputs: Tensor) -> tuple[Tensor, Tensor | None]:
        """Wrapped phases (B, ...) of its outputs, radians: of the high pitch, of `reference`."""

    def absolute_phase(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, (B, H, W), as the paper of the method decodes it."""

    def phase_in_range(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, (B, H, W), of a method that is told the measuring range.

        Its order is confined to the range, and where the range is shorter than a period of
        another pitch, the minimum phase unwraps the shortest such pitch: alike for all methods.
        """
        return geometry.confined(self.absolute_phase(outputs, geometry))


def placed(frames: Tensor, encoders: int = 1) -> Tensor:
    """Photographs (B, F, H, W), those of each encoder followed by column and row, -1 to 1.

    >>> placed(torch.zeros(1, 2, 3, 4), encoders=2).shape
    torch.Size([1, 6, 3, 4])
    """
    batch, _, height, width = frames.shape
    row, column = (torch.linspace(-1, 1, n, device=frames.device) for n in (height, width))
    where = torch.stack([column.expand(height, width), row[:, None].expand(height, width)])
    where = where.expand(batch, 2, height, width)
    return torch.cat([torch.cat([part, where], 1) for part in frames.chunk(encoders, 1)], 1)


def fringes_of(batch: dict, name: str, steps: int, geometry: Geometry | None = None) -> Tensor:
    """Fringes of all steps of a frequency, (B, steps, H, W), -1 to 1 where lit (paper, Eq. 1).

    With M and D of unit length step n is ``D cos(delta_n) + M sin(delta_n)``.
    """
    delta = TWO_PI * torch.arange(steps, device=batch["M"].device)[:, None, None] / steps
    at = FREQUENCIES.index(name)
    return batch["D"][:, [at]] * delta.cos() + batch["M"][:, [at]] * delta.sin()


def noiseless(batch: dict, name: str, steps: int, geometry: Geometry) -> Tensor:
    """Photographs of all steps of a frequency, scaled as the inputs (paper, Eq. 1). Chapter 9.

    With M and D of unit length and modulation B, step n is
    ``B (1 + D cos(delta_n) + M sin(delta_n))``: (B, steps, H, W) without noise, saturation and
    rounding, which mean nothing outside the mask.
    """
    delta = TWO_PI * torch.arange(steps, device=batch["M"].device)[:, None, None] / steps
    at = FREQUENCIES.index(name)
    M, D, modulation = batch["M"][:, [at]], batch["D"][:, [at]], batch["modulation"][:, None]
    low, high = geometry.extremes
    return (modulation * (1 + D * delta.cos() + M * delta.sin()) - low) / (high - low)


TARGETS = {"grey": noiseless, "fringe": fringes_of}
"""What comes out of a method that predicts photographs, by what its errors count in."""


def check_errors(name: str) -> None:
    """ValueError unless it is a name of `TARGETS`."""
    if name not in TARGETS:
        raise ValueError(f"errors {name!r} given; one of {', '.join(TARGETS)} is needed")


def true_reference(method, item: dict):
    """True second wrapped phase (..., H, W) of a method, or None; of items of `SynthFringe`."""
    if method.reference in (None, "refined"):
        return item["phi_r"] if method.reference else None
    at = FREQUENCIES.index(method.reference)
    return wrapped_phase(item["M"][..., at, :, :], item["D"][..., at, :, :])


def phase_of(frames: Tensor) -> Tensor:
    """Wrapped phase (B, ...) of predicted photographs (B, N, ...), radians (paper, Eq. 2, 3).

    >>> delta = TWO_PI * torch.arange(5) / 5
    >>> phase_of(0.5 + 0.5 * torch.cos(1.25 + delta)[None])
    tensor([1.2500])
    """
    return wrapped_phase(*numerator_denominator(frames.movedim(1, 0)))
