"""Every exercise: its solution is accepted, and an answer of the wrong kind is not."""

import json
import re
from pathlib import Path

import pytest

from fpputil import exercises

CHAPTERS = sorted((Path(__file__).parents[1] / "chapters").glob("[0-9]*.ipynb"))


def sources(path):
    return ["".join(c["source"]) for c in json.loads(path.read_text())["cells"]]


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda p: p.stem)
def test_the_stored_solutions_are_right(path):
    """nbval runs the solutions; here: each exercise has one, and it was found right."""
    notebook = json.loads(path.read_text())
    chapter = int(path.stem.split("_")[0])
    printed = "".join(
        "".join(output.get("text", ""))
        for cell in notebook["cells"]
        for output in cell.get("outputs", ())
    )
    keys = set(re.findall(r"check\(\s*\"(\d+\.\d+)\"", "\n".join(sources(path))))
    assert len(keys) >= 4 and all(k.startswith(f"{chapter}.") for k in keys)
    for key in keys:
        assert f"Exercise {key}: right." in printed, key
        assert f"Exercise {key}: not yet." not in printed or "raises" in printed
        exercises.accepts(key, None)
    registered = {k for k in exercises.EXERCISES if k.startswith(f"{chapter}.")}
    assert registered == keys, "every checker belongs to an exercise of the chapter"


@pytest.mark.parametrize(
    "answer", [None, "text", object(), [], float("nan"), float("inf"), 10**400, lambda: 1 / 0]
)
@pytest.mark.parametrize("path", CHAPTERS, ids=lambda p: p.stem)
def test_answers_of_the_wrong_kind_are_refused(path, answer):
    keys = set(re.findall(r"check\(\s*\"(\d+\.\d+)\"", "\n".join(sources(path))))
    assert [k for k in keys if exercises.accepts(k, answer)] == []


def test_unknown_exercise():
    with pytest.raises(ValueError, match="exercise '99.1' given"):
        exercises.check("99.1", 0)


def test_check_prints_the_verdict_and_the_hint(capsys):
    exercises.EXERCISES["0.1"] = exercises.Exercise(lambda a: a == 3, "Count again.")
    try:
        assert exercises.check("0.1", 3) and not exercises.check("0.1", 4)
    finally:
        del exercises.EXERCISES["0.1"]
    assert capsys.readouterr().out == "Exercise 0.1: right.\nExercise 0.1: not yet. Count again.\n"
