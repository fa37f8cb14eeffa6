"""A build is fresh and loud: it runs again when it must, and fails when it should."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow  # each builds a book in a process of its own
COUNTER = "from pathlib import Path\nwith Path('runs').open('a') as f:\n    f.write('x')"


@pytest.fixture
def book(tmp_path):
    """A book of one chapter that leaves an x in a file each time it runs."""
    shutil.copytree(ROOT / "book/_ext", tmp_path / "book/_ext")
    (tmp_path / "_config.yml").write_text(
        "execute: {execute_notebooks: cache, raise_on_error: true}\n"
        "sphinx:\n"
        "  extra_extensions: [sphinx-mathjax-offline]\n"
        "  local_extensions: {fpp_book: book/_ext}\n"
        "  config: {nb_ipywidgets_js: {}}\n"
    )
    (tmp_path / "_toc.yml").write_text("format: jb-book\nroot: index\nchapters: [{file: one}]\n")
    (tmp_path / "index.md").write_text("# A book\n\n$x^2$, {time}`read`\n")
    for name in ("src/module.py", "data/table.csv", "requirements.lock"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1\n")
    write(tmp_path, COUNTER)
    return tmp_path


def write(book, code, prose="# One\n\n{time}`run`"):
    cells = [nbformat.v4.new_markdown_cell(prose), nbformat.v4.new_code_cell(code)]
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    notebook = nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": kernel})
    nbformat.write(notebook, book / "one.ipynb")


def build(book, *options, execute="on"):
    command = [Path(sys.executable).with_name("jupyter-book"), "build", book, *options]
    environment = {**os.environ, "FPP_EXECUTE": execute}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)


def runs(book):
    marks = book / "runs"
    return len(marks.read_text()) if marks.exists() else 0


def test_a_change_executes_again(book):
    first = build(book, "-W", "--keep-going")
    assert first.returncode == 0, first.stderr
    assert build(book).returncode == 0
    assert runs(book) == 1, "nothing changed, nothing runs"
    for times, changed in enumerate(("src/module.py", "data/table.csv", "requirements.lock"), 2):
        (book / changed).write_text("2\n")
        assert build(book).returncode == 0
        assert runs(book) == times, f"{changed} changed"


MEET = """\
import time
from pathlib import Path
with Path("runs").open("a") as f:
    f.write("x")
Path("{}.mark").touch()
for _ in range(600):
    if Path("{}.mark").exists():
        break
    time.sleep(0.1)
else:
    raise TimeoutError("the other chapter did not run beside this one")"""


def test_two_chapters_run_side_by_side_each_once(book):
    toc = "format: jb-book\nroot: index\nchapters: [{file: one}, {file: two}]\n"
    (book / "_toc.yml").write_text(toc)
    write(book, MEET.format("one", "two"))
    (book / "one.ipynb").rename(book / "two.ipynb")
    write(book, MEET.format("two", "one"))
    result = build(book, "-W", "--keep-going")
    assert result.returncode == 0, result.stderr
    assert runs(book) == 2


def test_stored_outputs_are_rendered_without_executing(book):
    assert build(book, execute="off").returncode == 0
    assert runs(book) == 0


def test_the_run_time_is_recorded_and_shown(book):
    (book / "_build/runtimes.json").unlink(missing_ok=True)
    assert build(book).returncode == 0
    assert (book / "_build/runtimes.json").exists()
    assert "not measured" not in (book / "_build/html/one.html").read_text()


def test_a_failing_notebook_fails_a_plain_build_every_time(book):
    write(book, "1 / 0")
    assert [build(book).returncode != 0 for _ in range(2)] == [True, True]


def test_what_comes_from_a_network_fails_the_build_every_time(book):
    remote = [
        '<script src="https://example.org/a.js"></script>',
        '<link rel="stylesheet" href="//example.org/b.css">',
        '<img alt="x" src="http://example.org/c.png">',
        "<div style=\"background: url('https://example.org/d.png')\"></div>",
    ]
    write(book, COUNTER, "# One\n\n" + "\n\n".join(remote) + "\n")
    for _ in range(2):
        result = build(book, "-W", "--keep-going")
        assert result.returncode != 0
        for address in ("//example.org/" + name for name in ("a.js", "b.css", "c.png", "d.png")):
            assert f"{address} from a network" in result.stderr
