"""Methods: which photographs go in, what should come out, how it becomes phase (ch. 8 and 9).

A method is a frozen dataclass of plain settings with

- ``photographs``, as `SynthFringe` names them, and ``inputs``, what the network sees of them;
- ``network``, with fresh weights, and ``losses``, of which "total" is the one to minimise;
- ``phases`` and ``absolute``, the wrapped phases of its outputs and Phi of the high pitch;
- ``reference``, the frequency of the second of these phases, "refined" for the refined reference.
"""

from __future__ import annotations

from dataclasses import asdict, fields

from fpputil.networks.losses import Weights
from fpputil.networks.methods.dlalnet import DLALNetMethod
from fpputil.networks.methods.psnet import PSNetMethod
from fpputil.networks.methods.sfnet import SFNetMethod
from fpputil.networks.methods.sido import SIDOMethod

METHODS = {
    "sfnet": SFNetMethod,
    "sido": SIDOMethod,
    "psnet": PSNetMethod,
    "dlalnet": DLALNetMethod,
}
Method = SFNetMethod | SIDOMethod | PSNetMethod | DLALNetMethod


def settings_of(method: Method) -> dict:
    """A method as plain numbers and names, as JSON holds it."""
    names = {kind: name for name, kind in METHODS.items()}
    return {"method": names[type(method)], **asdict(method)}


def method_of(settings: dict) -> Method:
    """The method that `settings_of` gave.

    Raises
    ------
    KeyError, TypeError, ValueError
        If settings are unknown, missing or out of range.
    """
    given = dict(settings)
    name = given.pop("method")
    if name not in METHODS:
        raise ValueError(f"method {name!r} is not known")
    if given.get("weights") is not None:
        given["weights"] = Weights(**given["weights"])
    known = {f.name for f in fields(METHODS[name])}
    if set(given) != known:
        raise ValueError(f"settings {sorted(given)} found, {sorted(known)} needed")
    return METHODS[name](**given)  # which checks them
