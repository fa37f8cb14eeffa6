"""Exercises and predictions on a page, without a kernel.

- Answers: below an exercise whose answer is a number stands a field, with the table of faults and
  the hints of `fpputil.exercises`, for ``book/_static/exercises.js`` to read.
- Solutions: the whole bar opens one, for its title is no link.
- Predictions: what answers a paragraph with *Predict, then see.* is put in a box, which
  ``exercises.js`` closes: the first figure or other output after it, and all from there to the end
  of the first paragraph; one that runs into an equation stays outside, with it. Without an output,
  the first paragraph. The next prediction and the next heading end it as well. Code stays open, in
  front of the box, and so does what stands before the first output.
"""

import base64
import json
import re

import numpy as np
from docutils import nodes
from sphinx.transforms import SphinxTransform
from sphinx_exercise.nodes import is_exercise_node, solution_node

from fpputil.exercises import diagnosis, find

CHECK = re.compile(r'check\("(\d+\.\d+)"')
PREDICT = "Predict, then see."
EQUATION = (nodes.math_block, nodes.target)  # a target bears the equation's name
FORM = """<form class="fpp-answer" data-exercise="{data}" hidden>
<label for="answer-{key}">{label}</label>
<input id="answer-{key}" type="text" autocomplete="off" autocapitalize="off" spellcheck="false"
 aria-describedby="says-{key}"><span>{unit}</span>
<button type="submit">Check</button>
<output id="says-{key}" for="answer-{key}" aria-live="polite"></output>
</form>"""


# --- answers -------------------------------------------------------------------------------


class AnswerFields(SphinxTransform):
    """Puts a field below each exercise that asks for numbers."""

    default_priority = 900

    def apply(self):
        for literal in list(self.document.findall(nodes.literal)):
            if (match := CHECK.match(literal.astext())) and in_exercise(literal):
                exercise = find(match[1])
                if not exercise.form:
                    place = literal.parent
                    index = place.parent.index(place)
                    place.parent.insert(index, nodes.raw("", form(match[1]), format="html"))


def in_exercise(node) -> bool:
    while node is not None and not is_exercise_node(node):
        node = node.parent
    return node is not None


def form(key: str) -> str:
    exercise = find(key)
    count = np.size(exercise.expected)
    label = "Your answer" if count == 1 else f"Your {count} numbers, with commas between"
    data = base64.b64encode(json.dumps(page_data(key)).encode()).decode()
    unit = {"px": "pixels"}.get(exercise.unit, exercise.unit)
    return FORM.format(key=key, data=data, label=label, unit=unit)


def page_data(key: str) -> dict:
    """What the page knows of an exercise: its hints, and its tables as `diagnosis` has them."""
    exercise = find(key)
    expected = np.asarray(exercise.expected)
    return {
        "hints": exercise.hints,
        "amount": diagnosis.amount(expected.shape),
        "whole": expected.dtype.kind in "iu",
        "rows": listed(diagnosis.table(expected, exercise.unit)),
        "parts": [listed(rows) for rows in diagnosis.parts(expected, exercise.unit)]
        if expected.ndim
        else [],
        "words": {name: getattr(diagnosis, name) for name in WORDS},
    }


WORDS = ("NEARLY", "NOT_WHOLE", "LARGE", "SMALL", "PLACES")
WORDS += ("SMALL_WHOLE", "TOO_LARGE", "TOO_SMALL")


def listed(rows) -> list:
    return [[np.ravel(values).tolist(), tolerance, says] for values, tolerance, says in rows]


# --- solutions -----------------------------------------------------------------------------


def unlink_solutions(app, doctree, docname):
    for solution in doctree.findall(solution_node):
        title = solution[0]
        title.children = [nodes.Text(title.astext())]


# --- predictions ---------------------------------------------------------------------------


class Predictions(SphinxTransform):
    """Boxes what a reader is to predict."""

    default_priority = 901

    def apply(self):
        questions = [p for p in self.document.findall(nodes.paragraph) if is_question(p)]
        for number, question in enumerate(questions):
            parent = question.parent
            start = parent.index(question) + 1
            following = parent[start : start + length_of_answer(parent[start:])]
            code, answer = parted(following)
            if answer:
                box = nodes.container(classes=["fpp-predict"], ids=[f"predict-{number}"])
                box += answer
                parent[start : start + len(following)] = [*code, box]


def is_question(node) -> bool:
    return isinstance(node, nodes.paragraph) and any(
        isinstance(child, nodes.emphasis) and child.astext() == PREDICT for child in node
    )


def length_of_answer(following) -> int:
    """How many of the nodes after a question belong to its answer."""
    ends = (k for k, node in enumerate(following) if is_question(node) or is_heading(node))
    following = following[: next(ends, len(following))]
    shown = next((k for k, node in enumerate(following) if has_output(node)), -1)
    told = range(shown + 1, len(following))
    k = next((k for k in told if isinstance(following[k], nodes.paragraph)), len(following) - 1)
    runs_on = any(isinstance(node, EQUATION) for node in following[k + 1 : k + 2])
    return k if runs_on else k + 1


def parted(following) -> tuple[list, list]:
    """What stays open of the nodes up to the end of an answer, and what is closed."""
    code, answer = [], []
    shown = next((k for k, node in enumerate(following) if has_output(node)), 0)
    for k, node in enumerate(following):
        if is_cell(node):
            source, output = parts_of_cell(node)
            code += source
            answer += output
        else:
            (code if k < shown else answer).append(node)
    return code, answer


def parts_of_cell(cell) -> tuple[list, list]:
    """A cell of the code alone, and one of the outputs; either may be missing."""
    if is_folded(cell):
        return [cell], []
    parts = [], []
    for child in cell:
        part = parts[child.get("nb_element") != "cell_code_source"]
        if not part:
            part.append(cell.copy())
        part[0] += child
    return parts


def is_cell(node) -> bool:
    return isinstance(node, nodes.container) and node.get("nb_element") == "cell_code"


def is_folded(node) -> bool:
    """Whether it is a cell that is folded with its outputs."""
    return is_cell(node) and node.get("hide_mode") == "all"


def is_heading(node) -> bool:
    return isinstance(node, (nodes.section, nodes.title))


def has_output(node) -> bool:
    return not is_folded(node) and any(
        isinstance(part, (nodes.figure, nodes.image, nodes.table))
        or ("cell_output" in part.get("classes", ()) and len(part))
        for part in node.findall(nodes.Element)
    )


# --- pages ---------------------------------------------------------------------------------


def load_script(app, pagename, templatename, context, doctree):
    if re.search(r"fpp-answer|fpp-predict", context.get("body") or ""):
        app.add_js_file("exercises.js", loading_method="defer")
        app.add_css_file("exercises.css")


def setup(app):
    app.add_transform(AnswerFields)
    app.add_transform(Predictions)
    app.connect("doctree-resolved", unlink_solutions, priority=900)
    app.connect("html-page-context", load_script)
    return {"env_version": 2, "parallel_read_safe": True, "parallel_write_safe": True}
