"""What a page shows of a cell: numbers inside sentences, claims of the text, and tables."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from tabulate import tabulate

GLUED = "application/papermill.record/"


def say(prefix: str, **texts: str) -> None:
    """Hand texts to the sentences of a chapter, where ``{glue:text}`PREFIX-NAME``` shows them.

    Parameters
    ----------
    prefix : str
        Of the chapter, as "ch5".
    **texts : str
        Formatted numbers by name; underscores become hyphens.

    Raises
    ------
    TypeError
        If one is not text: how many digits a reader sees is decided where it is computed.
    """
    from IPython.display import display

    for name, text in texts.items():
        if not isinstance(text, str):
            raise TypeError(f"{name} {text!r} given; a formatted text is needed, as f'{{x:.2f}}'")
        # As `myst_nb.glue` does it; to import that takes seconds in every notebook.
        about = {"name": f"{prefix}-{name.replace('_', '-')}", "mime_prefix": GLUED}
        data = {f"{GLUED}text/plain": repr(text)}
        display(data, raw=True, metadata={"scrapbook": about})


def claim(holds: bool, says: str) -> None:
    """Guard a sentence of the text: print nothing while it holds, a note when it does not.

    A reader who changes a number gets the note and goes on. The tests of the book fail at it.

    Parameters
    ----------
    holds : bool
        Whether the computed numbers bear the sentence out; arrays are not taken.
    says : str
        What the text says, as "five steps are noisier than fifteen".

    Examples
    --------
    >>> claim(3 > 2, "three is more than two")
    >>> claim(2 > 3, "the first is larger")
    Note: the text says that the first is larger; with these numbers it is not so.
    """
    if not holds:
        print(f"Note: the text says that {says}; with these numbers it is not so.")


@dataclass(frozen=True)
class Table:
    """Rows under the names of their columns: HTML on a page, text in a terminal.

    Parameters
    ----------
    columns : sequence of str
        Names.
    rows : sequence of sequences
        Cells; text stands left, numbers stand right.
    formats : str or sequence of str
        Format of the numbers of all columns or of each, as ".3f"; "" leaves them as they are.

    Examples
    --------
    >>> Table(["pitch", "noise, rad"], [[15, 0.01234], [114, 0.01]], ["", ".3f"])
      pitch    noise, rad
    -------  ------------
         15         0.012
        114         0.010
    """

    columns: Sequence[str]
    rows: Sequence[Sequence]
    formats: str | Sequence[str] = ""

    def __post_init__(self):
        rows = [list(row) for row in self.rows]
        object.__setattr__(self, "rows", rows)
        width = len(self.columns)
        if wrong := [row for row in rows if len(row) != width]:
            raise ValueError(f"a row of {len(wrong[0])} cells given; there are {width} columns")
        if not isinstance(self.formats, str) and len(self.formats) != width:
            raise ValueError(f"{len(self.formats)} formats given; there are {width} columns")

    def __repr__(self) -> str:
        return self._drawn("simple")

    __str__ = __repr__

    def _repr_html_(self) -> str:
        return re.sub(r" +(?=</t)|(?<=>) +", "", self._drawn("html"))  # blanks that align text

    def _drawn(self, style: str) -> str:
        formats, width = self.formats, len(self.columns)
        formats = [formats] * width if isinstance(formats, str) else formats
        cells = [
            [c if isinstance(c, str) else f"{c:{f}}" for c, f in zip(row, formats, strict=True)]
            for row in self.rows
        ]
        text = [all(isinstance(row[k], str) for row in self.rows) for k in range(width)]
        sides = ["left" if is_text else "right" for is_text in text]
        return tabulate(cells, self.columns, style, disable_numparse=True, colalign=sides)
