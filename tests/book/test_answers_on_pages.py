"""Answers and predictions on a page: a browser says of an answer what `check` says."""

import importlib.util
import re
import sys
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from sphinx.application import Sphinx

from fpputil import exercises
from fpputil.exercises.diagnosis import NEARLY

ROOT = Path(__file__).parents[2]
CHAPTERS = sorted((ROOT / "chapters").glob("[0-9]*.ipynb"))
CONF = """
extensions = ["myst_nb", "sphinx_design", "sphinx_exercise", "sphinx_togglebutton"]
extensions += ["fpp_exercises"]
nb_execution_mode = "off"
suppress_warnings = ["myst-nb.lexer"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
mathjax_path = "exercises.js"  # nothing is loaded from a network
html_theme = "basic"
numfig = True
html_static_path = [{static!r}]
"""


def load(path):
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


load("book/_ext/fpp_exercises.py")  # where Sphinx finds it by its name


def keys_of_the_book():
    return sorted(
        set(re.findall(r'check\(\\"(\d+\.\d+)', "".join(p.read_text() for p in CHAPTERS)))
    )


NUMBERS = [key for key in keys_of_the_book() if not exercises.find(key).form]
QUESTION = "*Predict, then see.* Which way?"
SOLUTION = """```{solution-start} ex-1
:class: dropdown
```

It turns.

```{solution-end}
```"""


EXERCISE = """```{{exercise-start}}
:label: {label}
```

How much?

:::{{dropdown}} Hint
A hint.
:::

Check yourself in the notebook with `check("{key}", answer)`.

```{{exercise-end}}
```"""


def cell_that_prints(text, code="print()", *tags):
    outputs = [new_output("stream", text=text)]
    return new_code_cell(code, outputs=outputs, execution_count=1, metadata={"tags": tags})


