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

import ast
import hashlib
import json
import mimetypes
import re
import sys
from base64 import b64encode
from pathlib import Path
from urllib.parse import quote, urlsplit

import fpp_book
import fpp_copies
import nbformat
from docutils import nodes
from docutils.parsers.rst import directives
from docutils.parsers.rst.languages import en
from docutils.utils import new_document
from markdown_it.renderer import RendererHTML
from myst_parser.parsers.directives import parse_directive_text
from myst_parser.parsers.mdit import create_md_parser
from sphinx.directives.code import LiteralIncludeReader
from sphinx.util import logging

LOGGER = logging.getLogger(__name__)
EDITIONS = "_build/editions"
DOWNLOADS = "_editions"  # under the pages
# Pages that Sphinx makes of the library, the literature and the chapters: they have no edition.
PAGES_ALONE = {"book/api", "book/bibliography", "book/execution", "book/gallery"}
ADMONITIONS = {"attention", "caution", "danger", "error", "hint", "important", "note", "seealso"}
ADMONITIONS |= {"admonition", "tip", "warning"}
GATES = ("exercise-start", "exercise-end", "solution-start", "solution-end")
BINDER, COLAB = "https://mybinder.org", "https://colab.research.google.com"
PUBLISHED = "gh-pages"  # the branch to which `ghp-import -n -p -f _build/html` brings the pages


# --- Markdown ------------------------------------------------------------------------------


def parser(config):
    """MyST's own parser, whose inline tokens know the text they were made from."""
    md = create_md_parser(config, RendererHTML)

    def located(rule):
        def wrapped(state, silent):
            start, count = state.pos, len(state.tokens)
            found = rule(state, silent)
            if found and not silent:
                # The text before it becomes a token of its own at this moment.
                made = (t for t in state.tokens[count:] if t.type != "text")
                if token := next(made, None):
                    token.meta["raw"] = state.src[start : state.pos]
            return found

        return wrapped

    for rule in list(md.inline.ruler.__rules__):
        if rule.name in {"backticks", "image", "link", "myst_role"}:
            md.inline.ruler.at(rule.name, located(rule.fn))
    return md


def leftovers(md, text: str) -> list[str]:
    """What a reader of plain Markdown would see as raw markup."""
    found = []
    for token in md.parse(text):
        for t in [token, *(token.children or [])]:
            if t.type.startswith(("myst_", "substitution_", "dl_", "footnote_", "colon_fence")):
                found.append(t.content or t.info or t.type)
            elif t.type == "math_block_label" or t.type == "fence" and t.info.startswith("{"):
                found.append(t.info)
            elif t.type != "fence" and {"class", "id"} & set(t.attrs):
                found.append(str(t.attrs))
    return found


def dotted(numbers) -> str:
    return ".".join(map(str, numbers))


def heading_number(numbers) -> str:
    return dotted(numbers) + ". " if numbers else ""


