"""SFNet, the symmetric fusion network: two photographs to two wrapped phases (chapter 8)."""

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from fpputil.checks import whole
from fpputil.decoding.phase import wrapped_phase
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Pixels, Weights
from fpputil.networks.targets import Method, placed, true_reference
from fpputil.networks.unet import (
    Decoder,
    Encoder,
    dropout_of,
    initialise,
    padded,
    taken,
    widths_of,
)
from fpputil.optics.system import FREQUENCIES, STEPS, Frame

MIXING = ("none", "deepest", "every level")
HIGH = FREQUENCIES.index("high")
SHIFTS = {1: ((STEPS, 0),), 2: ((4, 0), (4, 1)), 3: ((3, 0), (3, 1), (3, 2))}
"""(steps, step) of the photographs at a pitch: one, two a quarter period apart, three a third."""

SECOND = {"refined": "zmin", "zmin": "zmin", "mid": "mid", "unit": "unit"}
"""Pitch of the second photograph, by what the second decoder is to make of it."""


class SFNet(nn.Module):
    """Two encoders, their features joined, two decoders. Section 4.1, Fig. 2; chapter 8.

    Parameters
    ----------
    frames : (int, int)
        Photographs of the high and of the low pitch: (1, 1), (2, 2) or (3, 3) in Table 5.
    base : int
        Channels of the finest level; each level below has twice as many. Not in the paper.
    levels : int
        Pairs of convolutions in each encoder; the paper's 12 convolutions are 6 levels.
    dropout : float
        Share of the joined deepest features dropped in training. Not in the paper.
    mixing : str
        Whose features a decoder sees: of its own encoder ("none", row A of Table 4), of both at
        the "deepest" level (as the paper's text has it), or of both at "every level".
    outputs : int
        Channels each decoder ends in: 2 for M and D, 1 for a phase predicted directly.
    normalised : bool
        Whether group normalisation follows each convolution: ours.

    Examples
    --------
    >>> network = SFNet(base=2, levels=2)
    >>> network(torch.zeros(1, 2, 12, 16)).shape
    torch.Size([1, 2, 2, 12, 16])
    """

    def __init__(
        self,
        frames: tuple[int, int] = (1, 1),
        base: int = 8,
        levels: int = 6,
        dropout: float = 0.1,
        mixing: str = "deepest",
        outputs: int = 2,
        normalised: bool = False,
    ):
        super().__init__()
        self.frames = tuple(whole("frames", n, 1) for n in frames)
        if len(self.frames) != 2:
            raise ValueError(f"frames {frames} given; one number for each of the two pitches")
        self.mixing, outputs = _mixing(mixing), whole("outputs", outputs, 1)
        widths = widths_of(base, levels)
        bottom = widths[-1] * (1 if mixing == "none" else 2)
        skips = [w * (2 if mixing == "every level" else 1) for w in widths[:-1]]
        self.encoders = nn.ModuleList(Encoder(n, widths, normalised) for n in self.frames)
        self.dropout = dropout_of(dropout)
        options = (bottom, widths, skips, outputs, normalised)
        self.decoders = nn.ModuleList(Decoder(*options) for _ in range(2))
        initialise(self)

    def forward(self, frames: Tensor) -> Tensor:
        """Of photographs (B, F, H, W), 0 to 1, those of the high pitch first, any size: M and D.

        They are (B, 2, outputs, H, W) in float32: high pitch, then refined reference.
        """
        taken(frames, self.frames)
        height, width = frames.shape[-2:]
        room = padded(frames, 2 ** (len(self.encoders[0].levels) - 1))
        parts = room.split(self.frames, 1)
        pyramids = [encoder(part) for encoder, part in zip(self.encoders, parts, strict=True)]
        levels = len(pyramids[0])
        alone = {"none": levels, "deepest": levels - 1, "every level": 0}[self.mixing]
        joined = [torch.cat(pair, 1) for pair in zip(*(p[alone:] for p in pyramids), strict=True)]
        outputs = []
        for decoder, pyramid in zip(self.decoders, pyramids, strict=True):
            *skips, deepest = pyramid[:alone] + joined
            outputs.append(decoder(self.dropout(deepest), skips))
        return torch.stack(outputs, 1)[..., :height, :width]


def _mixing(name: str) -> str:
    if name not in MIXING:
        raise ValueError(f"mixing {name!r} given; one of {', '.join(MIXING)} is needed")
    return name