PAGE = [
    new_markdown_cell(f"# Title\n\nVisible. {QUESTION}"),
    new_code_cell("silent = 1", execution_count=1),
    new_markdown_cell("What the code does."),
    cell_that_prints("printed", "open = 2"),
    cell_that_prints("printed too", "folded = 3", "hide-input"),
    new_code_cell("checked = 4", execution_count=1, metadata={"tags": ["hide-cell"]}),
    new_markdown_cell("(inside)=\nThe answer.\n\nThe text goes on."),
    new_markdown_cell(f"## Equation\n\n{QUESTION}"),
    cell_that_prints("printed"),
    new_markdown_cell("We get\n\n$$x = 1$$\n\nand go on."),
    new_markdown_cell(f"## Short\n\n{QUESTION}"),
    new_markdown_cell("Only words answer.\n\nThe text goes on again."),
    new_markdown_cell("## Exercises"),
    *(
        new_markdown_cell(EXERCISE.format(key=key, label=f"ex-{n}"))
        for n, key in enumerate([*NUMBERS, "1.3"])
    ),
    new_markdown_cell(SOLUTION),
]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A page with predictions, and with all the exercises of the book that have a field."""
    source = tmp_path_factory.mktemp("site")
    (source / "conf.py").write_text(CONF.format(static=str(ROOT / "book/_static")))
    nbformat.write(new_notebook(cells=PAGE), source / "index.ipynb")
    app = Sphinx(source, source, source / "html", source / "trees", "html", status=None)
    app.build()
    return source / "html/index.html"


@pytest.fixture(params=[(1400, "light"), (400, "dark")], ids=["wide", "phone"])
def page(site, browser, request):
    width, scheme = request.param
    context = browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True
    )
    page = context.new_page()
    wrong = []
    page.on("console", lambda m: wrong.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(site.as_uri())
    yield page
    assert not page.evaluate("document.documentElement.scrollWidth > innerWidth")
    context.close()
    assert not wrong


# --- answers -------------------------------------------------------------------------------


def wrong_answers(expected):
    """Values around the right one: with faults that have a name, and with some that have none."""
    e = np.asarray(expected, float)
    yield from (e, -e, 100 * e, e / 100, 1000 * e, e / 1000, 10 * e, np.degrees(e), np.radians(e))
    yield from (2 * e, -2 * e, e / 2, 2 * np.pi * e, e + 1, e - 1, e + 0.5, e + 2 * np.pi, 1.3 * e)
    yield from (e**2, np.sqrt(np.abs(e)), 20 * e, e / 20, e * 1.0008, 0 * e)
    yield from (np.round(e, decimals) for decimals in range(5))
    if e.all():
        yield 1 / e
    if e.ndim:
        yield e[::-1]
        for k in range(len(e)):
            for factor in (-1, 2, 1.3):
                yield np.where(np.arange(len(e)) == k, factor * e, e)


SAY = (
    "cases => cases.map(([k, text]) => document.getElementById(`answer-${k}`).form.diagnose(text))"
)


@pytest.fixture(scope="module")
def cases():
    """Exercise, text on the page, and what Python says of it."""
    cases = []
    for key in NUMBERS:
        exercise = exercises.find(key)
        for values in wrong_answers(exercise.expected):
            text = ", ".join(map(repr, np.ravel(values).tolist()))
            cases.append((key, text, exercise.diagnose(values)))
        for text, given in (("many", "many"), ("1 2 3 4 5 6", range(1, 7))):
            cases.append((key, text, exercise.diagnose(given)))
    return cases


def test_the_page_says_what_python_says(page, cases):
    told = page.evaluate(SAY, [case[:2] for case in cases])
    assert [(*case[:2], says) for case, says in zip(cases, told, strict=True)] == cases
    assert len(cases) > 800 and len(set(told)) > 40


WRITTEN = [
    ("3.1", "1.107", ""),
    ("3.1", " 1,107 ", ""),
    ("3.1", "+1.107e0", ""),
    ("1.1", "\u22123", ""),
    ("3.4", "10.84 %", ""),
    ("7.1", "9,972", ""),
    ("7.1", "9972.0", ""),
    ("2.2", "(351.8, 223.3)", ""),
    ("2.2", "351.8; 223.3", ""),
    ("2.2", "351.8 223.3", ""),
    ("2.2", "351,8 223,3", ""),
    ("2.2", "351,8; 223,3", ""),
    ("2.2", "351,8, 223,3", ""),
    ("2.2", "351.8 , 223.3", ""),
    ("2.2", "351.8 ,223.3", ""),
    ("2.3", "-0,9962 -0,0872 0", ""),
    ("2.3", "-1, -0.087, 0", NEARLY),
    ("2.3", "-0.9962, 1, 1", "The second and the third are wrong."),
    ("5.1", "1,0,2,2", ""),
    ("5.1", "1,0, 2,2", ""),
    ("3.2", "26", "It is too large."),
    ("2.2", "351.8", "A number given; 2 numbers wanted."),
    ("3.1", "1.107 rad", "The text '1.107 rad' given; a number wanted."),
    ("3.1", "0x10", "The text '0x10' given; a number wanted."),
    ("3.1", "Infinity", "The text 'Infinity' given; a number wanted."),
]


def test_numbers_may_be_written_in_many_ways(page):
    assert page.evaluate(SAY, [case[:2] for case in WRITTEN]) == [says for *_, says in WRITTEN]


def test_help_grows_by_keyboard_alone(page):
    first, second = exercises.find("3.1").hints
    field, output = page.locator("[id='answer-3.1']"), page.locator("[id='says-3.1']")
    assert output.get_attribute("aria-live") == "polite"
    assert page.get_by_label("Your answer", exact=True).count() >= 10
    said = []
    for answer in ("-1.107", "0.5", "1.11", "0.5", "0.5", " ", "1.107", "0.5"):
        field.fill(answer)
        field.press("Enter")
        said.append(output.locator("span").all_text_contents())
    assert said == [
        ["Not yet. The size is right, the sign is wrong."],
        ["Not yet.", f"Hint 1 of 2: {first}"],
        ["Right as far as it goes; give four digits, rounded."],
        ["Not yet.", f"Hint 2 of 2: {second}"],
        ["Not yet.", f"Hint 2 of 2: {second}"],
        ["Type a number."],
        ["Right."],
        ["Not yet."],
    ]
    field.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Check"


def test_fields_stand_where_numbers_are_asked_for(page, site):
    assert page.locator(".fpp-answer").count() == len(NUMBERS)
    assert page.locator(".exercise").count() == len(NUMBERS) + 1  # 1.3 asks for a function
    assert "1.107" not in site.read_text()


def test_the_words_of_a_title_open_a_solution(page):
    solution = page.locator(".solution")
    shut = "e => e.classList.contains('toggle-hidden')"
    assert solution.evaluate(shut)
    solution.locator(".admonition-title").click(position={"x": 40, "y": 8})
    assert not solution.evaluate(shut) and "#" not in page.url


# --- predictions ---------------------------------------------------------------------------

VISIBLE = "text => [...document.querySelectorAll('p, pre')].find(e => e.textContent.includes(text))"
VISIBLE += ".checkVisibility({contentVisibilityAuto: true})"


HIDDEN = ["printed", "printed too", "The answer.", "Only words"]
OPEN = ["silent = 1", "What the code does.", "open = 2", "The text goes on.", "We get"]
OPEN += ["goes on again"]
FOLDED = ["folded = 3", "checked = 4"]


def test_what_a_prediction_hides_and_a_key_shows(page):
    def seen():
        return [text for text in HIDDEN + OPEN + FOLDED if page.evaluate(VISIBLE, text)]

    assert seen() == OPEN
    buttons = page.locator(".fpp-show").all()
    assert len(buttons) == 3
    for button in buttons:
        assert button.get_attribute("aria-expanded") == "false"
        button.focus()
        page.keyboard.press("Enter")
        assert button.get_attribute("aria-expanded") == "true"
    assert seen() == HIDDEN + OPEN
    for details in page.locator("details.hide").all():
        details.locator("summary").click()
    assert seen() == HIDDEN + OPEN + FOLDED
    buttons[0].click()
    assert seen() == HIDDEN[3:] + OPEN + FOLDED
    assert not page.evaluate(VISIBLE, "The answer.")


def test_a_prediction_is_open_at_an_anchor_in_it(page, site):
    page.goto("about:blank")
    page.goto(f"{site.as_uri()}#inside")
    assert page.evaluate(VISIBLE, "The answer.") and not page.evaluate(VISIBLE, "Only words")


def test_a_prediction_is_open_in_print_and_without_javascript(page, site, browser):
    page.emulate_media(media="print")
    page.wait_for_function(VISIBLE, arg="The answer.")  # the page hears of it a moment later
    assert not page.locator(".fpp-show").first.is_visible()
    context = browser.new_context(java_script_enabled=False)
    plain = context.new_page()
    plain.goto(site.as_uri())
    assert plain.get_by_text("The answer.").is_visible()
    assert not plain.locator(".fpp-answer").first.is_visible()
    context.close()
