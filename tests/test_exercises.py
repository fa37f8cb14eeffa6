"""Every exercise of a chapter has a solution that is right, and `check` helps step by step."""

import json
import re
from pathlib import Path

import pytest

from fpputil import exercises

CHAPTERS = sorted((Path(__file__).parents[1] / "chapters").glob("[0-9]*.ipynb"))


def sources(path):
    return ["".join(c["source"]) for c in json.loads(path.read_text())["cells"]]


def asked(path):
    return set(re.findall(r"check\(\s*\"(\d+\.\d+)\"", "\n".join(sources(path))))


@pytest.fixture(autouse=True)
def _from_the_first_hint():
    exercises.reset()


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
    keys = asked(path)
    assert len(keys) >= 4 and all(k.startswith(f"{chapter}.") for k in keys)
    for key in keys:
        assert f"Exercise {key}: right." in printed, key
        assert f"Exercise {key}: not yet." not in printed or "raises" in printed
        exercises.find(key)
    registered = {k for k in exercises.EXERCISES if k.startswith(f"{chapter}.")}
    assert registered == keys, "every entry belongs to an exercise of the chapter"


@pytest.mark.parametrize(
    "answer", [None, "text", object(), [], float("nan"), float("inf"), 10**400, lambda: 1 / 0]
)
@pytest.mark.parametrize("path", CHAPTERS, ids=lambda p: p.stem)
def test_answers_of_the_wrong_kind_are_refused_and_told(path, answer):
    for key in asked(path):
        assert exercises.find(key).diagnose(answer), key


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("99.1", "exercise 99.1 given; chapters 1 to 12 have exercises"),
        ("3.9", "exercise 3.9 given; chapter 3 has 3.1, 3.2, 3.3, 3.4, 3.5"),
        ("three", "exercise three given"),
    ],
)
def test_unknown_exercise(key, says):
    with pytest.raises(ValueError, match=re.escape(says)):
        exercises.check(key, 0)


def test_a_number_names_an_exercise_as_well_as_its_text(capsys):
    exercises.check(3.1, 1.107)
    assert capsys.readouterr().out == "Exercise 3.1: right.\n"
    for path in CHAPTERS:  # else 3.1 and 3.10 would be one number
        assert all(len(key.split(".")[1]) == 1 for key in asked(path))


def test_the_help_grows_with_wrong_answers(capsys):
    def said(answer):
        exercises.check("11.4", answer)
        return capsys.readouterr().out

    first, second, third = exercises.find("11.4").hints
    sign = "Exercise 11.4: not yet. The size is right, the sign is wrong.\n"
    nearly = "Exercise 11.4: Right as far as it goes; give four digits, rounded.\n"
    assert said(-0.5556) == sign
    assert said(0.556) == nearly  # no wrong answer, no hint
    assert said(-0.5556) == f"{sign}Hint 1 of 3: {first}\n"
    assert said(0.5) == f"Exercise 11.4: not yet.\nHint 2 of 3: {second}\n"
    assert said(0.5) == said(0.5) == f"Exercise 11.4: not yet.\nHint 3 of 3: {third}\n"
    assert said(0.5556) == "Exercise 11.4: right.\n"
    assert said(-0.5556) == sign  # begins again
    exercises.reset()
    assert said(-0.5556) == sign


def test_every_exercise_has_hints():
    for path in CHAPTERS:
        for key in asked(path):
            hints = exercises.find(key).hints
            assert len(hints) >= 2 and all(h[-1] in ".?" and h.isascii() for h in hints), key
