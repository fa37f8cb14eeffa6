"""What a reader sees and does: dark pages, large pictures, long lines, keys, terms, the gallery."""

import io
import re
import subprocess
from contextlib import contextmanager
from pathlib import Path

import pytest
from bs4 import BeautifulSoup
from pypdf import PdfReader

ROOT = Path(__file__).parents[2]
CHAPTERS = sorted(path.stem for path in (ROOT / "chapters").glob("[0-9]*.ipynb"))
PHASE = "chapters/03_phase_shifting"
PICTURE = "article figure img.fpp-enlarges"
LARGE = "dialog.fpp-large"


@pytest.fixture(scope="module")
def visit(html, browser):
    """Opens a page of the book, by name, at a width and in a scheme, for as long as a block."""

    @contextmanager
    def visiting(name, width=1400, scheme="light"):
        size = {"width": width, "height": 900}
        context = browser.new_context(viewport=size, color_scheme=scheme, offline=True)
        try:
            page = context.new_page()
            page.goto((html / f"{name}.html").as_uri())
            yield page
        finally:
            context.close()

    return visiting


@pytest.fixture(scope="module")
def phase(visit):
    """One page for several tests, each of which leaves it as it was."""
    with visit(PHASE) as page:
        yield page


@pytest.fixture(scope="module", params=CHAPTERS)
def chapter(visit, request):
    """The page of a chapter, opened once, with its mathematics set."""
    with visit(f"chapters/{request.param}") as page:
        set_mathematics(page)
        yield page


def set_mathematics(page):
    page.wait_for_function("window.MathJax?.startup?.promise")
    page.evaluate("MathJax.startup.promise")


STYLES = (
    """e => { const s = getComputedStyle(e); return [s.filter, s.backgroundColor, s.padding]; }"""
)


def test_pictures_are_as_drawn_on_a_dark_page(visit):
    with visit(PHASE, scheme="dark") as page:
        assert page.evaluate("document.documentElement.dataset.theme") == "dark"
        pictures = page.query_selector_all(PICTURE)
        assert len(pictures) >= 10
        pictures[0].click()
        for picture in (*pictures, page.query_selector(f"{LARGE}[open] img")):
            assert picture.evaluate(STYLES) == ["none", "rgba(0, 0, 0, 0)", "0px"]
        tables = page.query_selector_all("div.cell_output .text_html:has(> table)")
        grounds = {table.evaluate("e => getComputedStyle(e).backgroundColor") for table in tables}
        assert tables and grounds == {"rgba(0, 0, 0, 0)"}


def test_figures_are_stored_without_a_ground(html):
    from PIL import Image

    corners = []
    for path in (html / "_images").glob("*.png"):
        with Image.open(path) as image:
            corners.append(image.convert("RGBA").getpixel((0, 0))[3])
    assert len(corners) > 50 and sum(corners) == 0


def test_the_site_is_light(html):
    sizes = {path: path.stat().st_size for path in html.rglob("*") if path.is_file()}
    scripts = sum(size for path, size in sizes.items() if path.suffix == ".js")
    assert scripts < 6e6 and sum(sizes.values()) < 60e6


def test_a_click_enlarges_a_picture(phase):
    picture = phase.query_selector(PICTURE)
    small = picture.bounding_box()["width"]
    picture.click()
    large = phase.query_selector(f"{LARGE}[open] img")
    assert large.bounding_box()["width"] > 1.3 * small
    assert large.get_attribute("alt") == picture.get_attribute("alt") != ""
    large.click()
    assert phase.query_selector(f"{LARGE}[open]") is None


def test_enter_enlarges_a_picture_and_escape_ends_it(phase):
    picture = phase.query_selector(PICTURE)
    picture.focus()
    phase.keyboard.press("Enter")
    assert phase.query_selector(f"{LARGE}[open]")
    phase.keyboard.press("ArrowRight")
    assert PHASE in phase.url
    phase.keyboard.press("Escape")
    phase.wait_for_function(f"!document.querySelector('{LARGE}').open")


def test_a_figure_to_play_with_does_not_open(phase):
    assert phase.query_selector_all(".fpp-played") or phase.query_selector_all(".fpp-live")
    assert phase.query_selector(f".fpp-played {PICTURE.split()[-1]}") is None


CUT = """() => [...document.querySelectorAll('article .cell_output .output pre')]
  .filter(e => e.scrollWidth > e.clientWidth + 1).map(e => e.textContent.slice(0, 80))"""


def test_what_a_cell_says_is_not_cut(chapter):
    assert chapter.evaluate(CUT) == []
    chapter.set_viewport_size({"width": 400, "height": 900})
    assert chapter.evaluate("document.documentElement.scrollWidth") <= 400
    chapter.set_viewport_size({"width": 1400, "height": 900})


def test_code_is_large_enough_to_read(phase):
    size = "e => getComputedStyle(e).fontSize"
    sizes = {e.evaluate(size) for e in phase.query_selector_all("article .cell pre")}
    assert sizes == {"14px"}
    caption = phase.query_selector("figcaption p")
    assert caption.evaluate("e => getComputedStyle(e).fontWeight") == "400"


