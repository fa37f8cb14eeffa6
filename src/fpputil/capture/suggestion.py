"""What would make pitches suit a projector, for errors to propose (chapter 12)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fpputil.decoding.unwrap import TEMPORAL, beats_of


def unwraps(method: str, pitches: Sequence[float], width: float) -> bool:
    """Whether pitches, in any order, name each of so many projector columns.

    >>> unwraps("mf", (114, 912), 912), unwraps("mw", (42, 45, 48), 1920)
    (True, True)
    """
    pitches = sorted(pitches, reverse=method != "mw")
    try:
        TEMPORAL[method](list(np.zeros((len(pitches), 1, 1))), pitches, width)
    except ValueError:
        return False
    return True


def suggestion(method: str, pitches: Sequence[float], width: float) -> str:
    """What would do where pitches do not unwrap by a method; "" if nothing is known.

    >>> suggestion("mf", (42, 45, 48), 1920)
    '; unwrapped by their beats they would do (unwrap mw)'
    >>> suggestion("mf", (1, 8, 48), 1920)
    '; these look like periods: 1 8 48 of them over 1920 pixels would do (periods, not pitches)'
    """
    if all(float(p).is_integer() and p <= width / 2 for p in pitches):
        periods = [width / p for p in pitches]
        for other in dict.fromkeys((method, "mf", "mw")):
            if unwraps(other, periods, width) and not (
                other != method and unwraps("mw", pitches, width)
            ):
                by = "" if other == method else f", and unwrap {other}"
                numbers = " ".join(f"{p:g}" for p in pitches)
                return (
                    f"; these look like periods: {numbers} of them over {width:g} pixels would do "
                    f"(periods, not pitches{by})"
                )
    if method != "mw" and unwraps("mw", pitches, width):
        return "; unwrapped by their beats they would do (unwrap mw)"
    if method == "mw" and unwraps("mf", pitches, width):
        return "; unwrapped one by one they would do (unwrap mf)"
    return ""


def reach(method: str, pitches: Sequence[float]) -> float:
    """Projector pixels that pitches tell apart, all in all.

    >>> reach("mf", (19, 1824, 114)), reach("mw", (14, 15, 16)), reach("nt", (28, 45))
    (1824, 1680.0, 1260)
    """
    if method == "nt" and all(float(p).is_integer() for p in pitches):
        return math.lcm(*map(int, pitches))
    pitches = sorted(pitches)
    while method == "mw" and len(pitches) > 1 and len(set(pitches)) == len(pitches):
        pitches = beats_of(pitches)[0]
    return max(pitches)
