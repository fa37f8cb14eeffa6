"""Options that several commands share."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter


def _size(type_, tokens) -> tuple[int, int]:
    numbers = re.fullmatch(r"([1-9][0-9]{0,5})x([1-9][0-9]{0,5})", tokens[0].value)
    if not numbers:
        raise ValueError(f"size {tokens[0].value!r} given; WIDTHxHEIGHT is needed, as 912x1140")
    return int(numbers[1]), int(numbers[2])


Size = Annotated[tuple[int, int], Parameter(converter=_size, n_tokens=1, metavar="WxH")]
"""A size as "912x1140"."""

Several = Parameter(consume_multiple=True)
"""One or more values after one option."""


@Parameter(name="*", group="Fringes")
@dataclass(frozen=True)
class Fringes:
    """Which fringes there are.

    Parameters
    ----------
    pitches
        Projector pixels a period, in the order of unwrapping (default for mf: the longer side, an
        eighth and a forty-eighth of it).
    steps
        Of all pitches, or of each (default 8).
    axis
        Fringes along columns (vertical, default), rows, or both, which calibration needs.
    unwrap
        mf (default), mw, nt or minimum.
    shift
        Sign of the phase shift (default 1).
    """

    pitches: Annotated[list[float] | None, Several] = None
    steps: Annotated[list[int] | None, Several] = None
    axis: Literal["column", "row", "both"] | None = None
    unwrap: str | None = None
    shift: Literal[1, -1] | None = None

    def patterns(self, projector: tuple[int, int], **names):
        """`Patterns` of these fringes for a projector (width, height), refused if they do not
        unwrap."""
        from fpputil.capture.measurement import unwrapper
        from fpputil.capture.patterns import Patterns
        from fpputil.optics.fringes import fringe_set

        side, unwrap = max(projector), self.unwrap or "mf"
        if self.pitches is None and unwrap not in ("mf", "minimum"):
            raise ValueError(f"unwrap {unwrap!r} without --pitches given; name them")
        pitches = self.pitches or [side, side / 8, side / 48]
        pitches = [int(p) if float(p).is_integer() else p for p in pitches]
        axes = ("column", "row") if self.axis == "both" else (self.axis or "column",)
        steps = self.steps or [8]
        steps = steps[0] if len(steps) == 1 else steps
        fringes = sum((fringe_set(pitches, steps, axis=axis) for axis in axes), ())
        patterns = Patterns(projector, fringes, unwrap, self.shift or 1, **names)
        if unwrap != "minimum":  # whose pitches the system decides on
            for axis in axes:
                try:
                    unwrapper(patterns, axis)
                except ValueError as error:
                    raise ValueError(f"fringes along {axis}s: {error}") from error
        return patterns


FRINGES = Fringes()


@Parameter(name="*", group="Processes")
@dataclass(frozen=True)
class Training:
    """With what to train.

    Parameters
    ----------
    workers
        Processes that load.
    device
        cpu, cuda, cuda:1 ... (default: a GPU if there is one).
    threads
        Of the processor (default: all).
    """

    workers: int = 1
    device: str | None = None
    threads: int | None = None

    def begin(self) -> dict:
        """Use so many threads; returns options of `fit`."""
        from fpputil.learning.devices import use_threads

        use_threads(self.threads)
        return {"workers": self.workers, "device": self.device, "progress": True}


TRAINING = Training()


def given(options) -> dict:
    """Those of a dataclass of options that were given."""
    return {name: value for name, value in vars(options).items() if value is not None}


def free(file: Path, force: bool) -> None:
    """ValueError if a file is there and may not be replaced."""
    if file.exists() and not force:
        raise ValueError(f"{file} is there already; name another file, or use --force")
