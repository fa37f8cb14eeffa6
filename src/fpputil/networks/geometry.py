"""What the geometry contributes to the absolute phase of a network's photographs (chapter 8)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from fpputil.decoding.geometric_constraint import minimum_phase, two_phase_absolute, zmin_order
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
    """

    system: System
    pitches: Pitches
    Phi_min: dict[str, Tensor]
    Phi_plane: Tensor
    extremes: tuple[float, float]

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
        geometry = cls(system, pitches, lowest, torch.as_tensor(plane), tuple(extremes))
        return geometry.to(torch.float32)

    def to(self, device) -> Geometry:
        """The same geometry with its tensors on a device, or of a dtype."""
        lowest = {k: v.to(device) for k, v in self.Phi_min.items()}
        return replace(self, Phi_min=lowest, Phi_plane=self.Phi_plane.to(device))

    def absolute_phase(self, phi_h, phi, Phi_min, name: str = "zmin"):
        """Phi of the high pitch from its wrapped phase and that of a lower one, by name (Eq. 9, 6).

        The minimum phase of the lower is given, as the phases need not be whole pictures.
        """
        low = getattr(self.pitches, name)
        return two_phase_absolute(phi_h, phi, Phi_min, self.pitches.high, low)

    def from_one_phase(self, phi_h):
        """Phi of the high pitch from its wrapped phase alone: the control of every table."""
        return absolute_phase(phi_h, zmin_order(phi_h, self.Phi_min["high"]))

    def from_frequencies(self, phis: dict[str, Tensor]):
        """Phi of the high pitch by multi-frequency unwrapping of phases by name (Eq. 4-7)."""
        names = sorted(phis, key=lambda k: -getattr(self.pitches, k))
        pitches = [getattr(self.pitches, k) for k in names]
        return mf_tpu([phis[k] for k in names], pitches, self.system.projector.width)[-1]
