"""Photographs under the names that people and programs give them, in any script and folder."""

import os
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from fpputil.capture.folder import decode_folder
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.cli import main
from fpputil.optics.fringes import Fringe

FRINGES = tuple(Fringe(pitch, 4) for pitch in (48, 24, 12))
PATTERNS = Patterns((48, 32), FRINGES, files="{pitch}-{step}.png")
U = np.arange(48.0)


@pytest.fixture
def folder(tmp_path):
    """Photographs of a flat wall, a camera pixel a projector pixel, and the pattern file."""
    (tmp_path / "shots").mkdir()
    for shot in PATTERNS.shots():
        write(tmp_path / "shots" / shot.file, FRINGES[shot.fringe], shot.step)
    PATTERNS.save(tmp_path / "shots" / "patterns.toml")
    return tmp_path / "shots"


def write(path, fringe, step):
    path.parent.mkdir(exist_ok=True)
    line = 20 + 0.8 * fringe.intensity(U, step)
    image = np.tile(np.rint(line).astype(np.uint8), (32, 1))
    path.write_bytes(cv2.imencode(".png", image)[1].tobytes())


def decoded(folder, patterns=None):
    """Whether the columns of a folder are those of the wall."""
    result = decode_folder(folder, patterns=patterns, report=False, pictures=False, force=True)
    columns = result.measurements[0].coordinate
    known = np.isfinite(columns)
    assert known[:, 4:-4].all()
    return np.abs(columns - U)[known].max() < 0.2


def renamed(folder, name):
    """Give each photograph another name: a function of pitch and step."""
    for shot in PATTERNS.shots():
        path = folder / name(FRINGES[shot.fringe].pitch, shot.step)
        path.parent.mkdir(exist_ok=True)
        (folder / shot.file).rename(path)
    (folder / "patterns.toml").unlink()
    return folder


PER_FRINGE = {
    "a template each": (
        lambda pitch, step: f"{'abc'[(48, 24, 12).index(pitch)]}{step + 1}.png",
        {"files": ["a{step}.png", "b{step}.png", "c{step}.png"], "first": 1},
    ),
    "a star each": (
        lambda pitch, step: f"p{pitch}_{step}.png",
        {"files": ["p48*", "p24*", "p12*"]},
    ),
    "a folder each": (
        lambda pitch, step: f"pitch {pitch}/IMG_{9 + step}.png",
        {"files": ["pitch 48/*.png", "pitch 24/*.png", "pitch 12/*.png"]},
    ),
    "one template with folders": (
        lambda pitch, step: f"{pitch}/{step}.png",
        {"files": "{pitch}/{step}.png"},
    ),
    "a list each": (
        lambda pitch, step: f"{'xzy'[(48, 24, 12).index(pitch)]}{3 - step}.png",
        {"files": [[f"{c}{k}.png" for k in (3, 2, 1, 0)] for c in "xzy"]},
    ),
    "all names in time": (
        lambda pitch, step: f"{'xzy'[(48, 24, 12).index(pitch)]}{step}.png",
        {"files": [f"{c}{k}.png" for c in "xzy" for k in range(4)]},
    ),
    "all names by step": (
        lambda pitch, step: f"{'xzy'[(48, 24, 12).index(pitch)]}{step}.png",
        {"files": [f"{c}{k}.png" for k in range(4) for c in "xzy"], "order": "step"},
    ),
}


@pytest.mark.parametrize("name, entries", PER_FRINGE.values(), ids=PER_FRINGE)
def test_files_of_each_fringe(folder, name, entries):
    patterns = replace(PATTERNS, **entries)
    renamed(folder, name)
    assert decoded(folder, patterns)
    patterns.save(folder / "patterns.toml")
    assert Patterns.load(folder / "patterns.toml") == patterns and decoded(folder)


def test_files_stand_with_their_fringe_in_a_pattern_file(folder):
    renamed(folder, lambda pitch, step: f"{pitch}/{step}.png")
    text = "projector = [48, 32]\n"
    for pitch in (48, 24, 12):
        text += f'[[fringes]]\npitch = {pitch}\nsteps = 4\nfiles = "{pitch}/*.png"\n'
    (folder / "patterns.toml").write_text(text, encoding="utf-8")
    assert decoded(folder)
    (folder / "patterns.toml").write_text(text.replace('files = "24/*.png"', ""), encoding="utf-8")
    with pytest.raises(ValueError, match="files of 2 of 3 fringes found"):
        open_capture(folder)


