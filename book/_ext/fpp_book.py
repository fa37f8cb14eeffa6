"""What this book asks of Sphinx beyond the usual.

- Fresh: chapters run again when the notebook, ``src``, ``data`` or the lock changed.
- Honest: ``{time}`run` `` is the time measured by the last build that executed the page.
- Faces first: ``{face} fpputil.optics`` lists what a package offers.
- To play with: pages that have a figure of `fpputil.interactive` load its script once.
- Offline: a rendered page that would load anything from a network is a warning.
"""

import hashlib
import importlib
import inspect
import json
import os
import re
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from html.parser import HTMLParser
from pathlib import Path

from docutils import nodes
from docutils.statemachine import StringList
from jupyter_cache import get_cache
from jupyter_cache.executors import load_executor
from myst_nb.sphinx_ import NbMetadataCollector
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective, SphinxRole

from fpputil.files import write_whole
from fpputil.interactive import live

LOGGER = logging.getLogger(__name__)
RUNTIMES = "_build/runtimes.json"  # of the last build here; before there is one:
SHIPPED_RUNTIMES = "book/runtimes.json"
WORDS_A_MINUTE = 150  # technical prose, read with the figures
SOURCES = ("src", "data", "requirements.lock")


# --- fresh ---------------------------------------------------------------------------------


def sources_hash(root: Path) -> str:
    """Return a short hash of every file the chapters depend on, names and bytes."""
    digest = hashlib.sha256()
    for source in SOURCES:
        files = sorted((root / source).rglob("*")) if (root / source).is_dir() else [root / source]
        for file in files:
            parts = file.relative_to(root).parts
            if file.is_file() and "__pycache__" not in parts and ".egg-info" not in str(file):
                digest.update("/".join(parts).encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def set_execution(app, config):
    # Part of the configuration: when it changes, Sphinx reads all pages again.
    cache = Path(app.outdir).parent / "execution" / sources_hash(Path(app.srcdir))
    config.nb_execution_cache_path = str(cache)
    if os.environ.get("FPP_EXECUTE", "on") == "off":
        config.nb_execution_mode = "off"


def execute_chapters(app, env, docnames):
    """Execute the chapters that the cache lacks, two at a time; Sphinx takes them from there.

    One that fails is not kept: Sphinx runs it again and tells the error.
    """
    config = app.config
    paths = [Path(env.doc2path(name)) for name in docnames]
    notebooks = [path for path in paths if path.suffix == ".ipynb"]
    if config.nb_execution_mode != "cache" or len(notebooks) < 2:
        return
    times, root = read_runtimes(Path(app.srcdir)), Path(app.srcdir)
    notebooks.sort(key=lambda path: -times.get(str(path.relative_to(root).with_suffix("")), 60))
    cache = get_cache(config.nb_execution_cache_path)
    for path in notebooks:
        cache.add_nb_to_project(str(path))
    execute = partial(execute_chapter, config.nb_execution_cache_path, config.nb_execution_timeout)
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(execute, map(str, notebooks)))


