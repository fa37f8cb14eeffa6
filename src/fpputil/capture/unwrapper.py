"""Which unwrapping a set of patterns wants, checked before any photograph is read (chapter 12)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fpputil.capture.patterns import Patterns
from fpputil.decoding import unwrap
from fpputil.decoding.geometric_constraint import minimum_phase, zmin_order


def unwrapper(patterns: Patterns, axis: str, fringes, system=None, size=None) -> Callable:
    """Function from wrapped phases (P, H, W) to levels, checked before any phase is there.

    A `Level` each for the phases and, by multi-wavelength unwrapping, for their beats.

    Raises
    ------
    ValueError
        If the pitches do not suit the unwrapping, or it needs a system that is not given.
    """
    pitches, width = [f.pitch for f in fringes], patterns.width(axis)
    if patterns.unwrap == "minimum":
        return _by_minimum(pitches, axis, system, size)
    method = {"mf": unwrap.mf_tpu, "nt": unwrap.nt_tpu}.get(patterns.unwrap)

    def levels(wrapped):
        if method is None:
            return unwrap.by_beats(list(wrapped), pitches, width)
        return [unwrap.Level(pitches, method(list(wrapped), pitches, width), [])]

    levels(np.zeros((len(pitches), 1, 1)))  # which tells of unsuitable pitches
    return levels


def _by_minimum(pitches, axis, system, size) -> Callable:
    if system is None or axis != "column":
        raise ValueError(
            'unwrap "minimum" with ' + ("no system" if system is None else "fringes along rows")
            + " given; the minimum phase needs a calibrated system and vertical fringes"
        )  # fmt: skip
    if (system.camera.height, system.camera.width) != size:
        raise ValueError(
            f"a system of {system.camera.width} x {system.camera.height} pixels given; the "
            f"photographs have {size[1]} x {size[0]}"
        )
    unwrap.check_pitches(pitches, pitches)
    Phi_min = minimum_phase(system, pitches[0]).astype(np.float32)

    def levels(wrapped):
        Phi = [unwrap.absolute_phase(wrapped[0], zmin_order(wrapped[0], Phi_min))]
        for phi, longer, pitch in zip(wrapped[1:], pitches, pitches[1:], strict=False):
            Phi.append(
                unwrap.absolute_phase(phi, unwrap.fringe_order(phi, Phi[-1], longer / pitch))
            )
        return [unwrap.Level(pitches, Phi, [])]

    return levels
