"""What is projected: names, order, pictures, and the file that says so."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fpputil.capture.files.names import natural
from fpputil.capture.patterns import Patterns
from fpputil.capture.virtual import photograph
from fpputil.optics.fringes import Fringe, fringe_set
from fpputil.optics.view import View

BOTH = (*fringe_set((48, 12), 4), *fringe_set((32, 8), (3, 5), axis="row"))


def test_a_file_reads_back_as_it_was(tmp_path):
    for given_ in (
        Patterns((48, 32), BOTH, white="w ü.png", black='b".png'),
        Patterns((48, 32), BOTH[:2], "nt", -1, "step", "*.tif", 3),
        Patterns((48, 32), (Fringe(47.5, 3),), "minimum", files="{pitch}_{step:3}.npy"),
        Patterns((48, np.int64(32)), [Fringe(np.float64(47.5), np.int64(3))]),
    ):
        given_.save(tmp_path / "patterns.toml")
        assert Patterns.load(tmp_path / "patterns.toml") == given_


def test_photographs_stand_in_the_order_of_time():
    patterns = Patterns((48, 32), BOTH[:2], white="white.png", black="black.png")
    files = [shot.file for shot in patterns.shots()]
    assert files[:4] == ["white.png", "black.png", "column-48-00.png", "column-48-01.png"]
    by_step = Patterns((48, 32), BOTH[:2], order="step", files="{pitch}-{step}.png", first=1)
    assert [s.file for s in by_step.shots()][:4] == ["48-1.png", "12-1.png", "48-2.png", "12-2.png"]
    assert [(s.fringe, s.step) for s in by_step.shots()][:3] == [(0, 0), (1, 0), (0, 1)]
    numbered = replace(by_step, files="{number:02}-{pitch}.png", white="00.png").shots()
    assert [s.file for s in numbered][:4] == ["00.png", "01-48.png", "02-12.png", "03-48.png"]


def test_a_star_takes_files_in_natural_order_but_not_the_plain_ones():
    patterns = Patterns((48, 32), (Fringe(48, 11),), files="*.png", white="0.png")
    names = [f"{n}.png" for n in range(12)] + ["notes.txt"]
    shots = patterns.shots(sorted(names))
    assert [s.file for s in shots] == [f"{n}.png" for n in range(12)]
    with pytest.raises(ValueError, match=r"10 files match '\*.png'; the fringes have 11 = 11"):
        patterns.shots(names[:11])
    numbered = [s.file for s in replace(patterns, white="white.png").shots(names)]
    assert numbered == [f"{n}.png" for n in range(12)]  # of which the first is the white one
    assert sorted(["a10", "a9", "a"], key=natural) == ["a", "a9", "a10"]


@pytest.mark.parametrize("shift", [1, -1])
def test_pictures_are_equation_one(shift):
    patterns = Patterns((48, 32), BOTH, shift=shift, white="w.png", black="b.png")
    white, black, *shots = patterns.shots()
    assert (patterns.picture(white) == 255).all() and (patterns.picture(black) == 0).all()
    v, u = np.indices((32, 48))
    for shot in shots:
        fringe = BOTH[shot.fringe]
        along = u if fringe.axis == "column" else v
        delta = shift * 2 * np.pi * shot.step / fringe.steps
        light = 127.5 * (1 + np.cos(2 * np.pi * along / fringe.pitch + delta))
        picture = patterns.picture(shot)
        assert picture.shape == (32, 48) and picture.dtype == np.uint8
        assert np.abs(picture - light).max() <= 0.5 + 1e-9


def test_a_white_wall_shows_the_pictures_themselves(tiny):
    """Seen with one camera pixel a projector pixel."""
    patterns = Patterns((912, 1140), (*fringe_set((912, 15), 4), Fringe(114, 3, "row")), shift=-1)
    v, u = np.mgrid[:40, :912].astype(float)
    view = View(u, v, np.ones_like(u), np.ones_like(u), u >= 0)
    for shot, frame in photograph(view, patterns, tiny.system):
        np.testing.assert_array_equal(frame, patterns.picture(shot)[:40])


@pytest.mark.parametrize(
    "entries, said",
    [
        ({"projector": (0, 5)}, "projector (0, 5) given; width and height"),
        (
            {"projector": (10**6, 5)},
            "width and height, 1 to 32768 pixels each",
        ),
        ({"fringes": ()}, "fringes () given; one Fringe or more"),
        ({"fringes": (BOTH[0], BOTH[2], BOTH[1])}, "fringes of both axes mixed"),
        ({"unwrap": "magic"}, "unwrap 'magic' given; one of mf, mw, nt, minimum"),
        ({"shift": 2}, "shift 2 given; one of 1, -1"),
        ({"shift": True}, "shift True given"),
        ({"shift": 1.0}, "shift 1.0 given; one of 1, -1"),
        ({"first": True}, "first True given"),
        (
            {"projector": (2**15, 2**15)},
            "pixels of the projector 1073741824 given; more than 268435456",
        ),
        (
            {"fringes": fringe_set((48, 12), 9000)},
            "photographs 18000 given; more than 16384 are refused",
        ),
        ({"order": "random"}, "order 'random' given"),
        ({"first": -1}, "first -1 given"),
        ({"files": "../{axis}-{pitch}-{step}.png"}, "names in the folder, or in one inside it"),
        ({"white": "/etc/white.png"}, "a name in the folder, or none"),
        (
            {"files": "{axis}-{pitch}-{step!r}.png"},
            "{axis}, {pitch}, {step} and {number} are known",
        ),
        (
            {"files": "{pitch.__class__}-{step}.png"},
            "{axis}, {pitch}, {step} and {number} are known",
        ),
        ({"files": "{pitch}.png"}, "would be several photographs"),
        ({"white": "column-48-00.png"}, "column-48-00.png would be several photographs"),
    ],
)
def test_what_is_wrong_is_named(entries, said):
    with pytest.raises(ValueError) as error:
        Patterns(**{"projector": (48, 32), "fringes": BOTH, **entries})
    assert said in str(error.value)


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "no list 'projector' found"),
        ("projector = [48, 32]", "no list 'fringes' found"),
        ("projector = [48, 32]\nfringes = [3]", "fringe 3 found"),
        ("projector = [48, 32]\n[[fringes]]\npitch = 3", "pitch and steps are needed"),
        ("projector = [48, 32]\n[[fringes]]\npitch = nan\nsteps = 3", "pitch nan given"),
        ("projector = [48, 32]\n[[fringes]]\npitch = 5\nsteps = 2", "2 steps given"),
        ("projector = [48.5, 32]\n[[fringes]]\npitch = 5\nsteps = 3", "projector (48.5, 32) given"),
        ("projector = [48, 32]\n[[fringes]]\npitch = true\nsteps = 3", "pitch True given"),
        ("projector = [48, 32]\n[[fringes]]\npitch = 5\nsteps = 1000000", "steps 1000000 given"),
        (f"projector = {'[' * 100_000}", "patterns.toml: "),
        ("colour = 3\nprojector = [48, 32]", "entry 'colour' found"),
        ("projector = [48", "patterns.toml: "),
    ],
)
def test_a_broken_file_is_named(tmp_path, text, said):
    path = tmp_path / "patterns.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match="patterns.toml") as error:
        Patterns.load(path)
    assert said in str(error.value)


SCALARS = st.one_of(
    st.integers(-3, 70000), st.floats(), st.booleans(), st.text(max_size=8), st.just([48, 32])
)
ENTRIES = st.dictionaries(
    st.sampled_from(["projector", "unwrap", "shift", "order", "files", "first", "white", "odd"]),
    SCALARS,
)
FRINGES = st.lists(
    st.dictionaries(st.sampled_from(["pitch", "steps", "axis", "gamma"]), SCALARS), max_size=3
)


def _written(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return "'" + "".join(c for c in value if c.isprintable() and c != "'") + "'"
    return str(value)


@pytest.mark.slow
@settings(max_examples=1500, deadline=None)
@given(ENTRIES, FRINGES, st.binary(max_size=6))
def test_any_file_is_read_or_refused(tmp_path_factory, entries, fringes, tail):
    path = tmp_path_factory.getbasetemp() / "fuzz.toml"
    lines = [f"{k} = {_written(v)}" for k, v in entries.items()]
    for fringe in fringes:
        lines += ["[[fringes]]", *(f"{k} = {_written(v)}" for k, v in fringe.items())]
    path.write_bytes("\n".join(lines).encode() + (tail if len(tail) > 3 else b""))
    try:
        Patterns.load(path)
    except ValueError as error:
        assert str(path) in str(error)
