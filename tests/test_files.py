"""Files and folders are written whole or not at all, and never over a person's own."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from fpputil import files
from fpputil.files import MARK, folder_whole, write_whole


def fill(path, text="new", by="fpp decode", force=True, inputs=()):
    with folder_whole(path, by, force, inputs) as folder:
        (folder / "sub").mkdir()
        (folder / "sub" / "a.txt").write_text(text, encoding="utf-8")


def content(path):
    return (path / "sub" / "a.txt").read_text(encoding="utf-8")


@pytest.fixture
def out(tmp_path):
    """A folder of results."""
    (tmp_path / "room").mkdir()
    fill(tmp_path / "room" / "out", "old")
    return tmp_path / "room" / "out"


def two_steps(monkeypatch):
    """A file system that cannot exchange two folders at once."""
    monkeypatch.setattr(files, "_exchanged", lambda a, b: False)


@pytest.mark.parametrize("at_once", [True, False])
def test_results_are_replaced_by_force(at_once, out, monkeypatch):
    if not at_once:
        two_steps(monkeypatch)
    with pytest.raises(ValueError, match="out is not empty; name another folder, or use --force"):
        fill(out, force=False)
    fill(out)
    assert content(out) == "new" and os.listdir(out.parent) == ["out"]


FOREIGN = {
    "a file of one's own": (lambda p: (p / "thesis.tex").write_text("x"), "holds thesis.tex, not"),
    "two of them": (lambda p: [(p / n).touch() for n in "ab"], "holds a and 1 more, not"),
    "a changed file": (lambda p: (p / "sub/a.txt").write_text("mine"), "holds sub/a.txt, not as"),
    "a hidden one": (lambda p: (p / "sub/.x").touch(), "holds sub/.x, not as `fpp decode` wrote"),
    "a link": (lambda p: (p / "link").symlink_to("/"), "holds link, not as"),
    "a pipe": (lambda p: os.mkfifo(p / "pipe"), "holds pipe, not as"),
    "no mark": (lambda p: (p / MARK).unlink(), "holds sub/a.txt, not as"),
    "a broken mark": (lambda p: (p / MARK).write_text("[1]"), "holds sub/a.txt, not as"),
    "an endless mark": (lambda p: (p / MARK).write_text("[" * 100_000), "holds sub/a.txt, not as"),
    "another command's": (
        lambda p: (p / MARK).write_text((p / MARK).read_text().replace("decode", "render")),
        "holds results of `fpp render`; `fpp decode --force` replaces its own results alone",
    ),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_force_replaces_only_what_the_command_wrote(name, out):
    change, message = FOREIGN[name]
    change(out)
    before = sorted(out.rglob("*"))
    with pytest.raises(ValueError, match=message):
        fill(out)
    assert sorted(out.rglob("*")) == before and os.listdir(out.parent) == ["out"]


@pytest.mark.parametrize("below", [".", "shots", "shots/a.png"])
def test_a_folder_that_is_or_holds_an_input_stays(below, out):
    with pytest.raises(ValueError, match="out given for the results; .* lies there"):
        fill(out, inputs=[out / below])
    fill(out, inputs=[out.parent, out.parent / "outer"])


def test_the_current_directory_stays(out, monkeypatch):
    (out.parent / "empty" / "below").mkdir(parents=True)
    for here, there in (
        (out, "."),
        (out / "sub", ".."),
        (out.parent / "empty/below", "../../empty"),
    ):
        monkeypatch.chdir(here)
        with pytest.raises(ValueError, match="the current directory lies there"):
            fill(there)
    assert content(out) == "old"


@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize("force", [True, False])
def test_what_appears_during_the_work_stays(force, at_once, out, tmp_path, monkeypatch):
    if not at_once:
        two_steps(monkeypatch)
    place = out if force else tmp_path / "room" / "new"
    with pytest.raises(ValueError, match="holds thesis.tex, not|new is not empty"):
        with folder_whole(place, "fpp decode", force) as folder:
            (folder / "a.txt").touch()
            place.mkdir(exist_ok=True)
            (place / "thesis.tex").touch()
    assert (place / "thesis.tex").exists() and not (place / "a.txt").exists()
    assert len(os.listdir(place.parent)) == 1 + (not force)


def test_what_appears_at_the_last_moment_stays(out, monkeypatch):
    """Between the second look and the exchange."""
    exchange = files._exchanged

    def late(a, b):
        if not (out / "thesis.tex").exists():
            (out / "thesis.tex").touch()
        return exchange(a, b)

    monkeypatch.setattr(files, "_exchanged", late)
    with pytest.raises(ValueError, match="out holds thesis.tex, not"):
        fill(out)
    assert (out / "thesis.tex").exists() and content(out) == "old"
    assert os.listdir(out.parent) == ["out"]


def test_of_two_at_once_one_is_told(tmp_path):
    with pytest.raises(ValueError, match="out is not empty"):
        with folder_whole(tmp_path / "out", "fpp decode") as folder:
            (folder / "first").touch()
            fill(tmp_path / "out", "second", force=False)
    assert content(tmp_path / "out") == "second" and os.listdir(tmp_path) == ["out"]


@pytest.mark.parametrize("kind", ["error", "ctrl-c"])
def test_an_error_leaves_what_was_there(kind, out):
    with pytest.raises(RuntimeError if kind == "error" else KeyboardInterrupt):
        with folder_whole(out, "fpp decode", force=True) as folder:
            (folder / "a.txt").touch()
            raise RuntimeError if kind == "error" else KeyboardInterrupt
    assert content(out) == "old" and os.listdir(out.parent) == ["out"]


@pytest.mark.parametrize("at", [1, 2, 3])
def test_a_rename_that_fails_brings_the_results_back(at, out, monkeypatch):
    """Where two folders cannot be exchanged at once; the first rename is onto a full folder."""
    two_steps(monkeypatch)
    rename, calls = os.rename, []

    def failing(a, b):
        calls.append(a)
        if len(calls) == at + 1:
            raise OSError(5, "Input/output error")
        return rename(a, b)

    monkeypatch.setattr(os, "rename", failing)
    with pytest.raises(OSError, match="Input/output"):
        fill(out)
    assert content(out) == ("new" if at == 3 else "old")
    monkeypatch.undo()
    fill(out, "newest")
    assert content(out) == "newest" and os.listdir(out.parent) == ["out"]


def test_results_left_aside_by_a_kill_come_back(out):
    os.rename(out, out.with_name("out.123-0a1b2c3d.old"))
    with pytest.raises(ValueError, match="not empty"):
        fill(out, force=False)
    assert content(out) == "old"
    os.rename(out, out.with_name("out.123-0a1b2c3d.old"))
    fill(out)
    assert content(out) == "new" and os.listdir(out.parent) == ["out"]


def test_litter_of_the_dead_is_removed(out):
    room = out.parent
    (room / "out.123-0a1b2c3d.part" / "sub").mkdir(parents=True)
    (room / "out.123-0a1b2c3d.part" / "sub" / "a.txt").touch()
    (room / "file.123-0a1b2c3d.part").touch()
    others = ["out.part", "out.old", "outer.123-0a1b2c3d.part", "out.1-0a1b2c3d.part.txt"]
    for name in others:
        (room / name).touch()
    fill(out)
    write_whole(room / "file", b"")
    assert set(os.listdir(room)) == {"out", "file", *others}


def test_a_folder_left_aside_with_a_persons_file_stays(out):
    aside = out.with_name("out.123-0a1b2c3d.old")
    fill(aside)
    (aside / "thesis.tex").touch()
    fill(out)
    assert (aside / "thesis.tex").exists()


def test_what_the_living_write_stays(out):
    code = (
        "import sys, time\nfrom fpputil.files import folder_whole\n"
        "with folder_whole(sys.argv[1], 'fpp decode', True) as folder:\n"
        "    print(flush=True)\n    time.sleep(60)"
    )
    run = [subprocess.Popen([sys.executable, "-c", code, out], stdout=subprocess.PIPE)]
    run[0].stdout.readline()
    fill(out)
    assert len(list(out.parent.glob("out.*.part"))) == 1
    run[0].kill()
    run[0].communicate()
    fill(out)
    assert os.listdir(out.parent) == ["out"]


def test_all_is_synced_before_it_has_its_name(tmp_path, monkeypatch):
    synced, fsync = [], os.fsync

    def watched(number):
        synced.append((os.readlink(f"/proc/self/fd/{number}"), (tmp_path / "out").exists()))
        fsync(number)

    monkeypatch.setattr(os, "fsync", watched)
    fill(tmp_path / "out")
    before = {os.path.basename(name) for name, there in synced if not there}
    assert {"a.txt"} < before and any(MARK in name for name in before)
    assert synced[-1] == (str(tmp_path), True)


REPLACE = """
import sys
from fpputil.files import folder_whole
with folder_whole(sys.argv[1], "fpp decode", True) as folder:
    for n in range(20):
        (folder / str(n)).write_text("x" * 1000)
"""


@pytest.mark.slow
@pytest.mark.parametrize("at_once", [True, False])
def test_killed_at_a_hundred_moments(at_once, tmp_path):
    """There is always a whole folder, after the next start at the latest, and then no litter."""
    out = tmp_path / "out"
    prelude = (
        "" if at_once else "from fpputil import files\nfiles._exchanged = lambda a, b: False\n"
    )
    call = [sys.executable, "-c", prelude + REPLACE, out]
    start = time.monotonic()
    subprocess.run(call, check=True)
    whole, killed = time.monotonic() - start, 0
    for n in range(50):
        run = subprocess.Popen(call)
        time.sleep(whole * (0.5 + n / 100))
        run.send_signal(signal.SIGKILL)
        killed += run.wait() == -signal.SIGKILL
        with folder_whole(tmp_path / "out", "fpp decode", force=True) as folder:
            assert len(os.listdir(out)) == 21 and json.loads((out / MARK).read_bytes())
            for f in out.iterdir():
                (folder / f.name).write_bytes(f.read_bytes()) if f.name != MARK else None
        assert os.listdir(tmp_path) == ["out"]
    assert killed > 10
