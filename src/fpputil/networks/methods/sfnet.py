"""SFNet: two photographs to the wrapped phases of two pitches (chapter 8)."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from fpputil.decoding.phase import wrapped_phase
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Pixels, Weights
from fpputil.networks.sfnet import SFNet
from fpputil.networks.targets import true_reference
from fpputil.optics.system import FREQUENCIES, STEPS, Frame

HIGH = FREQUENCIES.index("high")
SHIFTS = {1: ((STEPS, 0),), 2: ((4, 0), (4, 1)), 3: ((3, 0), (3, 1), (3, 2))}
"""(steps, step) of the photographs at a pitch: one, two a quarter period apart, three a third."""

SECOND = {"refined": "zmin", "zmin": "zmin", "mid": "mid", "unit": "unit"}
"""Pitch of the second photograph, by what the second decoder is to make of it."""


@dataclass(frozen=True)
class SFNetMethod:
    """SFNet: photographs of two pitches to M and D of the high pitch and the refined reference.

    Parameters
    ----------
    frames : int
        Photographs of each pitch: 1, 2 or 3 (Table 5).
    base, levels, dropout, mixing
        Of `SFNet`.
    target : str
        "components" M and D, as in the paper, or the "phase" itself.
    reference : str
        What the second decoder learns: the "refined" reference, as in the paper, or in its place
        the phase of the "zmin", "mid" or "unit" pitch, which then is photographed, too.
    weights : Weights
        Of the losses.
    """

    frames: int = 1
    base: int = 8
    levels: int = 6
    dropout: float = 0.1
    mixing: str = "deepest"
    target: str = "components"
    reference: str = "refined"
    weights: Weights = field(default_factory=Weights)

    def __post_init__(self):
        if self.frames not in SHIFTS:
            raise ValueError(f"{self.frames} frames of each pitch given; 1, 2 or 3 are needed")
        if self.target not in ("components", "phase"):
            raise ValueError(f"target {self.target!r} given; components or phase is needed")
        if self.reference not in SECOND:
            raise ValueError(
                f"reference {self.reference!r} given; one of {', '.join(SECOND)} is needed"
            )
        if not isinstance(self.weights, Weights):
            raise ValueError(f"weights {self.weights!r} given; SFNet needs those of its losses")
        with torch.device("meta"):
            self.network()  # its options are checked there

    @property
    def photographs(self) -> tuple[Frame, ...]:
        """Photographs that go in, as `SynthFringe` names them."""
        pitches = ("high", SECOND[self.reference])
        return tuple((name, *shot) for name in pitches for shot in SHIFTS[self.frames])

    def network(self) -> nn.Module:
        """The network, its weights drawn from torch's generator."""
        outputs = 2 if self.target == "components" else 1
        pair = (self.frames, self.frames)
        return SFNet(pair, self.base, self.levels, self.dropout, self.mixing, outputs)

    def inputs(self, frames: Tensor, geometry: Geometry) -> Tensor:
        """What the network sees of photographs (B, F, H, W): those."""
        return frames

    def phases(self, outputs: Tensor) -> tuple[Tensor, Tensor]:
        """phi_h and phi_r, radians, of outputs (B, 2, 2 or 1, ...), each (B, ...) (Eq. 3)."""
        if self.target == "phase":
            return outputs[:, 0, 0], outputs[:, 1, 0]
        return tuple(wrapped_phase(outputs[:, k, 0], outputs[:, k, 1]) for k in (0, 1))

    def absolute_phase(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, (B, H, W)."""
        return self._absolute_phase(*self.phases(outputs), geometry)

    def _absolute_phase(self, phi_h, phi, geometry: Geometry, seen=None) -> Tensor:
        """Phi of wrapped phases (B, H, W), or (P,) of the pixels `seen` of such images."""
        if self.reference == "unit":
            return geometry.from_frequencies({"high": phi_h, "unit": phi})
        name = SECOND[self.reference]
        Phi_min = geometry.Phi_min[name]
        if seen is not None:
            Phi_min = Phi_min.expand(seen.shape)[seen]
        return geometry.absolute_phase(phi_h, phi, Phi_min, name)

    def losses(self, outputs: Tensor, batch: dict, geometry: Geometry) -> dict[str, Tensor]:
        """Losses of each image by name, (B,) each; "total" is the one to minimise (Eq. 12-15)."""
        pixels = Pixels.of(batch["mask"])
        inside = pixels.of_images(outputs)  # (P, 2, 2 or 1)
        phi_h, phi = self.phases(inside)
        components, targets = inside.flatten(1).unbind(1), self._targets(batch, pixels.mask)
        Phi = self._absolute_phase(phi_h, phi, geometry, pixels.mask)
        return self.weights.losses(
            pixels, components, targets, phi_h, Phi, batch["Phi"][pixels.mask]
        )

    def _targets(self, batch: dict, seen: Tensor) -> list[Tensor]:
        """What the outputs should be at the pixels seen, (P,) each."""
        M, D = batch["M"][:, HIGH], batch["D"][:, HIGH]
        if self.target == "phase":
            return [wrapped_phase(M[seen], D[seen]), true_reference(self, batch)[seen]]
        if self.reference == "refined":
            pair = batch["M_r"], batch["D_r"]
        else:
            at = FREQUENCIES.index(self.reference)
            pair = batch["M"][:, at], batch["D"][:, at]
        return [image[seen] for image in (M, D, *pair)]
