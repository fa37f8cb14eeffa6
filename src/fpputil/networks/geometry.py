"""What the geometry contributes to the absolute phase of a network's photographs (chapter 8)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from fpputil.decoding.geometric_constraint import (
    minimum_phase,
    phase_range,
    two_phase_absolute,
    zmin_order,
)
from fpputil.decoding.unwrap import TWO_PI, absolute_phase, mf_tpu
from fpputil.optics.system import Pitches, System


@dataclass(frozen=True, eq=False)
class Geometry:
    """Pitches, minimum phases and reference plane of a system.

    Parameters
    ----------
    system : System
        Camera, projector and measuring range.
    pitches : Pitches
    Phi_min : dict of (H, W) float32 tensors
        Minimum phase of each of these pitches, centred. At "high" and "mid" it is ambiguous.
    Phi_plane : (H, W) float32 tensor
        Absolute phase of the high pitch on the plane z_max, radians; NaN where it is not lit.
    extremes : (low, high)
        Grey levels that are 0 and 1 to a network.
    Phi_range : (2, H, W) float32 tensor
        Least and greatest absolute phase of the high pitch within the measuring range, radians.
    """

    system: System
    pitches: Pitches
    Phi_min: dict[str, Tensor]
    Phi_plane: Tensor
    extremes: tuple[float, float]
    Phi_range: Tensor

    @classmethod
    def of(cls, system: System, pitches: Pitches, extremes=(0.0, 255.0)) -> Geometry:
        """Geometry of a system and its pitches.

        >>> from fpputil.optics import preset
        >>> tiny = preset("tiny")
        >>> Geometry.of(tiny.system, tiny.pitches).Phi_min["zmin"].shape
        torch.Size([120, 160])
        """
        lowest = {
            name: torch.as_tensor(minimum_phase(system, pitch, ambiguous=name in ("high", "mid")))
            for name, pitch in pitches._asdict().items()
        }
        z = system.z_max
        plane = TWO_PI * np.where(system.lit_at(z), system.columns_at(z), np.nan) / pitches.high
        ends = torch.as_tensor(np.stack(phase_range(system, pitches.high)))
        geometry = cls(system, pitches, lowest, torch.as_tensor(plane), tuple(extremes), ends)
        return geometry.to(torch.float32)

    def to(self, device) -> Geometry:
        """The same geometry with its tensors on a device, or of a dtype."""
        lowest = {k: v.to(device) for k, v in self.Phi_min.items()}
        moved = {name: getattr(self, name).to(device) for name in ("Phi_plane", "Phi_range")}
        return replace(self, Phi_min=lowest, **moved)

    def absolute_phase(self, phi_h, phi, Phi_min, name: str = "zmin"):
        """Phi of the high pitch from its phase and a lower one's, by name (paper, Eq. 9, 6).

        The minimum phase of the lower is given, as the phases need not be whole pictures.
        """
        low = getattr(self.pitches, name)
        return two_phase_absolute(phi_h, phi, Phi_min, self.pitches.high, low)

    def confined(self, Phi):
        """Phi of the high pitch (B, H, W), its order the nearest that the measuring range allows.

        A phase may lie half a period beyond either end, so that noise there costs no order.

        >>> from fpputil.optics import preset
        >>> geometry = Geometry.of(preset("tiny").system, preset("tiny").pitches)
        >>> Phi = geometry.Phi_range.mean(0)  # of a body in the middle of the range
        >>> bool((geometry.confined(Phi + 10 * TWO_PI) - Phi < 4 * TWO_PI)[60, 80])
        True
        """
        below, above = (((end - Phi) / TWO_PI).round().nan_to_num() for end in self.Phi_range)
        return Phi + TWO_PI * torch.zeros_like(Phi).clamp(below, above)

    def named_by_range(self, name: str):
        """(H, W) bool: pixels at which the measuring range is shorter than a period of a pitch."""
        low, high = self.Phi_range
        return (high - low) * (self.pitches.high / getattr(self.pitches, name)) < TWO_PI

    def from_one_phase(self, phi_h):
        """Phi of the high pitch from its wrapped phase alone: the control of every table."""
        return absolute_phase(phi_h, zmin_order(phi_h, self.Phi_min["high"]))

    def from_frequencies(self, phis: dict[str, Tensor]):
        """Phi of the high pitch by multi-frequency unwrapping, by name (paper, Eq. 4-7)."""
        names = sorted(phis, key=lambda k: -getattr(self.pitches, k))
        pitches = [getattr(self.pitches, k) for k in names]
        return mf_tpu([phis[k] for k in names], pitches, self.system.projector.width)[-1]
