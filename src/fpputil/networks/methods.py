"""Methods by name, and as JSON holds them (chapters 8 and 9)."""

from dataclasses import asdict, fields

from fpputil.networks.dlalnet import DLALNetMethod
from fpputil.networks.losses import Weights
from fpputil.networks.psnet import PSNetMethod
from fpputil.networks.sfnet import SFNetMethod
from fpputil.networks.sido import SIDOMethod
from fpputil.networks.targets import Method

METHODS = {
    "sfnet": SFNetMethod,
    "sido": SIDOMethod,
    "psnet": PSNetMethod,
    "dlalnet": DLALNetMethod,
}


LATER = {"normalised", "coordinates", "errors", "unit_step", "phase_weight"}
"""Settings that came later: where they are missing, they have their defaults."""


def settings_of(method: Method) -> dict:
    """A method as plain numbers and names, as JSON holds it.

    >>> settings_of(PSNetMethod())  # doctest: +ELLIPSIS
    {'method': 'psnet', 'base': 8, 'levels': 6, 'dropout': 0.1, ...}
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
    if not known - LATER <= set(options) <= known:
        raise ValueError(f"settings {sorted(options)} found, {sorted(known - LATER)} needed")
    return METHODS[name](**options)  # which checks them