class Page:
    """What the markup of one page stands for, in the book that was just built."""

    def __init__(self, app, docname: str):
        self.app, self.env, self.docname = app, app.env, docname
        self.md = parser(app.env.myst_config)
        self.cited, self.attached = {}, {}
        self.exercise = ""  # the one whose text is being read
        self.headings = list(app.env.toc_secnumbers.get(docname, {}).values())

    def warn(self, text: str, *given):
        LOGGER.warning("edition: " + text, *given, location=self.docname)

    def plain(self, source: str) -> str:
        """MyST Markdown as plain Markdown."""
        starts = [0]
        for line in source.splitlines(keepends=True):
            starts.append(starts[-1] + len(line))
        edits, cursor = [], 0
        tokens = self.md.parse(source)
        for token in tokens:
            if token.map is None:
                continue
            start, end = starts[token.map[0]], starts[min(token.map[1], len(starts) - 1)]
            if token.type in {"fence", "colon_fence"} and token.info.startswith("{"):
                indent = re.match(r"\s*", source[start:end])[0]
                text = self.directive(token).replace("\n", "\n" + indent)
                edits.append((start, end, indent + text + "\n"))
            elif token.type == "math_block_label":
                text = formula(token.content, self.equation(token.info))
                edits.append((start, end, text + "\n"))
            elif token.type in {"myst_target", "myst_line_comment", "myst_block_break"}:
                edits.append((start, end, ""))
            elif token.type == "heading_open" and token.markup.startswith("#"):
                number = self.headings.pop(0) if self.headings else None
                at = source.index(token.markup, start) + len(token.markup) + 1
                edits.append((at, at, heading_number(number)))
            elif token.type == "inline":
                cursor = max(cursor, start)
                cursor = self.inline(source, token.children, cursor, end, edits)
        for start, end, text in sorted(edits, key=lambda edit: edit[0], reverse=True):
            source = source[:start] + text + source[end:]
        return source.strip("\n")

    def inline(self, source, tokens, cursor, end, edits) -> int:
        """Add edits (start, end, text) of the inline markup; return where it ends."""
        for token in tokens:
            raw = token.meta.get("raw")
            at = source.find(raw, cursor, end) if raw else -1
            if at < 0:
                continue  # what is not found is left as it is, and reported as a leftover
            cursor = at + (1 if token.type == "link_open" else len(raw))
            if token.type == "myst_role":
                edits.append((at, at + len(raw), self.role(token.meta["name"], token.content)))
            elif token.type == "image":
                edits.append((at, at + len(raw), self.picture(token.content, token.attrs["src"])))
            elif token.type == "link_open" and not urlsplit(token.attrs["href"]).scheme:
                title, target = self.link(token.attrs["href"])
                opened, closed = ("", "") if target is None else ("[", f"]({target})")
                middle = raw.rfind("](")  # the text before it may hold roles, too
                if middle == 1:  # no text: the title of the page
                    edits.append((at, at + len(raw), f"{opened}{title}{closed}"))
                elif middle > 1:
                    edits.append((at, at + 1, opened))
                    edits.append((at + middle, at + len(raw), closed))
        return cursor

    # --- references ---

    def resolved(self, target: str) -> str:
        """The page that a path or a docname, as seen from here, names."""
        return (
            self.env.relfn2path(target, self.docname)[0].removesuffix(".ipynb").removesuffix(".md")
        )

    def link(self, href: str) -> tuple[str, str | None]:
        """Title and address of what is linked to; None for a page without an edition."""
        path, _, _ = href.partition("#")
        if not path:
            return href, href
        page = self.resolved(path)
        if page not in self.env.titles:
            self.warn("%s is linked to and is no page", href)
            return href, None
        title = self.env.titles[page].astext()
        return title, Path(page).name + ".ipynb" if has_edition(self.env, page) else None

    def linked(self, page: str, text: str) -> str:
        _, target = self.link("/" + page)
        return f"[{text}]({target})" if target and page != self.docname else text

    def equation(self, label: str) -> str:
        page, _ = self.env.domaindata["math"]["objects"].get(label, ("", 0))
        numbers = self.env.toc_fignumbers.get(page, {}).get("displaymath", {})
        if f"equation-{label}" not in numbers:
            self.warn("the equation %s has no number", label)
        return dotted(numbers.get(f"equation-{label}", "?"))

    def numbered(self, label: str) -> tuple[str, str]:
        """The page of a figure, table or exercise, and its name with its number."""
        page, where = self.env.domaindata["std"]["anonlabels"].get(label, ("", ""))[:2]
        for kind, numbers in self.env.toc_fignumbers.get(page, {}).items():
            if where in numbers and kind in self.app.config.numfig_format:
                return page, self.app.config.numfig_format[kind] % dotted(numbers[where])
        self.warn("%s has no number", label)
        return self.docname, label

    def glued(self, text: str) -> str:
        document, _, key = text.rpartition("::")
        key, _, form = key.partition(":")
        page = self.resolved(document) if document else self.docname
        file = executed(self.app, page).with_suffix(".glue.json")
        data = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
        if key not in data:
            self.warn("nothing is glued as %s", key)
            return key
        return format(ast.literal_eval(data[key]["data"]["text/plain"]), form)

    # --- roles ---

    def role(self, name: str, content: str) -> str:
        explicit = re.fullmatch(r"(.*?)\s*<([^<>]*)>", content, re.DOTALL)
        text, target = explicit.groups() if explicit else ("", content)
        if name.startswith("py:"):
            return f"`{(text or target).removeprefix('~')}`"
        if name in ROLES:
            return ROLES[name](self, text, target)
        self.warn("the role {%s} is not known to the editions", name)
        return f"`{content}`"

    def role_numref(self, text: str, label: str) -> str:
        page, name = self.numbered(label)
        number = name.split()[-1]
        return self.linked(page, text.replace("%s", number).format(number=number) or name)

    def role_ref(self, text: str, label: str) -> str:
        if label not in self.env.domaindata["std"]["labels"]:
            return self.linked(*self.numbered(label))
        page, _, title = self.env.domaindata["std"]["labels"][label]
        file = "" if page == self.docname else Path(page).name + ".ipynb"
        return f"[{text or title}]({file}#{self.anchor(page, title)})"

    def role_doc(self, text: str, target: str) -> str:
        title, _ = self.link(target)
        return self.linked(self.resolved(target), text or title)

    def role_term(self, text: str, term: str) -> str:
        objects = self.env.domaindata["std"]["objects"]
        pages = {
            name.lower(): page for (kind, name), (page, _) in objects.items() if kind == "term"
        }
        return self.linked(pages.get(term.lower(), self.docname), text or term)

    def role_time(self, text: str, which: str) -> str:
        if which == "read":
            return fpp_book.reading_time(Path(self.env.doc2path(self.docname)))
        times = fpp_book.read_runtimes(Path(self.app.srcdir))
        return fpp_book.running_time(times.get(self.docname))

    def anchor(self, page: str, title: str) -> str:
        """Where JupyterLab and GitHub jump to: the words of a heading with its number."""
        numbers = self.env.toc_secnumbers.get(page, {}).get("#" + nodes.make_id(title))
        return (heading_number(numbers) + title).replace(" ", "-")

    def citation(self, keys: str) -> str:
        known = {c.key: c.formatted_entry for c in self.env.domaindata["cite"]["citations"]}
        labels = []
        for key in (key.strip() for key in keys.split(",")):
            if key not in known:
                self.warn("%s is cited and not in the bibliography", key)
                continue
            entry = known[key]
            self.cited[entry.label] = " ".join(entry.text.render_as("markdown").split())
            labels.append(entry.label)
        return f"[{', '.join(labels)}]"

    def references(self) -> str:
        by_number = sorted(self.cited.items(), key=lambda item: (len(item[0]), item[0]))
        return "## References\n\n" + "\n\n".join(f"[{label}] {text}" for label, text in by_number)

    # --- directives ---

    def directive(self, token) -> str:
        name, rest = re.match(r"\{([^}]+)\}(.*)", token.info, re.DOTALL).groups()
        kind, _ = directives.directive(name, en, new_document(""))
        kind = kind or self.env.domains["std"].directives.get(name)
        if kind is None or name not in DIRECTIVES:
            self.warn("the directive {%s} is not known to the editions", name)
            return token.content
        parsed = parse_directive_text(kind, rest.strip(), token.content)
        options = parsed.options | {"directive": name}
        return DIRECTIVES[name](self, " ".join(parsed.arguments), options, "\n".join(parsed.body))

    def only_body(self, argument: str, options: dict, body: str) -> str:
        return self.plain(body)

    def admonition(self, title: str, options: dict, body: str) -> str:
        title = self.plain(title) or options["directive"].capitalize()
        if "dropdown" in {options["directive"], *options.get("class", [])}:
            return folded(title, self.plain(body))
        return quoted(f"**{title}**\n\n{self.plain(body)}")

    def card(self, title: str, options: dict, body: str) -> str:
        title = f"**{self.plain(title)}**"
        if options.get("link-type") == "doc":
            title = self.linked(self.resolved(options["link"]), title)
        return f"{title}\n\n{self.plain(body)}"

    def figure(self, path: str, options: dict, body: str) -> str:
        shown = self.picture(options.get("alt", ""), path)
        number = f"**{self.numbered(options['name'])[1]}.** " if "name" in options else ""
        return f"{shown}\n\n{number}{self.plain(body)}".strip()

    def code_block(self, language: str, options: dict, body: str) -> str:
        return f"```{language}\n{body}\n```"

    def formula(self, argument: str, options: dict, body: str) -> str:
        return formula(body, self.equation(options["label"]) if "label" in options else "")

    def glossary(self, argument: str, options: dict, body: str) -> str:
        entries = re.findall(r"^(\S.*)\n((?:[ \t]+\S.*\n?|\n(?=[ \t]))+)", body, re.MULTILINE)
        entries = [f"**{term}**: {' '.join(text.split())}" for term, text in entries]
        return self.plain("\n\n".join(entries))

    def included(self, path: str, options: dict, body: str) -> str:
        file = self.env.relfn2path(path, self.docname)[1]
        text, _ = LiteralIncludeReader(file, options, self.app.config).read()
        return f"```{options.get('language', 'python')}\n{text.rstrip()}\n```"

    def picture(self, alt: str, path: str) -> str:
        """A picture travels in the notebook."""
        if urlsplit(path).scheme:
            return f"![{alt}]({path})"
        file = Path(self.env.relfn2path(path, self.docname)[1])
        kind = mimetypes.guess_type(file.name)[0] or "image/png"
        self.attached[file.name] = {kind: b64encode(file.read_bytes()).decode()}
        return f"![{alt}](attachment:{quote(file.name)})"


