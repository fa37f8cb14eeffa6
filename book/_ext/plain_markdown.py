"""MyST Markdown of a page of this book as the plain Markdown of JupyterLab and GitHub.

Numbers, names and texts that Sphinx knows after a build are filled in. A new role or directive
takes one line in `ROLES` or `DIRECTIVES`.
"""

import ast
import json
import mimetypes
import re
from base64 import b64encode
from pathlib import Path
from urllib.parse import quote, urlsplit

import fpp_book
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
# Pages that Sphinx makes of the library, the literature and the chapters: they have no edition.
PAGES_ALONE = {"book/api", "book/bibliography", "book/execution", "book/gallery"}
ADMONITIONS = {"attention", "caution", "danger", "error", "hint", "important", "note", "seealso"}
ADMONITIONS |= {"admonition", "tip", "warning"}


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


def executed(app, docname: str) -> Path:
    """The notebook with the outputs of the build, or with those stored if it executes nothing."""
    return Path(app.outdir).parent / "jupyter_execute" / f"{docname}.ipynb"


def has_edition(env, docname: str) -> bool:
    return docname in env.titles and docname not in PAGES_ALONE
