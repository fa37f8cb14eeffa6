"""The edition of a small book stands beside its page: numbers, markup, captions, links."""

import os
import re
import shutil
import subprocess
import sys
from html import unescape
from pathlib import Path

import nbformat
import pytest

pytestmark = pytest.mark.slow  # the book is built in a process of its own
EXTENSIONS = Path(__file__).parents[2] / "book/_ext"


def build(book, out, *options):
    command = [Path(sys.executable).with_name("jupyter-book"), "build", book, *options]
    command += ["--path-output", out]
    environment = {**os.environ, "FPP_EXECUTE": "off"}
    return subprocess.run(command, env=environment, capture_output=True, text=True)


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
