"""The learner's editions read as the pages do, run where they should, and are the reader's own."""

import importlib.util
import re
import sys
from pathlib import Path

import nbformat
import pytest

ROOT = Path(__file__).parents[2]
EXTENSIONS = ROOT / "book/_ext"
EDITIONS = ROOT / "_build/editions"
SOURCES = [*(ROOT / "chapters").glob("[!_]*.ipynb"), *(ROOT / "book").glob("*.ipynb")]
MARKUP = re.compile(r"\{[a-z:]+\}`|^\s*`{3,}\{|^\s*:::|^\([\w-]+\)=$|\{\{", re.MULTILINE)


@pytest.fixture(scope="module")
def editions(html):
    """Editions of all notebooks, which every build writes."""
    return {source: nbformat.read(EDITIONS / source.name, as_version=4) for source in SOURCES}


@pytest.fixture(scope="module")
def sources():
    """The notebooks that the editions are made from."""
    return {source: nbformat.read(source, as_version=4) for source in SOURCES}


def prose(notebook):
    return [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]


# --- all editions ---


def test_no_markup_is_left(editions, sources):
    assert sum(bool(MARKUP.search(text)) for made in sources.values() for text in prose(made))
    left = {s.name: [t for t in prose(made) if MARKUP.search(t)] for s, made in editions.items()}
    assert not {name: texts for name, texts in left.items() if texts}


def test_every_figure_has_its_caption(editions, sources):
    number = 0
    for source, made in editions.items():
        ids = [cell.id for cell in made.cells]
        for cell in sources[source].cells:
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


def test_solutions_are_folded_and_leave_room_for_an_answer(editions, sources):
    for source, made in editions.items():
        exercises = "\n".join(prose(sources[source])).count("{exercise-start}")
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


@pytest.mark.slow
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


def test_without_an_address_nothing_names_one(editions):
    (url,) = re.findall(r"^  url: (.*)", (ROOT / "_config.yml").read_text(), re.MULTILINE)
    for made in editions.values():
        assert ("git clone" in made.cells[1].source) == (url != '""')


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


@pytest.mark.parametrize("there", ["no folder", "a folder"])
def test_where_nobody_may_write_one_line_says_what_to_do(there, copies, home, monkeypatch):
    editions, mine = home
    give(copies, editions, "old")

    def refuse(path, *_, **__):
        raise PermissionError(13, "Permission denied", str(path))

    if there == "a folder":
        mine.mkdir()
        monkeypatch.setattr(copies, "write_whole", refuse)
    else:
        monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(SystemExit) as ended:
        copies.main(editions, mine)
    message = str(ended.value)
    assert "\n" not in message and f"copied to {mine} (Permission denied, {mine}" in message
    assert f"cp -r {ROOT} ." in message and "make lab" in message


@pytest.mark.parametrize("content", ['{"cells": []}', "not a notebook", ""])
def test_a_file_of_the_readers_own_is_kept(content, copies, home):
    editions, mine = home
    give(copies, editions, "old")
    mine.mkdir()
    (mine / "one.ipynb").write_text(content)
    assert copies.refresh(editions, mine) == ["one.ipynb"]
    assert (mine / "one.ipynb").read_text() == content
