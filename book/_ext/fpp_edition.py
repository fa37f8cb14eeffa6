"""The learner's edition: of each page a notebook that reads well in JupyterLab and on GitHub.

The one source of a chapter is MyST Markdown in a notebook, which Sphinx renders. What has a number
or a name on the page (figures, equations, exercises, citations, glued results) has it here, too, in
plain Markdown; captions stand under their figures, hints and solutions are folded.

Why not the extension jupyterlab-myst (2.7.0), which renders MyST in JupyterLab? Measured on chapter
3: glued numbers show as their names ("ch3-gamma-3 rad"), references to figures stay unresolved and
all captions are missing, since both live in the metadata of cells; equations and exercises are
counted without their chapter, "(10)" for (3.10); {time} and included code do not work, solutions
stand open; and each reader, Binder and GitHub would need it. It does work without a network.

After each build the editions lie in ``_build/editions`` and, to be downloaded, under the pages.
"""

import hashlib
import json
import re
import sys
from pathlib import Path
from urllib.parse import urlsplit

import fpp_copies
import nbformat
import plain_markdown
from plain_markdown import Page, executed, has_edition, leftovers

from fpputil.files import write_whole

EDITIONS = "_build/editions"
DOWNLOADS = "_editions"  # under the pages
GATES = ("exercise-start", "exercise-end", "solution-start", "solution-end")
BINDER, COLAB = "https://mybinder.org", "https://colab.research.google.com"
PUBLISHED = "gh-pages"  # the branch to which `ghp-import -n -p -f _build/html` brings the pages


# --- notebooks -----------------------------------------------------------------------------


def gated(md, source: str):
    """Cut a cell at the fences of exercises and solutions: (gate or "", text or label)."""
    lines, done = source.split("\n"), 0
    for token in md.parse(source):
        if token.type != "fence" or token.level or not token.info.startswith("{"):
            continue
        name, rest = re.match(r"\{([^}]+)\}(.*)", token.info).groups()
        if name in GATES:
            label = re.search(r"^:label: (\S+)", token.content, re.MULTILINE)
            yield "", "\n".join(lines[done : token.map[0]])
            yield name, label[1] if label else rest.strip()
            done = token.map[1]
    yield "", "\n".join(lines[done:])


def edition(app, docname: str) -> nbformat.NotebookNode:
    """The edition of one page."""
    page, cells = Page(app, docname), []
    file = Path(app.env.doc2path(docname))
    if file.suffix == ".ipynb":
        notebook = nbformat.read(executed(app, docname), as_version=4)
    else:
        text = nbformat.v4.new_markdown_cell(file.read_text(encoding="utf-8"), id="page")
        notebook = nbformat.v4.new_notebook(cells=[text])
    for cell in notebook.cells:
        cells += code(page, cell, cells) if cell.cell_type == "code" else prose(page, cell)
    cells[1:1] = start(app, docname, cells)
    if page.cited:
        cells.append(markdown(page.references(), "references"))
    for cell in cells:
        if cell.cell_type == "markdown":
            for found in leftovers(page.md, cell.source):
                page.warn("raw markup in cell %s: %s", cell.id, found)
    if page.headings:
        page.warn("%d headings of the page are missing", len(page.headings))
    notebook.cells = cells
    source = file.relative_to(app.srcdir).as_posix()
    made_with = b"".join(
        Path(made_by).read_bytes() for made_by in (file, __file__, plain_markdown.__file__)
    )
    notebook.metadata["fpp_edition"] = {
        "made_from": source,
        "sha256": hashlib.sha256(made_with).hexdigest(),
        "typed": fpp_copies.typed(notebook),
    }
    notebook.nbformat_minor = max(notebook.nbformat_minor, 5)
    return notebook


def markdown(text: str, id: str, **metadata):
    return nbformat.v4.new_markdown_cell(text, id=id[:64], metadata=metadata)


def prose(page: Page, cell) -> list:
    cells = []
    for n, (gate, text) in enumerate(gated(page.md, cell.source)):
        if gate == "exercise-start":
            page.exercise = page.numbered(text)[1]
            cells.append(markdown(f"### {page.exercise}", f"{cell.id}-{n}-exercise"))
        elif gate == "exercise-end":
            answer = f"# Your answer to {page.exercise.lower()}"
            cells.append(nbformat.v4.new_code_cell(answer, id=f"{cell.id}-{n}-answer"[:64]))
            page.exercise = ""
        elif gate == "solution-start":
            title = f"#### Solution to {page.numbered(text)[1].lower()}"
            fold = {"jp-MarkdownHeadingCollapsed": True}
            cells.append(markdown(title, f"{cell.id}-{n}-solution", **fold))
        elif not gate and (text := page.plain(text)):
            if cells and cells[-1].cell_type == "markdown" and page.exercise:
                cells[-1].source += "\n\n" + text  # the question stands under its title
            else:
                cells.append(markdown(text, f"{cell.id}-{n}" if n else cell.id))
            if page.attached:
                cells[-1].attachments = page.attached
                page.attached = {}
    return cells


