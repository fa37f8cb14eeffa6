"""Which file is which photograph: names with fields or ``*``, one for all or for each fringe.

`Patterns` says what the names may be (chapter 12).
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

from fpputil.capture.files.images import STACKS
from fpputil.optics.graycode import GrayCode

FORMATS = {"axis": "s", "pitch": "g", "periods": "g", "step": "d", "number": "d"}
FIELD = re.compile(r"\{(axis|pitch|periods|step|number)(?::(0?[1-9]))?\}")


class Shot(NamedTuple):
    """A photograph: its fringe (-1 for plain light), its step, its file, and its page there."""

    fringe: int
    step: int
    file: str
    page: int = 0


def shots_of(patterns, names: Sequence[str] | None = None) -> list[Shot]:
    """All photographs of `Patterns` in the order of time, plain light first.

    Parameters
    ----------
    patterns : Patterns
    names : sequence of str, optional
        Of the files in the folder; needed where the names of the patterns have a ``*``.

    Raises
    ------
    ValueError
        If not as many files match as there are steps.
    """
    pairs, files = patterns.in_time(), patterns.files
    plain = [Shot(-1, n, file) for n, file in enumerate((patterns.white, patterns.black)) if file]
    names, here = names or (), {shot.file for shot in plain}
    if isinstance(files, str) and "*" in files:
        plain, named = _matching_all(patterns, names, plain)
    elif isinstance(files, str):
        named = [_name(patterns, *pair, number) for number, pair in enumerate(pairs, len(plain))]
    else:
        others = [n for n in names if n not in here]
        of = [_of_fringe(patterns, k, others) for k in range(len(files))]
        named = [of[k][n] for k, n in pairs]
    return _paged(plain + [Shot(*pair, file) for pair, file in zip(pairs, named, strict=True)])


def per_fringe(files, steps: Sequence[int], pairs: Sequence[tuple[int, int]]):
    """One name for all, or a tuple that has for each fringe a name or the names of its steps.

    ValueError if `files` are not one, nor as many as the fringes (of so many `steps`), nor as the
    photographs, whose fringe and step in the order of time are `pairs`.
    """
    if isinstance(files, str) or len(files) == 1:
        return files if isinstance(files, str) else files[0]
    if len(files) == len(pairs) and all(isinstance(name, str) for name in files):
        names = dict(zip(pairs, files, strict=True))
        files = [[names[k, n] for n in range(number)] for k, number in enumerate(steps)]
    if len(files) != len(steps):
        raise ValueError(
            f"{len(files)} files given; one name for all, or for each of the {len(steps)} "
            f"fringes, or for each of the {len(pairs)} photographs is needed"
        )
    for k, (file, number) in enumerate(zip(files, steps, strict=True), 1):
        if not isinstance(file, str) and len(file) != number:
            raise ValueError(f"{len(file)} files of fringe {k} given; it has {number} steps")
    return tuple(file if isinstance(file, str) else tuple(file) for file in files)


def all_names(files) -> list[str]:
    """All names of the `files` of `Patterns`, as they were given."""
    given = (files,) if isinstance(files, str) else files
    return [name for file in given for name in ((file,) if isinstance(file, str) else file)]


def check_names(patterns) -> None:
    """ValueError if a name has an unknown field, or would be several photographs."""
    names = all_names(patterns.files)
    for name in names:
        plain = FIELD.sub("", name)
        if "{" in plain or "}" in plain:
            raise ValueError(
                f"files {name!r} given; {{axis}}, {{pitch}}, {{step}} and {{number}} are known "
                "(and {periods}), with the least number of digits as in {step:02}"
            )
    if any("*" in name for name in names):
        return
    number = Counter(shot.file for shot in shots_of(patterns))
    twice = [name for name, n in number.items() if n > 1 and not name.lower().endswith(STACKS)]
    if twice:
        raise ValueError(
            f"files {patterns.files!r} given; {twice[0]} would be several photographs: name the "
            "axis, the pitch and the step where there are several"
        )


def composed(name: str) -> str:
    r"""A name as others compare equal to it, whatever the system's encoding and way of accents.

    UTF-8 that was taken for another encoding is decoded, and accents join their letters.

    >>> composed("a\u0308") == composed("\udcc3\udca4") == "\xe4"
    True
    """
    data = name.encode("utf-8", "surrogateescape")
    return unicodedata.normalize("NFC", data.decode("utf-8", "surrogateescape"))


def natural(name: str) -> list:
    """Key that sorts step-2 before step-10."""
    return [(int(p), p) if p.isdecimal() else (0, p) for p in re.split(r"([0-9]+)", name)]


def _name(patterns, k: int, n: int, number: int) -> str:
    first, files = patterns.first, patterns.files
    fringe, step = patterns.fringes[k], n + (first[k] if isinstance(first, tuple) else first)
    values = {"axis": fringe.axis, "pitch": fringe.pitch, "step": step, "number": number}
    if isinstance(fringe, GrayCode):
        values |= {"pitch": "gray", "periods": "gray"}
    else:
        values["periods"] = patterns.width(fringe.axis) / fringe.pitch
    file = files if isinstance(files, str) else files[k]
    return FIELD.sub(lambda m: _formatted(values, *m.groups()), file)


def _formatted(values: dict, name: str, digits: str | None) -> str:
    value = values[name]
    return value if isinstance(value, str) else format(value, (digits or "") + FORMATS[name])


def _of_fringe(patterns, k: int, names: Sequence[str]) -> Sequence[str]:
    """Names of the photographs of a fringe by step, out of those in the folder."""
    fringe, file = patterns.fringes[k], patterns.files[k]
    if not isinstance(file, str):
        return file
    if "*" not in file:
        return [_name(patterns, k, n, n) for n in range(fringe.steps)]
    matching = _matching(names, file)
    if len(matching) != fringe.steps:
        raise ValueError(
            f"{len(matching)} files match {file!r}; fringe {k + 1}, along the {fringe.axis}s, has "
            f"{fringe.steps} steps"
        )
    return matching


def _matching(names: Sequence[str], pattern: str) -> list[str]:
    """Those names that match a pattern with ``*``, which stands for no folder; in natural order."""
    deep, pattern = pattern.count("/"), composed(pattern)
    fit = (n for n in names if n.count("/") == deep and fnmatchcase(n, pattern))
    return sorted(fit, key=natural)


def _matching_all(patterns, names: Sequence[str], plain: list[Shot]):
    """Photographs in plain light, by name or the first of all, and names of the others."""
    plain_names, needed = {shot.file for shot in plain}, len(patterns.in_time())
    matching = _matching(names, patterns.files)
    if plain_names & set(names):
        matching = [n for n in matching if n not in plain_names]
    elif len(matching) == needed + len(plain):
        first, matching = matching[: len(plain)], matching[len(plain) :]
        plain = [shot._replace(file=n) for shot, n in zip(plain, first, strict=True)]
    if len(matching) != needed:
        each = " + ".join(str(f.steps) for f in patterns.fringes)
        raise ValueError(
            f"{len(matching)} files match {patterns.files!r}; the fringes have {each} = {needed} "
            f"steps, before which {len(plain)} photographs in plain light may stand (white and "
            "black in the pattern file)"
        )
    return plain, matching


def _paged(shots: list[Shot]) -> list[Shot]:
    """Shots of which those of one file take its pages one after the other."""
    seen: Counter[str] = Counter()
    paged = []
    for shot in shots:
        paged.append(shot._replace(page=seen[shot.file]))
        seen[shot.file] += 1
    return paged