@dataclass(frozen=True)
class SFNetMethod(Method):
    """SFNet: photographs of two pitches to M and D of the high pitch and the refined reference.

    Parameters
    ----------
    frames : int
        Photographs of each pitch: 1, 2 or 3 (Table 5).
    base, levels, dropout, mixing, normalised
        Of `SFNet`.
    coordinates : bool
        As of `Method`.
    target : str
        "components" M and D, as in the paper, or the "phase" itself.
    reference : str
        What the second decoder learns: the "refined" reference, as in the paper, or in its place
        the phase of the "zmin", "mid" or "unit" pitch, which then is photographed, too.
    weights : Weights
        Of the losses.

    Examples
    --------
    >>> SFNetMethod().photographs
    (('high', 15, 0), ('zmin', 15, 0))
    >>> SFNetMethod(frames=2, reference="unit").photographs
    (('high', 4, 0), ('high', 4, 1), ('unit', 4, 0), ('unit', 4, 1))
    """

    frames: int = 1
    base: int = 8
    levels: int = 6
    dropout: float = 0.1
    mixing: str = "deepest"
    target: str = "components"
    reference: str = "refined"
    weights: Weights = field(default_factory=Weights)
    normalised: bool = False
    coordinates: bool = False

    def __post_init__(self):
        if self.frames not in SHIFTS:
            raise ValueError(f"{self.frames} frames of each pitch given; 1, 2 or 3 are needed")
        if self.target not in ("components", "phase"):
            raise ValueError(f"target {self.target!r} given; components or phase is needed")
        if self.reference not in SECOND:
            raise ValueError(
                f"reference {self.reference!r} given; one of {', '.join(SECOND)} is needed"
            )
        _mixing(self.mixing)
        if not isinstance(self.weights, Weights):
            raise ValueError(f"weights {self.weights!r} given; SFNet needs those of its losses")
        super().__post_init__()

    @property
    def photographs(self) -> tuple[Frame, ...]:
        """Photographs that go in, as `SynthFringe` names them."""
        pitches = ("high", SECOND[self.reference])
        return tuple((name, *shot) for name in pitches for shot in SHIFTS[self.frames])

    def network(self) -> nn.Module:
        outputs = 2 if self.target == "components" else 1
        pair = (self.frames + 2 * self.coordinates,) * 2
        options = (self.levels, self.dropout, self.mixing, outputs, self.normalised)
        return SFNet(pair, self.base, *options)

    def inputs(self, frames: Tensor, geometry: Geometry) -> Tensor:
        return placed(frames, encoders=2) if self.coordinates else frames

    def phases(self, outputs: Tensor) -> tuple[Tensor, Tensor]:
        """phi_h, phi_r, radians, (B, ...) each, of outputs (B, 2, 2 or 1, ...) (paper, Eq. 3)."""
        if self.target == "phase":
            return outputs[:, 0, 0], outputs[:, 1, 0]
        return tuple(wrapped_phase(outputs[:, k, 0], outputs[:, k, 1]) for k in (0, 1))

    def absolute_phase(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, (B, H, W)."""
        return self._absolute_phase(*self.phases(outputs), geometry)

    def phase_in_range(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        phi_h, phi = self.phases(outputs)
        name = SECOND[self.reference]
        Phi = geometry.absolute_phase(phi_h, phi, geometry.Phi_min[name], name)
        return geometry.confined(Phi)

    def _absolute_phase(self, phi_h, phi, geometry: Geometry, mask=None) -> Tensor:
        """Phi of wrapped phases (B, H, W), or (P,) of the pixels of a mask (B, H, W)."""
        if self.reference == "unit":
            return geometry.from_frequencies({"high": phi_h, "unit": phi})
        name = SECOND[self.reference]
        Phi_min = geometry.Phi_min[name]
        if mask is not None:
            Phi_min = Phi_min.expand(mask.shape)[mask]
        return geometry.absolute_phase(phi_h, phi, Phi_min, name)

    def losses(self, outputs: Tensor, batch: dict, geometry: Geometry) -> dict[str, Tensor]:
        """Losses of each image by name (paper, Eq. 12-15)."""
        pixels = Pixels.of(batch["mask"])
        inside = pixels.of_images(outputs)  # (P, 2, 2 or 1)
        phi_h, phi = self.phases(inside)
        components, targets = inside.flatten(1).unbind(1), self._targets(batch, pixels.mask)
        Phi, true = self._absolute_phase(phi_h, phi, geometry, pixels.mask), batch["Phi"]
        return self.weights.losses(pixels, components, targets, phi_h, Phi, true[pixels.mask])

    def _targets(self, batch: dict, mask: Tensor) -> list[Tensor]:
        """What the outputs should be at the pixels of the mask, (P,) each."""
        M, D = batch["M"][:, HIGH], batch["D"][:, HIGH]
        if self.target == "phase":
            return [wrapped_phase(M[mask], D[mask]), true_reference(self, batch)[mask]]
        if self.reference == "refined":
            pair = batch["M_r"], batch["D_r"]
        else:
            at = FREQUENCIES.index(self.reference)
            pair = batch["M"][:, at], batch["D"][:, at]
        return [image[mask] for image in (M, D, *pair)]