ROLES = {
    "cite": lambda page, text, keys: page.citation(keys),
    "doc": Page.role_doc,
    "eq": lambda page, text, label: f"({page.equation(label)})",
    "glue:text": lambda page, text, key: page.glued(key),
    "math": lambda page, text, formula: f"${formula}$",
    "numref": Page.role_numref,
    "ref": Page.role_ref,
    "term": Page.role_term,
    "time": Page.role_time,
}
DIRECTIVES = {
    "code-block": Page.code_block,
    "dropdown": Page.admonition,
    "figure": Page.figure,
    "glossary": Page.glossary,
    "grid": Page.only_body,
    "grid-item-card": Page.card,
    "image": Page.figure,
    "literalinclude": Page.included,
    "math": Page.formula,
} | dict.fromkeys(ADMONITIONS, Page.admonition)


def formula(tex: str, number: str) -> str:
    tag = rf" \tag{{{number}}}" if number else ""
    return f"$$\n{tex.strip()}{tag}\n$$"


def quoted(text: str) -> str:
    return "\n".join("> " + line if line else ">" for line in text.split("\n"))


def folded(title: str, text: str) -> str:
    return f"<details><summary><strong>{title}</strong></summary>\n\n{text}\n\n</details>"


# --- notebooks -----------------------------------------------------------------------------


def executed(app, docname: str) -> Path:
    """The notebook with the outputs of the build, or with those stored if it executes nothing."""
    return Path(app.outdir).parent / "jupyter_execute" / f"{docname}.ipynb"


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
    made_with = file.read_bytes() + Path(__file__).read_bytes()
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


def has_edition(env, docname: str) -> bool:
    return docname in env.titles and docname not in PAGES_ALONE


def write_editions(app, exception):
    if exception is not None or app.builder.format != "html":
        return
    pages = sorted(name for name in app.env.found_docs if has_edition(app.env, name))
    made = {Path(page).name + ".ipynb": nbformat.writes(edition(app, page)) for page in pages}
    for folder in (Path(app.srcdir, EDITIONS), Path(app.outdir, DOWNLOADS)):
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("*.ipynb"):
            if old.name not in made:
                old.unlink()
        for name, text in made.items():
            fpp_copies.write(folder / name, text)


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
