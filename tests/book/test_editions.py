"""The learner's editions read as the pages do, run where they should, and are the reader's own."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from html import unescape
from pathlib import Path

import nbformat
import pytest

ROOT = Path(__file__).parents[2]
EXTENSIONS = ROOT / "book/_ext"
EDITIONS = ROOT / "_build/editions"
SOURCES = [*(ROOT / "chapters").glob("[!_]*.ipynb"), *(ROOT / "book").glob("*.ipynb")]
MARKUP = re.compile(r"\{[a-z:]+\}`|^\s*`{3,}\{|^\s*:::|^\([\w-]+\)=$|\{\{", re.MULTILINE)


def build(book, out, *options):
    command = [Path(sys.executable).with_name("jupyter-book"), "build", book, *options]
    command += ["--path-output", out]
    environment = {**os.environ, "FPP_EXECUTE": "off"}
    return subprocess.run(command, env=environment, capture_output=True, text=True)


@pytest.fixture(scope="module")
def editions(html):
    """Editions of all notebooks, which every build writes."""
    return {source: nbformat.read(EDITIONS / source.name, as_version=4) for source in SOURCES}


def prose(notebook):
    return [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]


# --- all editions ---


def test_no_markup_is_left(editions):
    assert sum(bool(MARKUP.search(text)) for s in SOURCES for text in prose(nbformat.read(s, 4)))
    left = {s.name: [t for t in prose(made) if MARKUP.search(t)] for s, made in editions.items()}
    assert not {name: texts for name, texts in left.items() if texts}


def test_every_figure_has_its_caption(editions):
    number = 0
    for source, made in editions.items():
        ids = [cell.id for cell in made.cells]
        for cell in nbformat.read(source, as_version=4).cells:
            figure = cell.metadata.get("mystnb", {}).get("figure", {})
            if not figure.get("caption"):
                continue
            number += 1
            below = made.cells[ids.index(cell.id) + 1 :][:2]  # a live figure may stand between
            captions = [c.source for c in below if c.metadata.get("caption_of") == figure["name"]]
            assert len(captions) == 1, (source.name, figure["name"])
            words = re.split(r"[^\w ]", figure["caption"])[0]
            assert re.match(r"\*\*Fig\. \d+(\.\d+)?\.\*\* ", captions[0]) and words in captions[0]
    assert number > 80


def test_code_that_a_page_hides_is_folded(editions):
    for made in editions.values():
        for cell in made.cells:
            if {"hide-input", "remove-input"} & set(cell.metadata.get("tags", [])):
                assert cell.metadata.jupyter.source_hidden


def test_solutions_are_folded_and_leave_room_for_an_answer(editions):
    for source, made in editions.items():
        exercises = "\n".join(prose(nbformat.read(source, as_version=4))).count("{exercise-start}")
        titles = [n for n, c in enumerate(made.cells) if c.source.startswith("#### Solution to")]
        assert len(titles) == exercises
        for n in titles:
            assert made.cells[n].metadata["jp-MarkdownHeadingCollapsed"]
            assert made.cells[n - 1].source.startswith("# Your answer")
            assert made.cells[n - 1].cell_type == "code"


def test_links_lead_to_editions(editions):
    for made in editions.values():
        for target in re.findall(r"\]\(([^)#]+)[^)]*\)", "\n".join(prose(made))):
            assert target.startswith(("http", "attachment:")) or (EDITIONS / target).exists()


def test_an_edition_runs_beside_the_data(editions, tmp_path):
    from nbclient import NotebookClient

    (tmp_path / "data").symlink_to(ROOT / "data")
    (tmp_path / "my-chapters").mkdir()
    made = editions[ROOT / "chapters/01_fringes.ipynb"]
    NotebookClient(made, resources={"metadata": {"path": tmp_path / "my-chapters"}}).execute()
    assert not [
        c.source
        for c in made.cells
        if "raises-exception" not in c.metadata.get("tags", [])
        for output in c.get("outputs", [])
        if output.output_type == "error"
    ]


def test_a_single_file_says_what_is_missing(editions, tmp_path, monkeypatch):
    made = editions[ROOT / "chapters/10_comparison.ipynb"]
    (check,) = (cell.source for cell in made.cells if cell.id == "setup-check")
    check = check.replace("%xmode Minimal\n", "")
    monkeypatch.chdir(ROOT / "chapters")
    exec(check, {})
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileNotFoundError, match="has no folder data.*make lab in the folder"):
        exec(check, {})
    monkeypatch.setitem(sys.modules, "fpputil", None)  # as if it were not installed
    with pytest.raises(ModuleNotFoundError, match="has no fpputil. To run .* make lab"):
        exec(check, {})


# --- the reader's copies ---


@pytest.fixture
def copies():
    spec = importlib.util.spec_from_file_location("fpp_copies", EXTENSIONS / "fpp_copies.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def home(tmp_path, monkeypatch):
    """Folders of editions and of copies; signatures go to neither the reader's home nor ours."""
    monkeypatch.setenv("JUPYTER_DATA_DIR", str(tmp_path / "jupyter"))
    (tmp_path / "editions").mkdir()
    return tmp_path / "editions", tmp_path / "copies"