def code(page: Page, cell, before: list) -> list:
    tags = set(cell.metadata.get("tags", []))
    figure = cell.metadata.pop("mystnb", {}).get("figure", {})
    if tags & {"hide-input", "remove-input", "hide-cell", "remove-cell"}:
        cell.metadata["jupyter"] = {"source_hidden": True}
    if tags & {"hide-output", "hide-cell"}:
        cell.metadata.setdefault("jupyter", {})["outputs_hidden"] = True
    if tags & {"remove-output", "remove-cell"}:
        cell.outputs = []
    place = re.search(r'instead_of="([\w-]+)"', cell.source)
    if place and before and before[-1].metadata.get("caption_of") == place[1]:
        before.insert(-1, cell)  # a caption stands under the figure to play with, too
        return []
    if not figure.get("caption"):
        return [cell]
    name = figure.get("name", "")
    number = f"**{page.numbered(name)[1]}.** " if name else ""
    caption = number + page.plain(figure["caption"])
    return [cell, markdown(caption, f"{cell.id}-caption", caption_of=name)]


NOTE = """\
> **To run this notebook**, HOW your copy of the chapters.
>
> Numbers in the text are those of the book; when you change something, yours stand in the outputs.
"""
NEEDS = """\
# What this notebook needs, and what to do when it is missing.
import sys
from importlib.util import find_spec
from pathlib import Path

%xmode Minimal
needed = PACKAGES
if missing := [name for name in needed if find_spec(name) is None]:
    raise ModuleNotFoundError(
        f"this Python, {sys.executable}, has no {', '.join(missing)}. To run this notebook, "
        "HOW the chapters."
    )
"""
NEEDS_DATA = """\
if not Path("../data").is_dir():
    raise FileNotFoundError(
        f"this notebook reads the data of the book, and {Path.cwd().parent} has no folder data. "
        "To run it, HOW the chapters where the data are."
    )
"""
ON_COLAB = """\
if "google.colab" in sys.modules and not Path("../chapters").is_dir():
    !git clone --depth 1 URL && pip install -q "./FOLDER[learning]" myst-nb
    %cd FOLDER/chapters
"""


def start(app, docname: str, cells: list) -> list:
    """Say how to run the notebook, and check that all it needs is there."""
    source = "\n".join(cell.source for cell in cells if cell.cell_type == "code")
    if not source:
        return []
    url = repository(app)
    how = f"get the book, `git clone {url}`, and type" if url else "type"
    how += " `make lab` in the folder of the book; it installs what is missing and opens"
    head, check = NEEDS.split("%xmode")
    if urlsplit(url).hostname == "github.com":
        head += ON_COLAB.replace("URL", url).replace("FOLDER", url.rsplit("/", 1)[-1])
    check = head + "%xmode" + check
    if re.search(r"""["']\.\./""", source):
        check += NEEDS_DATA
    packages = [*imported(source), *(["myst_nb"] if "fpputil.notebook" in source else [])]
    check = check.replace("PACKAGES", json.dumps(packages)).replace("HOW", how.replace("`", ""))
    cell = nbformat.v4.new_code_cell(check.strip(), id="setup-check")
    cell.metadata["jupyter"] = {"source_hidden": True}
    return [markdown(NOTE.replace("HOW", how).strip(), "setup-note"), cell]


def imported(source: str) -> list[str]:
    """Packages outside Python's own that the code imports; fpputil first."""
    names = re.findall(r"^(?:import (\w+)|from (\w+)[\w.]* import)", source, re.MULTILINE)
    names = {a or b for a, b in names} - sys.stdlib_module_names
    return sorted(names, key=lambda name: (name != "fpputil", name))


# --- the build -----------------------------------------------------------------------------


def write_editions(app, exception):
    if exception is not None or app.builder.name != "html":  # the one-page book has other numbers
        return
    pages = sorted(name for name in app.env.found_docs if has_edition(app.env, name))
    made = {Path(page).name + ".ipynb": nbformat.writes(edition(app, page)) for page in pages}
    for folder in (Path(app.srcdir, EDITIONS), Path(app.outdir, DOWNLOADS)):
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("*.ipynb"):
            if old.name not in made:
                old.unlink()
        for name, text in made.items():
            write_whole(folder / name, text.encode())


def repository(app) -> str:
    return (app.config.html_theme_options.get("repository_url") or "").rstrip("/")


def offer_repository(app, config):
    """One address in _config.yml, and the pages have the buttons that need one."""
    url = repository(app)
    if not url:
        return
    options = config.html_theme_options
    options |= {"use_repository_button": True, "use_issues_button": True}
    launch = options.setdefault("launch_buttons", {})
    launch["binderhub_url"] = BINDER
    if urlsplit(url).hostname == "github.com":
        launch["colab_url"] = COLAB


def lead_to_editions(app, pagename, templatename, context, doctree):
    """Buttons that hand over a notebook hand over the edition."""
    if not has_edition(app.env, pagename):
        return
    name = Path(pagename).name + ".ipynb"
    buttons = [b for g in context.get("header_buttons", []) for b in g.get("buttons", [])]
    for button in buttons:
        if button.get("label") == "download-source-button":
            button["url"] = f"{context['pathto'](DOWNLOADS, 1)}/{name}"
            button |= {"text": ".ipynb", "tooltip": "Download this page as a notebook"}
        elif button.get("text") == "Binder":  # postBuild makes the copies
            button["url"] = re.sub(r"/tree/.*", f"/tree/my-chapters/{name}", button["url"])
        elif button.get("text") == "Colab":
            there = f"/blob/{PUBLISHED}/{DOWNLOADS}/{name}"
            button["url"] = re.sub(r"/blob/.*", there, button["url"])


def setup(app):
    app.connect("config-inited", offer_repository)
    app.connect("html-page-context", lead_to_editions, priority=950)
    app.connect("build-finished", write_editions)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
