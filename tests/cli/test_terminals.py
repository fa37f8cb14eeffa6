"""Results are whole, and said to be, whatever terminal and names there are."""

import os
import subprocess
import sys

import pytest

from fpputil.capture import Patterns, photograph_into
from fpputil.optics import fringe_set, raycast, shapes

pytestmark = pytest.mark.slow

LATIN_1 = os.fsdecode(b"sh\xf6ts")  # not UTF-8, as old sticks and archives have it


@pytest.fixture(scope="module")
def room(tmp_path_factory, tiny):
    """A folder with the same photographs under three names."""
    room = tmp_path_factory.mktemp("room")
    view = raycast(shapes.sphere(100, [0, 0, 660]), tiny.system)
    for name in ("shots", "снимки", LATIN_1):
        patterns = Patterns((912, 1140), fringe_set((912, 114, 24), 4))
        photograph_into(room / name, view, patterns, tiny.system)
    return room


def decode(room, name, redirection="", **environment):
    """Decode in a shell of its own; the finished process."""
    call = [sys.executable, "-m", "fpputil.cli", "decode", name, "--system", "tiny", "--force"]
    script = f'exec "$@" {redirection}'
    environment = os.environ | {"PYTHONUNBUFFERED": ""} | environment
    return subprocess.run(
        ["sh", "-c", script, "sh", *call], cwd=room, env=environment, capture_output=True
    )


@pytest.mark.parametrize(
    "redirection, code, said",
    [
        (">/dev/full", 1, b"printing; files that were written are whole"),
        (">&-", 0, b""),
        ("2>&-", 0, b""),
        ("2>/dev/full", 0, b""),
        ("<&- >&- 2>&-", 0, b""),
        (">/dev/full 2>/dev/full", 1, b""),
    ],
)
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_terminal_that_is_gone(redirection, code, said, unbuffered, room):
    out = room / "shots-decoded"
    before = out.stat().st_ino if out.exists() else None
    run = decode(room, "shots", redirection, PYTHONUNBUFFERED=unbuffered)
    assert run.returncode == code and said in run.stderr
    assert b"nothing was written" not in run.stderr and b"Traceback" not in run.stderr
    assert out.stat().st_ino != before and (out / "points.ply").stat().st_size > 90_000
    if redirection == "2>&-":
        assert b"points in" in run.stdout


def test_decoding_loads_what_it_needs(room):
    """Neither what draws nor what writes points, if nothing is drawn and there are no points."""
    code = (
        "import sys; from fpputil.cli import main\n"
        "main(['decode', 'shots', '--out', 'lean', '--no-report', '--no-pictures'])\n"
        "print({'matplotlib', 'trimesh', 'embreex', 'numba', 'torch'} & set(sys.modules))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=room, capture_output=True, check=True)
    assert run.stdout.endswith(b"set()\n"), run.stdout


@pytest.mark.parametrize("name", ["снимки", LATIN_1])
@pytest.mark.parametrize(
    "locale",
    [
        {"LC_ALL": "C.UTF-8"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"PYTHONIOENCODING": "ascii"},
    ],
)
def test_names_in_any_script(name, locale, room):
    run = decode(room, name, **locale)
    assert run.returncode == 0 and run.stderr == b""
    assert b"points in" in run.stdout
    page = (room / os.fsdecode(os.fsencode(name) + b"-decoded") / "report.html").read_text("utf-8")
    assert name in page or r"sh\xf6ts" in page
