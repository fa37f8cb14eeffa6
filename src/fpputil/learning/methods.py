"""Methods: which photographs go in, what should come out, how it becomes absolute phase (ch. 8)."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

import torch
from torch import Tensor, nn

from fpputil.decoding.phase import wrapped_phase
from fpputil.decoding.reference import minimum_phase, two_phase_absolute, zmin_order
from fpputil.decoding.unwrap import absolute
from fpputil.learning.layout import FREQUENCIES, STEPS
from fpputil.learning.losses import Pixels, Weights
from fpputil.learning.networks.sfnet import SFNet
from fpputil.learning.synthfringe import Frame
from fpputil.optics.system import System

HIGH = FREQUENCIES.index("high")
SHIFTS = {1: ((STEPS, 0),), 2: ((4, 0), (4, 1)), 3: ((3, 0), (3, 1), (3, 2))}
"""(steps, step) of the photographs at a pitch: one, two a quarter period apart, three a third."""


@dataclass(frozen=True, eq=False)
class Rig:
    """What the geometry contributes to an absolute phase: pitches and minimum phases.

    Parameters
    ----------
    system : System
        Camera, projector and measuring range.
    pitches : dict
        Of "high", "mid", "zmin", "unit", projector pixels.
    Phi_min, Phi_min_high : (H, W) float32 tensors
        Minimum phase of the low pitch, centred, and of the high pitch, where it is ambiguous.
    """

    system: System
    pitches: dict[str, float]
    Phi_min: Tensor
    Phi_min_high: Tensor

    @classmethod
    def of(cls, system: System, pitches: dict[str, float]) -> Rig:
        """Rig of a system and its pitches."""
        low = minimum_phase(system, pitches["zmin"])
        high = minimum_phase(system, pitches["high"], ambiguous=True)
        return cls(
            system, dict(pitches), *(torch.as_tensor(a, dtype=torch.float32) for a in (low, high))
        )

    def to(self, device) -> Rig:
        """The same rig with its tensors on a device."""
        return Rig(self.system, self.pitches, self.Phi_min.to(device), self.Phi_min_high.to(device))

    def absolute(self, phi_h, phi_r, Phi_min):
        """Phi of the high pitch from two wrapped phases (Eq. 9, 4, 6). Chapter 5."""
        return two_phase_absolute(phi_h, phi_r, Phi_min, self.pitches["high"], self.pitches["zmin"])

    def one_photograph(self, phi_h):
        """Phi of the high pitch from its wrapped phase alone: the control of every table."""
        return absolute(phi_h, zmin_order(phi_h, self.Phi_min_high))


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
    weights : Weights
        Of the losses.
    """

    frames: int = 1
    base: int = 8
    levels: int = 6
    dropout: float = 0.1
    mixing: str = "deepest"
    target: str = "components"
    weights: Weights = field(default_factory=Weights)

    def __post_init__(self):
        if self.frames not in SHIFTS:
            raise ValueError(f"{self.frames} frames of each pitch given; 1, 2 or 3 are needed")
        if self.target not in ("components", "phase"):
            raise ValueError(f"target {self.target!r} given; components or phase is needed")
        with torch.device("meta"):
            self.network()  # its options are checked there

    @property
    def photographs(self) -> tuple[Frame, ...]:
        """Photographs that go in, as `SynthFringe` names them."""
        return tuple((name, *shot) for name in ("high", "zmin") for shot in SHIFTS[self.frames])

    def network(self) -> nn.Module:
        """The network, its weights drawn from torch's generator."""
        outputs = 2 if self.target == "components" else 1
        pair = (self.frames, self.frames)
        return SFNet(pair, self.base, self.levels, self.dropout, self.mixing, outputs)

    def phases(self, outputs: Tensor) -> tuple[Tensor, Tensor]:
        """phi_h and phi_r, radians, of outputs (B, 2, 2 or 1, ...), each (B, ...) (Eq. 3)."""
        if self.target == "phase":
            return outputs[:, 0, 0], outputs[:, 1, 0]
        return tuple(wrapped_phase(outputs[:, k, 0], outputs[:, k, 1]) for k in (0, 1))

    def absolute(self, outputs: Tensor, rig: Rig) -> Tensor:
        """Phi of the high pitch, radians, (B, H, W)."""
        return rig.absolute(*self.phases(outputs), rig.Phi_min)

    def losses(self, outputs: Tensor, batch: dict, rig: Rig) -> dict[str, Tensor]:
        """Losses of each image by name, (B,) each; "total" is the one to minimise (Eq. 12-15)."""
        pixels = Pixels.of(batch["mask"])
        seen = pixels.mask
        inside = outputs.movedim(0, 2)[..., seen].movedim(-1, 0)  # (P, 2, outputs)
        phi_h, phi_r = self.phases(inside)
        Phi_min = rig.Phi_min.expand(seen.shape)[seen]
        Phi = batch["Phi"][seen]
        if self.target == "components":
            named = (batch["M"][:, HIGH], batch["D"][:, HIGH], batch["M_r"], batch["D_r"])
            targets = [image[seen] for image in named]
        else:
            high = wrapped_phase(batch["M"][:, HIGH][seen], batch["D"][:, HIGH][seen])
            targets = [high, batch["phi_r"][seen]]
        components = inside.flatten(1).unbind(1)
        absolute_phase = rig.absolute(phi_h, phi_r, Phi_min)
        return self.weights.losses(pixels, components, targets, phi_h, absolute_phase, Phi)

    def settings(self) -> dict:
        """The method as plain numbers and names, as JSON holds it."""
        return {"method": "sfnet", **asdict(self)}
