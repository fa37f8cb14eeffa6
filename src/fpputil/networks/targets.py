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
    base, levels, dropout
        Of its network.
    """

    photographs: tuple[Frame, ...]
    reference: str | None
    base: int
    levels: int
    dropout: float

    def __post_init__(self):
        widths_of(self.base, self.levels)  # before any memory is taken for the network
        dropout_of(self.dropout)

    def network(self) -> nn.Module:
        """The network, its weights drawn from torch's generator."""

    def inputs(self, frames: Tensor, geometry: Geometry) -> Tensor:
        """What the network sees of photographs (B, F, H, W): those, if nothing else is said."""
        return frames

    def losses(self, outputs: Tensor, batch: dict, geometry: Geometry) -> dict[str, Tensor]:
        """Losses of each image by name, (B,) each; "total" is the one to minimise."""

    def phases(self, outputs: Tensor) -> tuple[Tensor, Tensor | None]:
        """Wrapped phases (B, ...) of its outputs, radians: of the high pitch, of `reference`."""

    def absolute_phase(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, (B, H, W)."""


def noiseless(batch: dict, name: str, steps: int, geometry: Geometry) -> Tensor:
    """Photographs of all steps of a frequency, on the scale of the inputs (Eq. 1). Chapter 9.

    With M and D of unit length and modulation B, step n is
    ``B (1 + D cos(delta_n) + M sin(delta_n))``: (B, steps, H, W) without noise, saturation and
    rounding, which mean nothing outside the mask.
    """
    delta = TWO_PI * torch.arange(steps, device=batch["M"].device)[:, None, None] / steps
    at = FREQUENCIES.index(name)
    M, D, modulation = batch["M"][:, [at]], batch["D"][:, [at]], batch["modulation"][:, None]
    low, high = geometry.extremes
    return (modulation * (1 + D * delta.cos() + M * delta.sin()) - low) / (high - low)


def true_reference(method, item: dict):
    """True second wrapped phase (..., H, W) of a method, or None; of items of `SynthFringe`."""
    if method.reference in (None, "refined"):
        return item["phi_r"] if method.reference else None
    at = FREQUENCIES.index(method.reference)
    return wrapped_phase(item["M"][..., at, :, :], item["D"][..., at, :, :])


def phase_of(frames: Tensor) -> Tensor:
    """Wrapped phase (B, ...) of predicted photographs (B, N, ...), radians (Eq. 2, 3).

    >>> delta = TWO_PI * torch.arange(5) / 5
    >>> phase_of(0.5 + 0.5 * torch.cos(1.25 + delta)[None])
    tensor([1.2500])
    """
    return wrapped_phase(*numerator_denominator(frames.movedim(1, 0)))
