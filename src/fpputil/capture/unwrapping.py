"""How `Patterns` are unwrapped, checked before any photograph is read (chapter 12)."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from fpputil.capture.coding import check_code
from fpputil.capture.patterns import Patterns
from fpputil.decoding import unwrap
from fpputil.decoding.geometric_constraint import minimum_phase, zmin_order
from fpputil.optics.system import System


def unwrapper(patterns: Patterns, axis: str, system=None, size=None) -> Callable | None:
    """Function from P wrapped phases (H, W) to absolute ones, checked before any phase is there.

    None of a Gray code, which has photographs of its own. ValueError if there is no fringe along
    the axis, the pitches do not suit the unwrapping, or it needs a system that is not given.
    """
    pitches, width = [f.pitch for f in patterns.along(axis).values()], patterns.width(axis)
    if patterns.unwrap == "gray":
        check_code(patterns.code(axis)[1], pitches, width)
        if pitches:
            unwrap.check_pitches(pitches, pitches)
        return None
    if patterns.unwrap == "spatial":
        if len(pitches) != 1:
            raise ValueError(
                f"{len(pitches)} pitches along the {axis}s given; spatial unwrapping takes one, "
                "and several unwrap one another (mf, mw)"
            )
        return lambda phis: phis  # what is lit is known later
    if patterns.unwrap != "minimum":
        method = unwrap.TEMPORAL[patterns.unwrap]
        try:
            method(list(np.zeros((len(pitches), 1, 1))), pitches, width)
        except ValueError as error:
            other = unwrap.suggestion(patterns.unwrap, pitches, width)
            raise ValueError(f"{error}{other}") from error
        return lambda phis: method(phis, pitches, width)
    if system is None or axis != "column":
        lack = "no system" if system is None else "fringes along rows"
        raise ValueError(
            f'unwrap "minimum" with {lack} given; the minimum phase needs a calibrated system '
            "and vertical fringes"
        )
    check_size(system, size)
    unwrap.check_pitches(pitches, pitches)
    Phi_min = minimum_phase(system, pitches[0]).astype(np.float32)

    def unwrapped(phis):
        Phis = [unwrap.absolute_phase(phis[0], zmin_order(phis[0], Phi_min))]
        for phi, (longer, pitch) in zip(phis[1:], pairwise(pitches), strict=True):
            K = unwrap.fringe_order(phi, Phis[-1], longer / pitch)
            Phis.append(unwrap.absolute_phase(phi, K))
        return Phis

    return unwrapped


def check_size(system: System, size: tuple[int, int]) -> None:
    """ValueError unless photographs (height, width) are of the system's camera."""
    camera = system.camera
    if (camera.height, camera.width) != size:
        raise ValueError(
            f"a system of {camera.width} x {camera.height} pixels given; the photographs have "
            f"{size[1]} x {size[0]}"
        )


def check_projector(system: System, size: tuple[int, int]) -> None:
    """ValueError unless patterns of a size (width, height) are for the system's projector."""
    projector = system.projector
    if (projector.width, projector.height) != tuple(size):
        raise ValueError(
            f"patterns for a projector of {size[0]} x {size[1]} pixels given; the system has one "
            f"of {projector.width} x {projector.height}: one of them is another rig's"
        )
