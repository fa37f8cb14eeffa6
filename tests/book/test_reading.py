"""What a reader sees and does: dark pages, large pictures, long lines, keys, terms, the gallery."""

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHAPTERS = sorted(path.stem for path in (ROOT / "chapters").glob("[0-9]*.ipynb"))
PHASE = "chapters/03_phase_shifting"
PICTURE = "article figure img.fpp-enlarges"
LARGE = "dialog.fpp-large"


@pytest.fixture
def opened(html, browser):
    """Opens a page of the book, by name, at a width and in a scheme."""
    contexts = []

    def opener(name, width=1400, scheme="light"):
        size = {"width": width, "height": 900}
        contexts.append(browser.new_context(viewport=size, color_scheme=scheme, offline=True))
        page = contexts[-1].new_page()
        page.goto((html / f"{name}.html").as_uri())
        return page

    yield opener
    for context in contexts:
        context.close()


STYLES = (
    """e => { const s = getComputedStyle(e); return [s.filter, s.backgroundColor, s.padding]; }"""
)


def test_pictures_are_as_drawn_on_a_dark_page(opened):
    page = opened(PHASE, scheme="dark")
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


def test_a_click_enlarges_a_picture(opened):
    page = opened(PHASE)
    picture = page.query_selector(PICTURE)
    small = picture.bounding_box()["width"]
    picture.click()
    large = page.query_selector(f"{LARGE}[open] img")
    assert large.bounding_box()["width"] > 1.3 * small
    assert large.get_attribute("alt") == picture.get_attribute("alt") != ""
    large.click()
    assert page.query_selector(f"{LARGE}[open]") is None


def test_enter_enlarges_a_picture_and_escape_ends_it(opened):
    page = opened(PHASE)
    picture = page.query_selector(PICTURE)
    picture.focus()
    page.keyboard.press("Enter")
    assert page.query_selector(f"{LARGE}[open]")
    page.keyboard.press("ArrowRight")
    assert PHASE in page.url
    page.keyboard.press("Escape")
    page.wait_for_function(f"!document.querySelector('{LARGE}').open")


def test_a_figure_to_play_with_does_not_open(opened):
    page = opened(PHASE)
    assert page.query_selector_all(".fpp-played") or page.query_selector_all(".fpp-live")
    assert page.query_selector(f".fpp-played {PICTURE.split()[-1]}") is None


CUT = """() => [...document.querySelectorAll('article .cell_output .output pre')]
  .filter(e => e.scrollWidth > e.clientWidth + 1).map(e => e.textContent.slice(0, 80))"""


@pytest.mark.parametrize("name", CHAPTERS)
def test_what_a_cell_says_is_not_cut(name, opened):
    page = opened(f"chapters/{name}")
    assert page.evaluate(CUT) == []
    page.set_viewport_size({"width": 400, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") <= 400


def test_code_is_large_enough_to_read(opened):
    page = opened(PHASE)
    size = "e => getComputedStyle(e).fontSize"
    sizes = {e.evaluate(size) for e in page.query_selector_all("article .cell pre")}
    assert sizes == {"14px"}
    assert (
        page.query_selector("figcaption p").evaluate("e => getComputedStyle(e).fontWeight") == "400"
    )


def test_nothing_is_cut_in_print(opened):
    page = opened(PHASE, width=700)
    page.emulate_media(media="print")
    assert page.evaluate(CUT.replace(".cell_output .output pre", "pre")) == []


def test_arrow_keys_turn_pages(opened):
    page = opened(PHASE)
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


@pytest.mark.parametrize("name", CHAPTERS)
def test_a_term_says_what_the_glossary_says(name, opened):
    page, glossary = opened(f"chapters/{name}"), opened("book/glossary")
    for one in (page, glossary):
        one.wait_for_function("window.MathJax?.startup?.promise")
        one.evaluate("MathJax.startup.promise")
    links = page.query_selector_all("a.fpp-term")
    assert len(links) >= 8 and len({link.get_attribute("href") for link in links}) == len(links)
    for link in links:
        anchor = link.get_attribute("href").partition("#")[2]
        link.focus()
        tip = page.query_selector(f"#{link.get_attribute('aria-describedby')}")
        assert tip.is_visible()
        meaning = glossary.query_selector(f"#{anchor} + dd")
        assert tip.evaluate(TEXT) == meaning.evaluate(TEXT) != ""
    page.keyboard.press("Escape")
    assert not tip.is_visible()


def test_no_term_is_linked_where_it_is_no_prose(opened):
    page = opened(PHASE)
    wrong = "article :is(h1, h2, h3, figcaption, pre, .solution, .exercise, .admonition) a.fpp-term"
    assert page.query_selector(wrong) is None


def test_the_gallery_has_all_numbered_figures(opened):
    gallery = opened("book/gallery")
    shown = {
        a.get_attribute("href").rpartition("/")[2] for a in gallery.query_selector_all(".fpp-thumb")
    }
    there = set()
    beside = [f"book/{path.stem}" for path in sorted((ROOT / "book").glob("*.ipynb"))]
    for path in (*beside, *(f"chapters/{name}" for name in CHAPTERS)):
        page, name = opened(path), path.partition("/")[2]
        for figure in page.query_selector_all("article figure:has(.caption-number)"):
            anchor = f"{figure.get_attribute('id')}-cell"
            assert page.query_selector(f"#{anchor} + div.cell"), anchor
            there.add(f"{name}.html#{anchor}")
    assert shown == there and len(there) > 60


@pytest.mark.slow
def test_the_book_is_one_pdf(html, tmp_path):
    target, edition = tmp_path / "book.pdf", ROOT / "_build/editions/01_fringes.ipynb"
    before = edition.read_bytes()
    subprocess.run(["make", "-C", ROOT, "pdf", f"PDF={target}"], check=True)
    assert edition.read_bytes() == before, "the one-page book leaves the editions alone"
    assert target.read_bytes().startswith(b"%PDF") and target.stat().st_size > 5e6