def give(copies, folder, text, made_from="1"):
    cells = [nbformat.v4.new_markdown_cell(text, id="a"), nbformat.v4.new_code_cell("1", id="b")]
    notebook = nbformat.v4.new_notebook(cells=cells)
    notebook.metadata["fpp_edition"] = {"sha256": made_from, "typed": copies.typed(notebook)}
    nbformat.write(notebook, folder / "one.ipynb")


def test_a_copy_that_the_reader_left_alone_follows_its_edition(copies, home):
    editions, mine = home
    give(copies, editions, "old")
    assert copies.refresh(editions, mine) == []
    ran = nbformat.read(mine / "one.ipynb", as_version=4)  # running is not changing
    ran.cells[1].outputs = [nbformat.v4.new_output("stream", text="1")]
    nbformat.write(ran, mine / "one.ipynb")
    assert copies.refresh(editions, mine) == []
    assert nbformat.read(mine / "one.ipynb", 4).cells[1].outputs, "nothing new, nothing done"
    give(copies, editions, "new", made_from="2")
    assert copies.refresh(editions, mine) == []
    assert nbformat.read(mine / "one.ipynb", as_version=4).cells[0].source == "new"


def test_a_copy_that_the_reader_changed_is_kept(copies, home):
    editions, mine = home
    give(copies, editions, "old")
    copies.refresh(editions, mine)
    own = nbformat.read(mine / "one.ipynb", as_version=4)
    own.cells[1].source = "2"
    nbformat.write(own, mine / "one.ipynb")
    before = (mine / "one.ipynb").read_bytes()
    assert copies.refresh(editions, mine) == [], "nothing new, nothing to say"
    give(copies, editions, "new", made_from="2")
    assert copies.refresh(editions, mine) == ["one.ipynb"]
    assert (mine / "one.ipynb").read_bytes() == before


@pytest.mark.parametrize("content", ['{"cells": []}', "not a notebook", ""])
def test_a_file_of_the_readers_own_is_kept(content, copies, home):
    editions, mine = home
    give(copies, editions, "old")
    mine.mkdir()
    (mine / "one.ipynb").write_text(content)
    assert copies.refresh(editions, mine) == ["one.ipynb"]
    assert (mine / "one.ipynb").read_text() == content


# --- a small book, beside its page ---

PAGE = r"""# One

It is {glue:text}`one-x` {cite}`knuth`, by {eq}`eq-one`, {numref}`fig-one` and {doc}`two`.
`{eq}` is a role. [](two.md), [`two` {glue:text}`one-x`](two.md), {ref}`there <sec-two>`.

$$
x = 1
$$ (eq-one)

:::{dropdown} More
Of {glue:text}`one-x`.

```{literalinclude} some.py
:pyobject: second
```
:::

```{warning}
Not *more*.
```

| a | b |
|---|---|
| {glue:text}`one-x` | `a \| b` {eq}`eq-one` |

- in a list {numref}`fig-one`
"""
TWO = """# Two

(sec-two)=
## There

{term}`Phase`, H{sub}`2`.

```{glossary}
Phase
  Angle.
```
"""
CONFIG = """
execute: {execute_notebooks: "off"}
parse: {myst_enable_extensions: [colon_fence, dollarmath]}
repository: {url: "https://github.com/a/fringes", branch: main}
launch_buttons: {notebook_interface: jupyterlab}
bibtex_bibfiles: [one.bib]
sphinx:
  extra_extensions: [sphinx_exercise, sphinxcontrib.bibtex, sphinx-mathjax-offline]
  local_extensions: {fpp_book: book/_ext, fpp_edition: book/_ext}
  config: {nb_ipywidgets_js: {}, bibtex_reference_style: label, bibtex_default_style: unsrt}
"""
TOC = """
format: jb-book
root: index
parts:
  - {numbered: true, chapters: [{file: one}, {file: two}]}
  - {chapters: [{file: book/bibliography}]}
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A book of three pages and what its build said."""
    book = tmp_path_factory.mktemp("book")
    shutil.copytree(EXTENSIONS, book / "book/_ext")
    (book / "_config.yml").write_text(CONFIG)
    (book / "_toc.yml").write_text(TOC)
    (book / "index.md").write_text("# A book\n")
    (book / "book/bibliography.md").write_text("# Books\n\n```{bibliography}\n```\n")
    (book / "one.bib").write_text("@misc{knuth, title={TAOCP}, author={Knuth, D}, year={1968}}")
    (book / "some.py").write_text("first = 1\n\n\ndef second():\n    return 2\n")
    (book / "two.md").write_text(TWO)
    glued = {"application/papermill.record/text/plain": "'0.123'"}
    named = {"scrapbook": {"name": "one-x", "mime_prefix": "application/papermill.record/"}}
    plot = nbformat.v4.new_output("display_data", {"image/png": "iVBORw0KGgo="})
    cells = [
        nbformat.v4.new_markdown_cell(PAGE, id="page"),
        nbformat.v4.new_code_cell(
            "glue",
            id="glue",
            outputs=[nbformat.v4.new_output("display_data", glued, metadata=named)],
        ),
        nbformat.v4.new_code_cell("plot", id="plot", outputs=[plot]),
        nbformat.v4.new_code_cell('live(instead_of="fig-one")', id="live"),
    ]
    figure = {"name": "fig-one", "caption": "At $x$, {glue:text}`one-x`."}
    cells[2].metadata["mystnb"] = {"figure": figure, "image": {"alt": "x"}}
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    notebook = nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": kernel})
    nbformat.write(notebook, book / "one.ipynb")
    return book, build(book, book, "-n")


