"""A reader may change the numbers of a chapter: every cell still runs.

``changes/CHAPTER.toml`` lists for a chapter what to write in place of what; all of it is changed at
once. A `claim` of the text may then say that it does not hold, but nothing ends in an error.
"""

import tomllib
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).parents[2]
LISTS = sorted((Path(__file__).parent / "changes").glob("*.toml"))


def changed(path: Path, changes: list[dict]):
    """The notebook with all changes made; each must find its text once."""
    notebook = nbformat.read(path, 4)
    cells = {cell.id: cell for cell in notebook.cells}
    for change in changes:
        cell = cells[change["cell"]]
        assert cell.source.count(change["old"]) == 1, f"{change} has its text not once"
        cell.source = cell.source.replace(change["old"], change["new"])
    return notebook


def faults(notebook, folder: Path) -> list[str]:
    """Errors of its cells, but for those that are there to show one."""
    NotebookClient(
        notebook, timeout=600, allow_errors=True, resources={"metadata": {"path": str(folder)}}
    ).execute()
    return [
        f"{cell.id}: {output.ename}: {output.evalue}"
        for cell in notebook.cells
        if "raises-exception" not in cell.metadata.get("tags", ())
        for output in cell.get("outputs", ())
        if output.output_type == "error"
    ]


def test_every_chapter_has_a_list_of_ten():
    chapters = {path.stem for path in (ROOT / "chapters").glob("[0-9]*.ipynb")}
    assert {path.stem for path in LISTS} == chapters
    for path in LISTS:
        changes = tomllib.loads(path.read_text())["change"]
        assert len(changes) >= 10, f"{path.name} lists {len(changes)}"
        changed(ROOT / "chapters" / f"{path.stem}.ipynb", changes)


@pytest.mark.slow
@pytest.mark.parametrize("path", LISTS, ids=lambda path: path.stem)
def test_changed_numbers_end_in_no_error(path):
    changes = tomllib.loads(path.read_text())["change"]
    chapter = ROOT / "chapters" / f"{path.stem}.ipynb"
    assert not faults(changed(chapter, changes), chapter.parent)
