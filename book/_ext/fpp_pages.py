"""What makes the pages pleasant to read.

- Terms: the first use of each glossary term in a chapter leads to the glossary.
- One page: what the PDF is printed from.
- Gallery: `` ```{gallery} `` shows all numbered figures, each as a link to the cell that makes it.
"""

import html
import re

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

GLOSSARY = "book/glossary"
GALLERY = "book/gallery"

# --- terms ---------------------------------------------------------------------------------

# Words that also mean something else: how each is written where it is the term. None: it has too
# many other meanings.
COUNTS = ("number of", "N", "three", "four", "five", "eight", "fifteen", "15")
PATTERNS = {
    "Average": r"(?<!on )[Aa]verage",
    "Clipping": None,
    "Guard": r"(?<=the )guard",
    "Rival": r"[Rr]ivals",
    "Room": r"(?<!in the )(?<!no )(?<!have )room(?! behind)",
    "Run": None,
    "Shade": r"(?<!and )shade",
    "Split": "|".join(f"(?<={word} )split" for word in ("the", "its", "training", "held-out")),
    "Step": "|".join(f"(?<={count} )(?<!takes four )steps" for count in COUNTS),
    "View": r"(?<!leaves the )(?<!field of )views?",
    "Wave": r"(?<!carrier )(?<!square )waves?",
}
NOT_READ_ON = (nodes.Admonition, nodes.figure, nodes.table, nodes.container, nodes.footnote)


def definitions(env) -> dict[str, tuple[str, nodes.definition]]:
    """Of each term of the glossary its anchor and its definition."""
    items = env.get_doctree(GLOSSARY).findall(nodes.definition_list_item)
    pairs = [(next(i.findall(nodes.term)), next(i.findall(nodes.definition))) for i in items]
    return {term.astext().strip(): (term["ids"][0], meaning) for term, meaning in pairs}


def pattern(term: str) -> str | None:
    plain = re.escape(term).replace(r"\ ", r"\s+")
    if not term.isupper():
        end = "(?:y|ies)" if term.endswith("y") else f"{plain[-1]}s?"
        plain = f"[{term[0].upper()}{term[0].lower()}]{plain[1:-1]}{end}"
    return PATTERNS.get(term, plain)


def finder(terms) -> re.Pattern:
    """Finds terms, the longer before the shorter; which one says the number of the group."""
    named = {number: pattern(term) for number, term in enumerate(terms)}
    named = {number: p for number, p in named.items() if p}
    order = sorted(named, key=lambda number: -len(terms[number]))
    either = "|".join(rf"(?P<t{number}>{named[number]})" for number in order)
    return re.compile(rf"(?<![-\w])(?:{either})(?![-\w])")


def is_prose(text: nodes.Text) -> bool:
    """Whether it stands in a plain paragraph or list item of a section of a chapter."""
    parent = text.parent.parent if isinstance(text.parent, nodes.emphasis) else text.parent
    if not isinstance(parent, nodes.paragraph):
        return False
    around = []
    while parent := parent.parent:
        around.append(parent)
    sections = sum(isinstance(node, nodes.section) for node in around)
    return sections > 1 and not any(isinstance(node, NOT_READ_ON) for node in around)


def link_terms(doctree, terms: list[str], link) -> None:
    """Put ``link(term, words)`` in place of the first use of each term."""
    find, seen = finder(terms), set()
    for text in [t for t in doctree.findall(nodes.Text) if is_prose(t)]:
        parts, end = [], 0
        for match in find.finditer(text):
            term = terms[int(match.lastgroup[1:])]
            if term not in seen:
                seen.add(term)
                parts += [nodes.Text(text[end : match.start()]), link(term, match.group())]
                end = match.end()
        if parts:
            text.parent.replace(text, [*parts, nodes.Text(text[end:])])


def explain_terms(app, doctree, docname):
    if not docname.startswith("chapters/") or GLOSSARY not in app.env.found_docs:
        return
    meanings = definitions(app.env)
    page = app.builder.get_relative_uri(docname, GLOSSARY)

    def link(term, words):
        where = {"internal": True, "refuri": f"{page}#{meanings[term][0]}"}
        return nodes.reference("", words, classes=["fpp-term"], **where)

    link_terms(doctree, list(meanings), link)
    app.env.get_domain("math").data["has_equations"][docname] = True  # a definition may have some


def add_definitions(app, pagename, templatename, context, doctree):
    """Give each page the definitions of the terms that it links to, for pages.js to show."""
    if doctree is None or not pagename.startswith("chapters/"):
        return
    links = [link for link in doctree.findall(nodes.reference) if "fpp-term" in link["classes"]]
    wanted = {link["refuri"].partition("#")[2] for link in links}
    for anchor, meaning in definitions(app.env).values():
        if anchor in wanted:
            tip = f'<div class="fpp-tip" role="tooltip" id="tip-{anchor}" hidden>'
            context["body"] += tip + rendered(app, meaning) + "</div>"