@pytest.mark.parametrize(
    "files, said",
    [
        (["a*", "b*"], "2 files given; one name for all, or for each of the 3 fringes"),
        (["a*", "b*", ["c0", "c1"]], "2 files of fringe 3 given; it has 4 steps"),
        (["a*", "b*", "/c*"], "names in the folder, or in one inside it"),
        (["a*", "b*", "..\\c*"], "names in the folder, or in one inside it"),
        (["a*", "b*", 3], "names in the folder, or in one inside it"),
    ],
)
def test_files_that_cannot_be(files, said):
    with pytest.raises(ValueError) as error:
        replace(PATTERNS, files=files)
    assert said in str(error.value)


def test_a_star_of_a_fringe_that_finds_another_number_is_named(folder):
    patterns = replace(PATTERNS, files=["48-*", "24-*", "*"])
    with pytest.raises(
        ValueError, match=r"12 files match '\*'; fringe 3, along the columns, has 4 steps"
    ):
        open_capture(folder, patterns)


def test_the_command_takes_a_name_for_each_pitch_and_names_of_all(folder):
    (folder / "patterns.toml").unlink()
    fringes = ["--pitches", "48", "24", "12", "--steps", "4", "--projector", "48x32", "--no-report"]
    assert main(["decode", str(folder), "--files", "48-*", "24-*", "12-*", *fringes]) == 0
    names = [shot.file for shot in PATTERNS.shots()]
    assert main(["decode", str(folder), "--force", "--files", *names, *fringes]) == 0
    with np.load(folder.with_name("shots-decoded") / "decoded.npz") as file:
        assert np.nanmax(np.abs(file["column_coordinate"] - U)) < 0.2


def test_hidden_and_foreign_files_are_passed_over(folder):
    named = replace(PATTERNS, files="*.png")
    order = {shot.file: f"{k:02}.png" for k, shot in enumerate(PATTERNS.shots())}
    for old, new in order.items():
        (folder / old).rename(folder / new)
    (folder / "._00.png").write_bytes(b"\0\5\x16\7Mac OS X")
    for name in (".ipynb_checkpoints", "__MACOSX", "old-decoded"):
        (folder / name).mkdir()
        (folder / name / "00.png").write_bytes(b"no picture")
    assert decoded(folder, named)


@pytest.mark.parametrize("here", [".", "./", "../shots"])
def test_the_folder_one_is_in(folder, monkeypatch, here):
    monkeypatch.chdir(folder)
    assert main(["decode", here, "--no-report"]) == 0
    assert (folder.with_name("shots-decoded") / "decoded.npz").is_file()


def test_the_folder_above(folder, monkeypatch):
    (folder / "inside").mkdir()
    monkeypatch.chdir(folder / "inside")
    assert main(["decode", "..", "--no-report"]) == 0
    assert (folder.with_name("shots-decoded") / "decoded.npz").is_file()


def test_a_pattern_file_of_an_editor_that_marks_utf_8(folder):
    path = folder / "patterns.toml"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert decoded(folder)


def test_photographs_whose_names_are_not_utf_8(undrawn, folder):
    for shot in PATTERNS.shots():
        name = b"caf\xe9 %d-%d.png" % (shot.fringe, shot.step)
        (folder / shot.file).rename(folder / os.fsdecode(name))
    assert decoded(folder, replace(PATTERNS, files="*.png"))
    first, second = (folder / os.fsdecode(b"caf\xe9 2-%d.png" % n) for n in (0, 2))
    second.write_bytes(first.read_bytes())  # one photograph twice
    result = decode_folder(folder, patterns=replace(PATTERNS, files="*.png"), force=True)
    assert (result.out / "report.html").is_file()


SCRIPTS = ["Grüße", "相机 标定", "камера", "صور"]
CHECK = """
import io, sys, warnings
warnings.filterwarnings("error", category=EncodingWarning, module="fpputil")
from fpputil.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [*map(os.fsencode, SCRIPTS), b"caf\xe9"], ids=[*SCRIPTS, "latin-1"]
)
def test_names_in_any_script_where_another_encoding_is_preferred(folder, name):
    """As ASCII is here, as gbk and cp1252 are on Windows; a text file opened by it is an error."""
    patterns = replace(PATTERNS, files="ä{pitch}-{step}.png", white="weiß.png")
    for shot, new in zip(PATTERNS.shots(), patterns.shots()[1:], strict=True):
        (folder / shot.file).rename(folder / new.file)
    write(folder / "weiß.png", Fringe(1e9, 3), 0)
    patterns.save(folder / "patterns.toml")
    folder.rename(folder.parent / os.fsdecode(name))
    environment = {**os.environ, "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    command = [sys.executable, "-X", "warn_default_encoding", "-c", CHECK, "decode", name]
    run = subprocess.run(command, cwd=folder.parent, env=environment, capture_output=True)
    assert run.returncode == 0 and b"columns: 100.0%" in run.stdout, run.stderr
    results = sorted(os.listdir(os.fsencode(folder.parent) + b"/" + name + b"-decoded"))
    assert {b"decoded.npz", b"report.html", b"summary.json"} <= set(results)
