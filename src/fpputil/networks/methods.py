"""Methods: which photographs go in, what should come out, how it becomes phase (ch. 8 and 9)."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Protocol

from torch import Tensor, nn

from fpputil.networks.dlalnet import DLALNetMethod
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Weights
from fpputil.networks.psnet import PSNetMethod
from fpputil.networks.sfnet import SFNetMethod
from fpputil.networks.sido import SIDOMethod
from fpputil.optics.system import Frame

METHODS = {
    "sfnet": SFNetMethod,
    "sido": SIDOMethod,
    "psnet": PSNetMethod,
    "dlalnet": DLALNetMethod,
}


class Method(Protocol):
    """What training, evaluation and prediction ask of a method: a frozen dataclass of settings.

    Parameters
    ----------
    photographs : tuple of (frequency, steps, step)
        What is photographed, as `SynthFringe` names it.
    reference : str or None
        Frequency of the second wrapped phase, "refined" for the refined reference.
    """

    photographs: tuple[Frame, ...]
    reference: str | None

    def network(self) -> nn.Module:
        """The network, its weights drawn from torch's generator."""

    def inputs(self, frames: Tensor, geometry: Geometry) -> Tensor:
        """What the network sees of photographs (B, F, H, W)."""

    def losses(self, outputs: Tensor, batch: dict, geometry: Geometry) -> dict[str, Tensor]:
        """Losses of each image by name, (B,) each; "total" is the one to minimise."""

    def phases(self, outputs: Tensor) -> tuple[Tensor, Tensor | None]:
        """Wrapped phases (B, ...) of its outputs, radians: of the high pitch, of `reference`."""

    def absolute_phase(self, outputs: Tensor, geometry: Geometry) -> Tensor:
        """Phi of the high pitch, radians, (B, H, W)."""


def settings_of(method: Method) -> dict:
    """A method as plain numbers and names, as JSON holds it.

    >>> settings_of(PSNetMethod())
    {'method': 'psnet', 'base': 8, 'levels': 6, 'dropout': 0.1}
    """
    names = {kind: name for name, kind in METHODS.items()}
    return {"method": names[type(method)], **asdict(method)}


def method_of(settings: dict) -> Method:
    """The method that `settings_of` described; an error if settings are missing or wrong."""
    options = dict(settings)
    name = options.pop("method")
    if name not in METHODS:
        raise ValueError(f"method {name!r} is not known")
    if options.get("weights") is not None:
        options["weights"] = Weights(**options["weights"])
    known = {f.name for f in fields(METHODS[name])}
    if set(options) != known:
        raise ValueError(f"settings {sorted(options)} found, {sorted(known)} needed")
    return METHODS[name](**options)  # which checks them
