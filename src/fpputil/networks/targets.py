"""Photographs as targets, phases of predicted ones, and true phases (chapter 9)."""

from __future__ import annotations

import torch
from torch import Tensor

from fpputil.decoding.phase import numerator_denominator, wrapped_phase
from fpputil.decoding.unwrap import TWO_PI
from fpputil.networks.geometry import Geometry
from fpputil.optics.system import FREQUENCIES


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