@pytest.fixture
def one(small):
    return nbformat.read(small[0] / "_build/editions/one.ipynb", as_version=4)


def test_numbers_are_those_of_the_page(small, one):
    html = (small[0] / "_build/html/one.html").read_text(encoding="utf-8")
    page = " ".join(unescape(re.sub(r"<[^>]*>", "", html)).split())
    sentence = next(line for line in one.cells[0].source.splitlines() if line.startswith("It is"))
    assert sentence == "It is 0.123 [1], by (1.1), Fig. 1.1 and [Two](two.ipynb)."
    assert "It is 0.123 [1], by (1.1), Fig. 1.1 and Two." in page
    assert one.cells[0].source.startswith("# 1. One") and "1. One" in page
    assert r"x = 1 \tag{1.1}" in one.cells[0].source


def test_what_stands_for_something_is_written_out(one):
    text = one.cells[0].source
    for found in (
        "`{eq}` is a role. [Two](two.ipynb), [`two` 0.123](two.ipynb), ",
        "[there](two.ipynb#2.1.-There)",
        "<details><summary><strong>More</strong></summary>\n\nOf 0.123.",
        "```python\ndef second():\n    return 2\n```",
        "> **Warning**\n>\n> Not *more*.",
        "| 0.123 | `a \\| b` (1.1) |",
        "- in a list Fig. 1.1",
    ):
        assert found in text
    assert one.cells[-1].source.startswith("## References\n\n[1] D Knuth")


def test_a_caption_stands_below_the_figures(one):
    assert [c.id for c in one.cells[-4:]] == ["plot", "live", "plot-caption", "references"]
    assert one.cells[-2].source == "**Fig. 1.1.** At $x$, 0.123."


def test_what_is_unknown_is_a_warning(small):
    warnings = [line for line in small[1].stderr.splitlines() if "WARNING" in line]
    assert len(warnings) == 1 and "the role {sub} is not known to the editions" in warnings[0]


def test_the_page_hands_out_the_edition(small):
    html = (small[0] / "_build/html/one.html").read_text(encoding="utf-8")
    assert 'href="_editions/one.ipynb"' in html and "_sources/one.ipynb" not in html
    assert (small[0] / "_build/html/_editions/one.ipynb").exists()


def test_one_address_makes_all_links(small):
    book, made = small[0], nbformat.read(small[0] / "_build/editions/one.ipynb", as_version=4)
    html = (book / "_build/html/one.html").read_text(encoding="utf-8")
    for link in (
        "https://mybinder.org/v2/gh/a/fringes/main?urlpath=lab/tree/my-chapters/one.ipynb",
        "https://colab.research.google.com/github/a/fringes/blob/gh-pages/_editions/one.ipynb",
        '"https://github.com/a/fringes"',
        "https://github.com/a/fringes/issues/new",
    ):
        assert link in html, link
    assert "git clone https://github.com/a/fringes" in made.cells[1].source
    assert "google.colab" in made.cells[2].source


def test_without_an_address_nothing_names_one(editions):
    (url,) = re.findall(r"^  url: (.*)", (ROOT / "_config.yml").read_text(), re.MULTILINE)
    for made in editions.values():
        assert ("git clone" in made.cells[1].source) == (url != '""')
