"""Every rendered page opens in a browser whose network is cut, as a reader would open it."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def pages(html):
    """All pages but the first, which Jupyter Book writes: a redirect to the landing page."""
    found = (path for path in html.rglob("*.html") if "_static" not in path.parts)
    return sorted(path for path in found if path != html / "index.html")


def faults(browser, path, width=1400, scheme="light"):
    """Open one page from the disk: all that is wrong with it, and its figures to play with."""
    found = []
    size = {"width": width, "height": 900}
    context = browser.new_context(viewport=size, color_scheme=scheme, offline=True)
    context.route(
        re.compile("^(?!file:|data:|blob:)"),
        lambda route: (found.append(f"asks for {route.request.url}"), route.abort()),
    )
    page = context.new_page()
    page.on("console", lambda m: found.append(f"console: {m.text}") if m.type == "error" else None)
    page.on("pageerror", lambda error: found.append(f"error: {error}"))
    page.on("requestfailed", lambda request: found.append(f"failed: {request.url}"))
    page.goto(path.as_uri(), wait_until="load")
    found += unread(page)
    for button in page.query_selector_all(".fpp-show"):  # a figure may be the answer
        button.click()
    figures = page.query_selector_all(".fpp-live")
    for root in figures:
        found += played(page, root)
    if page.evaluate(WIDER):
        found.append("wider than the window")
    context.close()
    return found, len(figures)


def unread(page):
    """Mathematics that is not set, pictures that are broken or not told in words."""
    found = []
    if page.query_selector(".math"):
        try:
            page.wait_for_function("document.querySelector('mjx-container')", timeout=20_000)
            page.evaluate("MathJax.startup.promise")
        except Exception as error:
            found.append(f"math is not rendered: {error}")
    return found + page.evaluate(LOOK)


LOOK = r"""async () => {
  const found = [];
  const images = [...document.images];
  images.forEach(i => { i.loading = 'eager'; });
  await Promise.allSettled(images.map(i => i.decode()));
  for (const i of images) {
    if (!i.complete || !i.naturalWidth) found.push('broken image: ' + i.src.slice(0, 200));
    if (!(i.getAttribute('alt') || '').trim()) found.push('no alt text: ' + i.src.slice(0, 200));
  }
  for (const e of document.querySelectorAll('mjx-merror, [data-mjx-error]'))
    found.push('bad math: ' + e.textContent);
  for (const e of document.querySelectorAll('.math'))
    if (!e.querySelector('mjx-container')) found.push('raw math: ' + e.textContent);
  const article = (document.querySelector('article') || document.body).cloneNode(true);
  article.querySelectorAll('pre, code, script, mjx-container').forEach(e => e.remove());
  if (/\$\$|\\\(|\\\[/.test(article.textContent)) found.push('raw TeX in the text');
  return found;
}"""


def test_every_chapter_renders_without_a_warning(pages):
    chapters = {path.stem for path in (ROOT / "chapters").glob("[0-9]*.ipynb")}
    assert chapters <= {path.stem for path in pages}


def test_the_front_page_leads_to_the_landing_page(html, browser):
    page = browser.new_page()
    page.goto((html / "index.html").as_uri())
    page.wait_for_url("**/book/index.html")
    page.close()


@pytest.mark.parametrize("width, scheme", [(1400, "light"), (400, "dark")])
def test_every_page(html, pages, browser, width, scheme):
    wrong, number = {}, 0
    for path in pages:
        found, figures = faults(browser, path, width, scheme)
        number += figures
        if found:
            wrong[str(path.relative_to(html))] = found
    assert not wrong and number >= 16


BUTTONS = "mybinder.org|colab.research.google.com|/issues/new|dropdown-(?:launch|source)-buttons"


def named(path) -> set[str]:
    """What of a page needs the address of a repository."""
    return set(re.findall(BUTTONS, path.read_text(encoding="utf-8")))


def test_pages_have_the_buttons_of_a_repository_if_one_is_set(pages):
    (url,) = re.findall(r"^  url: (.*)", (ROOT / "_config.yml").read_text(), re.MULTILINE)
    chapters = [path for path in pages if path.parent.name == "chapters"]
    if url == '""':
        assert not set().union(*map(named, pages))
    else:
        assert all("mybinder.org" in named(path) for path in chapters)


def test_the_test_sees_faults(browser, tmp_path):
    page = tmp_path / "bad.html"
    page.write_text(
        "<article><img src='missing.png'><script src='http://127.0.0.1:9/a.js'></script>"
        "<p>$$x$$</p><script>console.error('wrong')</script></article>"
    )
    found = "\n".join(faults(browser, page)[0])
    for fault in ("broken image", "no alt text", "asks for", "raw TeX", "console: wrong"):
        assert fault in found


# --- figures to play with ---

MOVED = """async root => {
  const wrong = [], canvases = [...root.querySelectorAll('canvas')];
  const plots = () => (root.querySelector('.fpp-plots')?.innerHTML ?? '')
    .replace(/fpp-clip-[0-9]+/g, ''); // counted on at each drawing
  const words = () => root.querySelector('table, .fpp-numbers')?.innerText ?? '';
  const picture = () => plots() + words() + canvases.map(c => c.toDataURL()).join();
  const near = (x, y, within) => Math.abs(x - y) <= (within ?? 1e-6 * Math.max(1, Math.abs(y)));
  const drawn = () => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
  const control = name => root.querySelector(`[name="${name}"]`);
  const key = e => e.type === 'checkbox' ? 'checked' : 'value';
  const move = (e, value) => {
    e[key(e)] = value;
    e.dispatchEvent(new Event(e.type === 'range' ? 'input' : 'change', {bubbles: true}));
    return drawn();
  };
  const inputs = [...root.querySelectorAll('input, select')];
  const first = inputs.map(e => e[key(e)]);
  const ends = e => ({range: [e.min, e.value, e.max], checkbox: [e.checked, !e.checked]})[e.type]
    ?? [...e.options].map(o => o.value);
  const tried = async e => {
    const seen = new Set();
    for (const value of ends(e)) {
      await move(e, value);
      seen.add(picture());
      if (/NaN|undefined|Infinity/.test(plots() + words())) wrong.push(`${e.name} ${value}: NaN`);
    }
    return seen.size > 1;
  };
  const back = async () => { for (const [k, e] of inputs.entries()) await move(e, first[k]); };
  for (const e of inputs) {
    let moves = await tried(e);
    for (const other of inputs) // what one control does may hang on another
      if (!moves && other !== e && other.type === 'range') {
        await move(other, other.max);
        moves = await tried(e);
      }
    if (!moves) wrong.push(`${e.name} changes nothing`);
    await back();
  }

  let compared = 0; // numbers that a reader sees, with the controls where Python had them
  const before = picture(), rows = [...root.querySelectorAll('tbody tr')];
  for (const [settings, numbers] of root.checks ?? []) {
    const found = root.compute(settings).numbers;
    for (const [name, x] of Object.entries(numbers))
      if (!near(found[name][0], x, found[name][2]))
        wrong.push(`${name} ${found[name][0]}, ${x} in Python, at ${JSON.stringify(settings)}`);
    if (root.dataset.kind === 'table') {
      const head = root.querySelectorAll('thead th')[settings.column];
      head.removeAttribute('aria-sort');
      for (let k = 0; k < 1 + Boolean(settings.down); k++) head.querySelector('button').click();
      compared += 1;
      if (root.querySelector('tbody tr') !== rows[numbers.first])
        wrong.push(`sorted otherwise than in Python: ${JSON.stringify(settings)}`);
      continue;
    }
    const maps = root.dataset.kind === 'maps', names = Object.keys(settings);
    for (const name of names) if (control(name)) await move(control(name), settings[name]);
    if (maps) {
      const map = root.querySelector('.fpp-map canvas'), box = map.getBoundingClientRect();
      const at = {clientX: box.left + box.width * (settings.u + 0.5) / map.width,
                  clientY: box.top + box.height * (settings.v + 0.5) / map.height};
      map.dispatchEvent(new PointerEvent('pointerdown', {bubbles: true, ...at}));
    }
    const stands = name => String(control(name)[key(control(name))]) === String(settings[name]);
    if (!names.every(name => !control(name) || stands(name))) continue; // between two steps
    if (!maps && !names.every(control) && // what has no control stands elsewhere
      JSON.stringify(root.compute({}).numbers) !== JSON.stringify(found)) continue;
    for (const [name, x] of Object.entries(numbers)) {
      const seen = root.querySelector(`[data-number="${name}"]`)?.dataset.value;
      if (seen === undefined) continue;
      compared += 1;
      if (!near(Number(seen), x, found[name][2])) wrong.push(`shows ${name} ${seen}, Python ${x}`);
    }
  }
  if (root.checks && !compared) wrong.push('nothing that is seen is checked against Python');
  const again = root.querySelector('.fpp-again');
  if (again) {
    again.click();
    await drawn();
    if (picture() !== before) wrong.push('does not start again');
  }
  await back();
  return wrong;
}"""


SOON = """(root, [said, before]) => new Promise(answer => {
  const end = performance.now() + 500, says = eval(said);
  const look = () => says(root) !== before ? answer(true)
    : performance.now() > end ? answer(false) : requestAnimationFrame(look);
  look();
})"""  # whether it says something else
WIDER = "document.documentElement.scrollWidth > innerWidth"


HANDLE = """async (e, k) => {  // where to take it, once what was moved before is drawn
  for (let n = 0; n < 2; n++) await new Promise(requestAnimationFrame);
  const handle = e.querySelectorAll(".fpp-handle")[k];
  handle.scrollIntoView({ block: "nearest", behavior: "instant" });
  const r = handle.getBoundingClientRect();
  return [r.x + r.width / 2, r.y + 16];
}"""


def played(page, root) -> list[str]:
    """What is wrong with one figure that a reader plays with."""
    root.scroll_into_view_if_needed()
    page.wait_for_function("e => e.dataset.on && !/ing$/.test(e.dataset.on)", arg=root)
    if root.get_attribute("data-on") != "yes":
        return ["does not start"]
    wrong = page.evaluate(MOVED, root)
    said = "e => [...e.querySelectorAll('output, [data-number]')].map(x => x.textContent).join()"
    said += " + JSON.stringify({...e.querySelector('canvas')?.dataset})"
    for part in root.query_selector_all("input[type=range], .fpp-maps, .fpp-space"):
        before = root.evaluate(said)
        part.focus()
        at_the_left = part.evaluate("e => e.value !== undefined && e.value === e.min")
        for key in ("ArrowRight", "ArrowLeft") if at_the_left else ("ArrowLeft", "ArrowRight"):
            page.keyboard.press(key)
            if root.evaluate(SOON, [said, before]):
                break
        else:
            wrong.append(f"keys do not move {part.get_attribute('name') or 'it'}")
    for k in range(len(root.query_selector_all(".fpp-handle"))):
        values = "e => [...e.querySelectorAll('input')].map(i => i.value)"
        before, (x, y) = root.evaluate(values), root.evaluate(HANDLE, k)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 25, y + 25, steps=4)
        page.mouse.up()
        if root.evaluate(values) == before:
            wrong.append(f"handle {k} cannot be dragged")
    return wrong
