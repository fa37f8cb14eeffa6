"""Every chapter has its skeleton, its stored outputs and its exercises."""

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# The template is held to the same rules as the chapters made from it.
CHAPTERS = sorted((ROOT / "chapters").glob("*.ipynb"))
HEAD = [
    *("The road: ", "*You are here: ", "**You will be able to**", "**Prerequisites**"),
    *("**Time**", "{time}`read`", "{time}`run`"),
]
TAIL = ["## Summary", "## What next", "## Exercises"]
IGNORED = {"nbval-ignore-output", "nbval-skip"}


@pytest.fixture(scope="module", params=CHAPTERS, ids=lambda path: path.stem)
def path(request):
    return request.param


@pytest.fixture(scope="module")
def cells(path):
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def source(cell):
    return "".join(cell["source"])


def code(cells):
    return [cell for cell in cells if cell["cell_type"] == "code"]


def prose(cells):
    return "\n\n".join(source(cell) for cell in cells if cell["cell_type"] == "markdown")


def tags(cell):
    return set(cell["metadata"].get("tags", []))


def figures(cell):
    return [out for out in cell["outputs"] if "image/png" in out.get("data", {})] + [
        out for out in cell["outputs"] if "image/svg+xml" in out.get("data", {})
    ]


def test_there_are_chapters():
    assert CHAPTERS


def test_head(cells):
    assert cells[0]["cell_type"] == "markdown"
    head = source(cells[0])
    assert re.match(r"# \S", head), "the first cell begins with the title"
    places = [head.find(part) for part in HEAD]
    assert -1 not in places and places == sorted(places), f"the first cell holds, in order, {HEAD}"


def test_tail(cells):
    sections = re.findall(r"^## .*$", prose(cells), flags=re.MULTILINE)
    assert sections[-3:] == TAIL


def test_outputs_are_stored(cells):
    """Every code cell was executed, top to bottom, and what prints has its output."""
    counts = [cell["execution_count"] for cell in code(cells) if source(cell).strip()]
    assert counts == list(range(1, len(counts) + 1)), "execute all cells in order, then save"
    silent = [
        source(cell)
        for cell in code(cells)
        if re.search(r"^(print|plt\.show|glue|say|Table)\(", source(cell), flags=re.MULTILINE)
        and not cell["outputs"]
    ]
    assert not silent


def test_no_stored_error(cells):
    for cell in code(cells):
        failed = any(out["output_type"] == "error" for out in cell["outputs"])
        assert failed == ("raises-exception" in tags(cell)), source(cell)


def test_what_the_text_claims_holds_and_stops_nobody(cells):
    """A `claim` that fails prints a note; a bare assert would end a reader's run."""
    for cell in code(cells):
        assert not re.search(r"^\s*assert\b", source(cell), flags=re.MULTILINE), source(cell)
        assert not any("Note: the text says" in str(out.get("text")) for out in cell["outputs"])


def test_few_outputs_are_ignored_and_claimed_instead(cells):
    blocks = code(cells)
    ignored = [k for k, cell in enumerate(blocks) if IGNORED & tags(cell)]
    assert 10 * len(ignored) <= len(blocks), f"{len(ignored)} of {len(blocks)} cells ignored"
    for k in ignored:
        follower = source(blocks[k + 1]) if k + 1 < len(blocks) else ""
        assert re.search(r"\bclaim\(", follower), f"a claim must follow:\n{source(blocks[k])}"


def test_no_other_way_to_ignore_an_output(cells):
    for cell in code(cells):
        assert not re.search(r"#\s*NBVAL_|#\s*PYTEST_VALIDATE", source(cell)), source(cell)


def test_exercises_have_solutions(cells):
    text = prose(cells)
    starts = re.findall(r"\{exercise-start\}\s*\n:label: (\S+)", text)
    solved = re.findall(r"\{solution-start\} (\S+)\n:class: dropdown", text)
    assert len(starts) >= 4
    assert sorted(starts) == sorted(solved), "one folded solution an exercise"
    assert text.count(":::{dropdown} Hint\n") == len(starts)


def test_figures_have_name_caption_and_alt_text(cells):
    for cell in code(cells):
        if figures(cell):
            mystnb = cell["metadata"].get("mystnb", {})
            assert mystnb.get("figure", {}).get("name"), f"no name:\n{source(cell)}"
            assert mystnb["figure"].get("caption"), f"no caption:\n{source(cell)}"
            assert mystnb.get("image", {}).get("alt"), f"no alt text:\n{source(cell)}"
    assert not re.search(r"!\[\s*\]\(", prose(cells)), "a picture in the prose has no alt text"


def test_figures_of_the_paper_are_called_by_their_number(cells):
    for cell in code(cells):
        caption = cell["metadata"].get("mystnb", {}).get("figure", {}).get("caption", "")
        assert not re.search(r"paper's [Ff]ig(\.|ure) (?!\d)", caption), caption


@pytest.mark.parametrize("path", [*CHAPTERS, ROOT / "book/index.ipynb"], ids=lambda path: path.stem)
def test_what_moves_is_stored_with_the_code_of_today(path):
    """The outputs are compared without it, and pages of stored outputs run it."""
    runtime = (ROOT / "src/fpputil/interactive/runtime.js").read_text(encoding="utf-8")
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        for output in cell.get("outputs", ()):
            html = "".join(output.get("data", {}).get("text/html", ""))
            stored = re.findall(r"<script data-fpp-runtime>(.*?)</script>", html, re.DOTALL)
            assert set(stored) <= {runtime}, source(cell)


def test_size(path):
    assert path.stat().st_size < 3_000_000
