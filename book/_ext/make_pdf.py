"""The book as one PDF: ``python book/_ext/make_pdf.py HTML PDF`` prints the one-page book.

The print is what a reader sees first: folded cells and solutions stay folded, a figure to play
with is its still picture. Front page and contents are made from the page itself.
"""

import os
import shutil
import sys
from pathlib import Path

from playwright.sync_api import Error, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")

FRONT = """() => {
  document.querySelectorAll('.solution, dialog, #jb-print-docs-body').forEach(e => e.remove());
  document.querySelector('.fpp-gallery').closest('section').remove(); // the figures once is enough
  document.querySelectorAll('img').forEach(i => { i.loading = 'eager'; });
  document.querySelectorAll('details').forEach(d => { d.open = false; });
  const book = document.querySelector('article');
  const front = document.createElement('div'), list = document.createElement('ol');
  front.className = 'fpp-front';
  front.innerHTML = `<div class="fpp-title">${document.title}</div>`;
  const clean = h => { const c = h.cloneNode(true);
    c.querySelectorAll('.headerlink').forEach(e => e.remove()); return c.innerHTML; };
  for (const h of book.querySelectorAll('section > :is(h2, h3)')) {
    if (h.closest('.exercise, .admonition, .fpp-gallery')) continue;
    const at = h.closest('section').id;
    const item = document.createElement('li');
    item.className = h.tagName;
    item.innerHTML = `<a href="#${at}">${clean(h)}</a>`;
    list.append(item);
  }
  front.append(list);
  book.prepend(front);
  const style = document.createElement('style');
  style.textContent = `
    .fpp-front { break-after: page; }
    .fpp-title { font-size: 40pt; padding: 80mm 0; text-align: center; }
    .fpp-front > ol { break-before: page; columns: 2; list-style: none; padding: 0; }
    .fpp-front .H2 { font-weight: 600; margin-top: .6em; break-after: avoid; }
    .fpp-front .H3 { margin-left: 1.5em; }
    section > h1, [id^="document-"] { display: block; break-before: page; }
    figure, .math, tr { break-inside: avoid; } figure { margin-inline: 0; }
    img { max-width: 100%; } .toctree-wrapper > p.caption { display: none; }
    .bd-header-article, .bd-sidebar-secondary, .prev-next-footer, .copybtn {
      display: none !important; }`;
  document.head.append(style);
}"""
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
        page = browser.new_page(color_scheme="light", offline=True)
        page.set_default_timeout(600_000)
        page.goto(source.resolve().as_uri())
        page.wait_for_function("window.MathJax?.startup?.promise", timeout=60_000)
        page.evaluate("MathJax.startup.promise")
        page.evaluate(FRONT)
        page.evaluate("Promise.allSettled([...document.images].map(i => i.decode()))")
        page.pdf(
            path=target,
            format="A4",
            scale=0.75,
            outline=True,
            tagged=True,
            display_header_footer=True,
            header_template="<span></span>",
            footer_template=FOOT,
            margin={"top": "16mm", "bottom": "18mm", "left": "16mm", "right": "16mm"},
        )
    print(f"Open {target.resolve().as_uri()}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