def rendered(app, node: nodes.Element) -> str:
    """The HTML of what a node holds, its links as plain text."""
    copy = nodes.container("", *node.deepcopy().children)
    for link in list(copy.findall(lambda n: n.tagname in ("pending_xref", "reference"))):
        link.replace_self(nodes.inline("", link.astext()))
    return "".join(app.builder.render_partial(child)["fragment"] for child in copy.children)


# --- gallery -------------------------------------------------------------------------------


class Gallery(nodes.General, nodes.Element):
    """Stands for all figures until all chapters were read."""


class GalleryDirective(SphinxDirective):
    """``{gallery}``: all numbered figures of the book, small."""

    def run(self):
        return [Gallery()]


def mark_cells(app, doctree):
    """Give each cell that makes a figure an address: NAME-cell."""
    for figure in list(doctree.findall(nodes.figure)):
        cell = figure
        while cell is not None and "cell" not in cell.get("classes", ()):
            cell = cell.parent
        if cell is not None and figure["ids"]:
            where = cell.parent.index(cell)
            cell.parent.insert(where, nodes.target(ids=[f"{figure['ids'][0]}-cell"]))


def fill_gallery(app, doctree, docname):
    for node in list(doctree.findall(Gallery)):
        app.env.get_domain("math").data["has_equations"][docname] = True
        node.replace_self(nodes.raw("", "".join(chapters_in_small(app, docname)), format="html"))


def chapters_in_small(app, docname):
    numbers = {name: kinds.get("figure", {}) for name, kinds in app.env.toc_fignumbers.items()}
    for name in sorted(filter(numbers.get, numbers), key=lambda n: min(numbers[n].values())):
        chapter, page = app.env.get_doctree(name), app.builder.get_relative_uri(docname, name)
        figures = {i: figure for figure in chapter.findall(nodes.figure) for i in figure["ids"]}
        live = "".join(raw.astext() for raw in chapter.findall(nodes.raw))
        number = min(numbers[name].values())
        title = html.escape(app.env.titles[name].astext())
        yield f"<h2>{f'{number[0]}. ' if len(number) > 1 else ''}{title}</h2>"
        yield '<div class="fpp-gallery">'
        for anchor, number in sorted(numbers[name].items(), key=lambda pair: pair[1]):
            plays = f'data-instead-of="{anchor}"' in live
            yield in_small(app, figures[anchor], ".".join(map(str, number)), page, plays)
        yield "</div>"


def in_small(app, figure, number, page, plays) -> str:
    image = next(figure.findall(nodes.image))
    uri = image["candidates"].get("*", image["uri"])
    source = f"{app.builder.imgpath}/{app.env.images[uri][1]}"
    caption = rendered(app, first_sentence(next(figure.findall(nodes.caption))))
    return (
        f'<a class="fpp-thumb" href="{page}#{figure["ids"][0]}-cell">'
        f'<img loading="lazy" src="{source}" alt="{html.escape(image.get("alt", ""))}">'
        f"<span><b>Fig. {number}</b> {caption}{' <i>To play with.</i>' if plays else ''}</span></a>"
    )


def first_sentence(caption: nodes.caption) -> nodes.caption:
    short = nodes.caption()
    for child in caption.children:
        sentence, end, _ = child.astext().partition(". ")
        if isinstance(child, nodes.Text) and end:
            short += nodes.Text(sentence + ".")
            break
        short += child.deepcopy()
    return short


# --- one page ------------------------------------------------------------------------------


def draw_as_html(app):
    """Let the one-page book, which is printed, draw every node as the many pages do."""
    drawn = app.registry.translation_handlers
    if "singlehtml" in drawn:
        drawn["singlehtml"] = drawn["html"] | drawn["singlehtml"]


# --- again ---------------------------------------------------------------------------------


def outdated(app, env, added, changed, removed):
    """Pages that show what stands on others are read again with them."""
    new = added | changed
    chapters = {name for name in env.found_docs if name.startswith("chapters/")}
    again = chapters if GLOSSARY in new else set()
    return [*again, *({GALLERY} & env.found_docs if new else ())]


def setup(app):
    app.add_node(Gallery)
    app.add_directive("gallery", GalleryDirective)
    app.add_js_file("pages.js", loading_method="defer")
    app.connect("builder-inited", draw_as_html)
    app.connect("doctree-read", mark_cells)
    app.connect("doctree-resolved", explain_terms)
    app.connect("doctree-resolved", fill_gallery)
    app.connect("html-page-context", add_definitions)
    app.connect("env-get-outdated", outdated)
    return {"parallel_read_safe": True, "parallel_write_safe": False}