def test_nothing_is_cut_in_print(visit):
    with visit(PHASE, width=700) as page:
        page.emulate_media(media="print")
        assert page.evaluate(CUT.replace(".cell_output .output pre", "pre")) == []


def test_arrow_keys_turn_pages(visit):
    with visit(PHASE) as page:
        page.keyboard.press("Shift+ArrowRight")
        page.query_selector("article summary").focus()
        page.keyboard.press("ArrowRight")
        assert PHASE in page.url
        page.evaluate("document.activeElement.blur()")
        page.keyboard.press("ArrowRight")
        page.wait_for_url("**/04_unwrapping.html")
        page.keyboard.press("ArrowLeft")
        page.wait_for_url("**/03_phase_shifting.html")


TEXT = "e => e.textContent.replace(/\\s+/g, ' ').trim()"


@pytest.fixture(scope="module")
def glossary(visit):
    """What the glossary says of each term, by the term's anchor."""
    with visit("book/glossary") as page:
        set_mathematics(page)
        terms = page.query_selector_all("dt[id]:has(+ dd)")
        meaning = f"e => ({TEXT})(e.nextElementSibling)"
        return {term.get_attribute("id"): term.evaluate(meaning) for term in terms}


def test_a_term_says_what_the_glossary_says(chapter, glossary):
    links = chapter.query_selector_all("a.fpp-term")
    assert len(links) >= 8 and len({link.get_attribute("href") for link in links}) == len(links)
    for link in links:
        anchor = link.get_attribute("href").partition("#")[2]
        link.focus()
        tip = chapter.query_selector(f"#{link.get_attribute('aria-describedby')}")
        assert tip.is_visible()
        assert tip.evaluate(TEXT) == glossary[anchor] != ""
    chapter.keyboard.press("Escape")
    assert not tip.is_visible()


def test_no_term_is_linked_where_it_is_no_prose(phase):
    wrong = "article :is(h1, h2, h3, figcaption, pre, .solution, .exercise, .admonition) a.fpp-term"
    assert phase.query_selector(wrong) is None


def test_the_gallery_has_all_numbered_figures(html, visit):
    with visit("book/gallery") as page:
        thumbs = page.query_selector_all(".fpp-thumb")
        shown = {a.get_attribute("href").rpartition("/")[2] for a in thumbs}
    there = set()
    beside = [f"book/{path.stem}" for path in sorted((ROOT / "book").glob("*.ipynb"))]
    for path in (*beside, *(f"chapters/{name}" for name in CHAPTERS)):
        text = (html / f"{path}.html").read_text(encoding="utf-8")
        page, name = BeautifulSoup(text, "html.parser"), path.partition("/")[2]
        for figure in page.select("article figure:has(.caption-number)"):
            anchor = f"{figure['id']}-cell"
            assert page.select_one(f"#{anchor} + div.cell"), anchor
            there.add(f"{name}.html#{anchor}")
    assert shown == there and len(there) > 60


def test_a_table_to_sort_is_printed(visit):
    with visit("chapters/10_comparison") as page:
        for button in page.query_selector_all(".fpp-show"):  # a table may be the answer
            button.click()
        page.wait_for_selector(".fpp-live .fpp-sort")
        page.emulate_media(media="print")
        assert page.query_selector(".fpp-live table").is_visible()
        assert not page.query_selector(".fpp-live select").is_visible()


@pytest.mark.slow
def test_the_book_is_one_pdf(html, tmp_path):
    target, edition = tmp_path / "book.pdf", ROOT / "_build/editions/01_fringes.ipynb"
    before = edition.read_bytes()
    command = ["make", "-C", ROOT, "pdf", f"PDF={target}"]
    made = subprocess.run(command, check=True, capture_output=True, text=True)
    assert edition.read_bytes() == before, "the one-page book leaves the editions alone"
    assert not re.findall(".*leads nowhere|wider than the page.*", made.stderr)
    hold_pdf(target.read_bytes())


def hold_pdf(data: bytes) -> None:
    """Of what a PDF says in the open: outline, tags, where links lead, and on which page."""
    assert data.startswith(b"%PDF") and len(data) > 5e6
    assert b"/StructTreeRoot" in data and b"/Outlines" in data
    assert b"file:" not in data, "a link leads to the disk of whoever printed the book"
    entry = rb"/Title \((\d+)\. [^)]*\)\s*/Dest \[(\d+) 0 R /XYZ \S+ (\S+)"
    chapters = {int(k): (page, float(top)) for k, page, top in re.findall(entry, data)}
    assert sorted(chapters) == list(range(1, len(CHAPTERS) + 1))
    assert all(top > 740 for _, top in chapters.values()), "each at the top of a page, of 842"
    assert len({page for page, _ in chapters.values()}) == len(CHAPTERS)
    book = PdfReader(io.BytesIO(data))
    contents = " ".join("".join(page.extract_text() for page in book.pages[1:5]).split())
    parts = [
        part for entry in book.outline for part in (entry if isinstance(entry, list) else [entry])
    ]
    numbered = [part for part in parts if re.match(r"\d+\.", getattr(part, "title", ""))]
    assert len(numbered) > 8 * len(CHAPTERS)
    for part in numbered:
        page = book.get_destination_page_number(part) + 1
        assert f"{' '.join(part.title.split())} {page}" in contents