def execute_chapter(cache: str, timeout: int, path: str) -> None:
    """Execute a notebook into a cache, with half of the processor's cores."""
    os.environ.setdefault("OMP_NUM_THREADS", str(max(1, (os.cpu_count() or 1) // 2)))
    executor = load_executor("local-serial", get_cache(cache))
    executor.run_and_cache(filter_uris=[path], timeout=timeout)


# --- honest --------------------------------------------------------------------------------


class RunTime(nodes.Inline, nodes.Element):
    """Stands for the run time of a page until the page was executed."""


class RunTimes(nodes.General, nodes.Element):
    """Stands for the table of all run times."""


class TimeRole(SphinxRole):
    """``{time}`read` `` and ``{time}`run` ``."""

    def run(self):
        if self.text == "run":
            return [RunTime()], []
        if self.text == "read":
            return [nodes.Text(reading_time(Path(self.env.doc2path(self.env.docname))))], []
        LOGGER.warning("{time} takes read or run, not %r", self.text, location=self.get_location())
        return [], []


class RunTimesDirective(SphinxDirective):
    """``{runtimes}``: a table of the measured time of every chapter."""

    def run(self):
        return [RunTimes()]


def reading_time(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = json.loads(text)["cells"]
        text = "\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "markdown")
    return f"{max(1, round(len(text.split()) / WORDS_A_MINUTE))} min"


def running_time(seconds) -> str:
    if seconds is None:
        return "not measured yet"
    return f"{seconds} s" if seconds < 90 else f"{round(seconds / 60)} min"


def rounded(seconds: float) -> int:
    """Whole seconds up to ten, then steps of five, so that the file changes seldom."""
    return max(1, round(seconds)) if seconds < 10 else 5 * round(seconds / 5)


def read_runtimes(root: Path) -> dict:
    for path in (root / RUNTIMES, root / SHIPPED_RUNTIMES):
        if path.exists():
            return json.loads(path.read_text())
    return {}


def record_runtimes(app, env):
    """Write down what this build measured; have the table of times written again."""
    before = read_runtimes(Path(app.srcdir))
    runtimes = {name: seconds for name, seconds in before.items() if name in env.found_docs}
    for docname in env.found_docs:
        measured = NbMetadataCollector.get_exec_data(env, docname)
        if measured and measured["succeeded"] and measured["runtime"] is not None:
            runtimes[docname] = rounded(measured["runtime"])
    if runtimes != before:
        path = Path(app.srcdir, RUNTIMES)
        path.parent.mkdir(exist_ok=True)
        write_whole(path, (json.dumps(runtimes, indent=2, sort_keys=True) + "\n").encode())
    return [name for name in env.found_docs if name == "book/execution"]


def fill_in_times(app, doctree, docname):
    runtimes = read_runtimes(Path(app.srcdir))
    for node in list(doctree.findall(RunTime)):
        node.replace_self(nodes.Text(running_time(runtimes.get(docname))))
    for node in list(doctree.findall(RunTimes)):
        node.replace_self(times_table(app, docname, runtimes))


def times_table(app, docname, runtimes):
    rows = (
        [[nodes.Text("Chapter")], [nodes.Text("Time to run")]],
        *(
            [[link_to(app, docname, name)], [nodes.Text(running_time(seconds))]]
            for name, seconds in sorted(runtimes.items())
            if name in app.env.titles
        ),
    )
    group = nodes.tgroup("", *(nodes.colspec(colwidth=50) for _ in range(2)), cols=2)
    built = [
        nodes.row("", *(nodes.entry("", nodes.paragraph("", "", *cell)) for cell in row))
        for row in rows
    ]
    group += [nodes.thead("", built[0]), nodes.tbody("", *built[1:])]
    return nodes.table("", group)


def link_to(app, docname, target):
    uri = app.builder.get_relative_uri(docname, target)
    return nodes.reference("", app.env.titles[target].astext(), refuri=uri, internal=True)


# --- faces ---------------------------------------------------------------------------------


class FaceDirective(SphinxDirective):
    """``{face} fpputil.optics``: the names a package offers, each with its first sentence."""

    required_arguments = 1

    def run(self):
        package = importlib.import_module(self.arguments[0])
        lines = [f"``from {package.__name__} import ...``", "", "| name | |", "|---|---|"]
        lines += [face_row(name, getattr(package, name)) for name in package.__all__]
        node = nodes.container()
        self.state.nested_parse(StringList(lines, source="face"), self.content_offset, node)
        return node.children


def face_row(name: str, thing) -> str:
    if inspect.ismodule(thing):
        return f"| {{py:mod}}`{name} <{thing.__name__}>` | {first_sentence(thing)} |"
    if inspect.isclass(thing) or inspect.isfunction(thing):
        kind = "class" if inspect.isclass(thing) else "func"
        where = f"{thing.__module__}.{thing.__qualname__}"
        return f"| {{py:{kind}}}`{name} <{where}>` | {first_sentence(thing)} |"
    return f"| `{name}` | |"


def first_sentence(thing) -> str:
    line = (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ")
    return line.replace("|", "\\|")


# --- to play with --------------------------------------------------------------------------

RUNTIME = re.compile(r"<script data-fpp-runtime>.*?</script>\n?", re.DOTALL)


def offer_runtime(app):
    app.config.html_static_path.append(str(live.RUNTIME))


def share_runtime(app, pagename, templatename, context, doctree):
    # Each stored output has a copy, for JupyterLab; a page needs one, of today.
    if "fpp-live" in (context.get("body") or ""):
        context["body"] = RUNTIME.sub("", context["body"])
        app.add_js_file(live.RUNTIME.name, loading_method="defer")


# --- offline -------------------------------------------------------------------------------

REMOTE = re.compile(r"(https?:)?//", re.IGNORECASE)
REMOTE_CSS = re.compile(r"(?:url\(|@import)\s*['\"]?((?:https?:)?//[^'\")\s]+)", re.IGNORECASE)
UNUSED = ("core", "latest", "loader", "startup", "input/", "output/chtml")  # parts of MathJax
FONT_PRELOAD = re.compile(r'<link rel="preload" as="font"[^>]*>\s*')
LOADED = {"script", "img", "iframe", "source", "video", "audio", "embed", "track", "object"}
LINKED = {"stylesheet", "preload", "modulepreload", "prefetch", "icon", "manifest"}


class RemoteFinder(HTMLParser):
    """Collects every address a page would load by itself from a network."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        attrs = {name: value or "" for name, value in attrs}
        links = tag == "link" and LINKED & set(attrs.get("rel", "").split())
        for name in ("src", "data", "poster") if tag in LOADED else ("href",) if links else ():
            if REMOTE.match(attrs.get(name, "")):
                self.found.append(attrs[name])
        self.found += REMOTE_CSS.findall(attrs.get("style", ""))


def find_remote(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8", errors="replace")
    if path.suffix == ".css":
        return REMOTE_CSS.findall(text)
    finder = RemoteFinder()
    finder.feed(text)
    return finder.found


def drop_thebe(app, pagename, templatename, context, doctree):
    # Jupyter Book always adds Thebe, which reaches for a network as soon as it is used.
    def unwanted(script):
        return "thebe" in str(script).lower() or "thebe" in str(getattr(script, "attributes", ""))

    context["script_files"] = [s for s in context.get("script_files", []) if not unwanted(s)]


def drop_what_no_page_loads(app, exception):
    # 15 MB of MathJax: other bundles, parts that its bundle holds already, formats that no page is
    # written in; and 16 MB of notebooks whose editions are offered instead.
    if exception is None and app.builder.format == "html":
        out, loaded = Path(app.outdir), Path(app.config.mathjax_path).name
        mathjax = out / "_static/mathjax"
        bundles = [p for p in mathjax.glob("*-*.js") if p.name != loaded]
        others = [p for name in UNUSED for p in mathjax.glob(f"{name}*.js")]
        for file in [*bundles, *others, *(out / "_sources").rglob("*.ipynb")]:
            file.unlink()


def drop_font_preloads(app, exception):
    # A page opened from the disk may not preload fonts; the style sheet loads them anyway.
    if exception is None and app.builder.format == "html":
        for path in Path(app.outdir).rglob("*.html"):
            text = path.read_text(encoding="utf-8")
            if (without := FONT_PRELOAD.sub("", text)) != text:
                path.write_text(without, encoding="utf-8")


def check_offline(app, exception):
    if exception is None and app.builder.format == "html":
        for path in sorted(Path(app.outdir).rglob("*")):
            if path.suffix in {".html", ".css"} and "mathjax" not in path.parts:
                for address in find_remote(path):
                    LOGGER.warning("%s loads %s from a network", path.name, address)


def forget_if_warned(app, exception):
    # Sphinx would not repeat the warnings of a page that did not change.
    if app._warncount:
        Path(app.doctreedir, "environment.pickle").unlink(missing_ok=True)


def setup(app):
    app.add_node(RunTime)
    app.add_node(RunTimes)
    app.add_role("time", TimeRole())
    app.add_directive("runtimes", RunTimesDirective)
    app.add_directive("face", FaceDirective)
    app.connect("config-inited", set_execution)
    app.connect("env-before-read-docs", execute_chapters)
    app.connect("env-updated", record_runtimes)
    app.connect("doctree-resolved", fill_in_times)
    app.connect("builder-inited", offer_runtime)
    app.connect("html-page-context", share_runtime)
    app.connect("html-page-context", drop_thebe, priority=900)
    app.connect("build-finished", drop_what_no_page_loads)
    app.connect("build-finished", drop_font_preloads)
    app.connect("build-finished", check_offline, priority=900)
    app.connect("build-finished", forget_if_warned, priority=950)
    return {"parallel_read_safe": False, "parallel_write_safe": False}
