"""The book as one PDF: ``python book/_ext/make_pdf.py HTML PDF`` prints the one-page book.

The print is for one who reads on: folded code, hints and solutions are left out, asides are open, a
figure to play with is its still picture. Front page and contents are made from the page itself;
on which pages their sections stand a first print tells.
What leads nowhere and what is wider than the page is named on the error stream.
"""

import io
import os
import shutil
import sys
from pathlib import Path

from playwright.sync_api import Error, sync_playwright
from pypdf import PdfReader

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")

FRONT = """() => {
  const book = document.querySelector('article');
  document.querySelector('.fpp-gallery').closest('section').remove(); // the figures once is enough
  document.querySelectorAll(`.solution, dialog, #jb-print-docs-body, .headerlink,
    .cell details.hide`).forEach(e => e.remove());
  document.querySelectorAll('.exercise details').forEach(e => e.remove());
  document.querySelectorAll('img').forEach(i => { i.loading = 'eager'; });
  document.querySelectorAll('details').forEach(d => { d.open = true; });

  const front = document.createElement('div'), list = document.createElement('ol');
  front.className = 'fpp-front';
  front.id = 'document-book/index';
  front.innerHTML = `<div class="fpp-title">${document.title}</div>
    <p>Printed from the pages: folded code, hints and solutions stand in the notebooks, and figures
    to play with are still.</p><h2>Contents</h2>`;
  const goals = []; // of each link the element it leads to
  for (const h of book.querySelectorAll('section > :is(h2, h3)')) {
    if (h.closest('.exercise, .admonition')) continue;
    const item = document.createElement('li'), link = document.createElement('a');
    item.className = h.tagName;
    link.innerHTML = h.innerHTML;
    goals.push([link, h.closest('section')]);
    item.append(link, document.createElement('span'));
    list.append(item);
  }
  front.append(list);
  book.prepend(front);

  const pages = [location.pathname, new URL('book/index.html', location).pathname], dead = [];
  for (const link of book.querySelectorAll('a[href]')) { // pages joined have an address repeatedly
    const url = new URL(link.href), id = decodeURIComponent(url.hash.slice(1));
    if (url.protocol !== 'file:') continue;
    const there = [...book.querySelectorAll(`[id="${CSS.escape(id)}"]`)];
    const goal = there.find(e => e.closest('.citation')) ?? there[0];
    if (goal && pages.includes(url.pathname)) goals.push([link, goal]);
    else {
      dead.push(`the link to ${link.getAttribute('href')} leads nowhere`);
      link.removeAttribute('href');
    }
  }
  const places = new Map();
  for (const [link, goal] of goals) {
    if (!places.has(goal)) places.set(goal, `place-${places.size}`);
    link.setAttribute('href', `#${places.get(goal)}`);
  }
  for (const [goal, id] of places) {
    const place = document.createElement('span'); // in the head, which may begin the next page
    place.id = id;
    (goal.querySelector(':scope > :is(h1, h2, h3, h4)') ?? goal).prepend(place);
  }

  const style = document.createElement('style');
  style.textContent = `
    .fpp-front { break-after: page; text-align: center; }
    .fpp-title { font-size: 40pt; padding: 80mm 0; }
    .fpp-front > h2 { break-before: page; text-align: left; }
    .fpp-front > ol { columns: 2; list-style: none; padding: 0; text-align: left; font-size: 94%;
      line-height: 1.5; }
    .fpp-front .H2 { font-weight: 600; margin-top: .6em; break-after: avoid; }
    .fpp-front .H3 { margin-left: 1.5em; }
    .fpp-front li { display: flex; justify-content: space-between; break-inside: avoid; }
    .fpp-front li span { flex: none; width: 2.2em; text-align: right; } /* of the page's number */
    section > h1, [id^="document-"]:not(.fpp-front) { display: block; break-before: page; }
    figure, .math, tr, .sd-card:not(details), .exercise, .short { break-inside: avoid; }
    dt, summary { break-after: avoid; }
    figure { margin-inline: 0; }
    pre { overflow: visible !important; orphans: 4; widows: 4; }
    img { max-width: 100%; } .toctree-wrapper > p.caption { display: none; }
    .bd-header-article, .bd-sidebar-secondary, .prev-next-footer, .copybtn {
      display: none !important; }`;
  document.head.append(style);
  for (const code of book.querySelectorAll('.cell_input, .highlight'))
    code.classList.toggle('short', code.textContent.trim().split('\\n').length < 25);
  return [...new Set(dead)];
}"""
WIDE = """() => {
  const article = document.querySelector('article'), wide = [];
  const margin = parseFloat(getComputedStyle(article).paddingRight);
  const edge = article.getBoundingClientRect().right - margin + 1;
  for (const e of article.querySelectorAll('pre, table, img, svg, mjx-container, p, dt')) {
    const box = e.getBoundingClientRect(), width = e.tagName === 'PRE' ? e.scrollWidth : 0;
    if (Math.max(box.right, box.left + width) > edge)
      wide.push(`wider than the page: ${(e.alt || e.textContent).trim().slice(0, 80)}`);
  }
  return wide;
}"""
NUMBER = """pages => document.querySelectorAll('.fpp-front li a').forEach(a => {
  a.nextElementSibling.textContent = pages[a.hash.slice(1)]; })"""
SCALE = 0.75
SHEET = {"width": round((210 - 2 * 16) / 25.4 * 96 / SCALE), "height": 1300}  # px: A4, its margins
FOOT = (
    '<div style="font-size: 8px; width: 100%; text-align: center"><span class="pageNumber"></span>'
    "</div>"
)


def main(source: Path, target: Path) -> None:
    path = os.environ.get("BROWSER_PATH") or next(filter(None, map(shutil.which, NAMES)), None)
    with sync_playwright() as playwright:
        try:  # without a path, playwright takes its own
            browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        except Error:
            sys.exit("no Chromium or Chrome was found to print with (Debian: apt install chromium)")
        page = browser.new_page(color_scheme="light", offline=True, viewport=SHEET)
        page.emulate_media(media="print")
        page.set_default_timeout(600_000)
        page.goto(source.resolve().as_uri())
        page.wait_for_function("window.MathJax?.startup?.promise", timeout=60_000)
        page.evaluate("MathJax.startup.promise")
        wrong = page.evaluate(FRONT)
        page.evaluate("Promise.allSettled([...document.images].map(i => i.decode()))")
        for line in wrong + page.evaluate(WIDE):
            print(line, file=sys.stderr)
        sheets = {
            "format": "A4",
            "scale": SCALE,
            "display_header_footer": True,
            "header_template": "<span></span>",
            "footer_template": FOOT,
            "margin": {"top": "16mm", "bottom": "18mm", "left": "16mm", "right": "16mm"},
        }
        first = PdfReader(io.BytesIO(page.pdf(tagged=True, **sheets)))
        places = first.named_destinations
        at = {k[1:]: first.get_destination_page_number(place) + 1 for k, place in places.items()}
        page.evaluate(NUMBER, at)
        page.pdf(path=target, outline=True, tagged=True, **sheets)
    print(f"Open {target.resolve().as_uri()}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
