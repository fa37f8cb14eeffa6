"""Pitches as people give them: periods, any order, rounded, begun as a sine, on any projector."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fpputil.capture.faults.diagnosis import diagnose
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns, start_angle
from fpputil.capture.photographs import open_capture
from fpputil.capture.quality import Reason
from fpputil.capture.virtual import photograph
from fpputil.cli import main
from fpputil.optics import shapes
from fpputil.optics.fringes import Fringe, fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import preset
from fpputil.optics.view import View

SYSTEM = preset("small").system
W, H = PROJECTOR = (912, 1140)
EIGHT = Patterns(PROJECTOR, fringe_set((912, 114, 19), 8))
WIDTHS = (800, 912, 1024, 1280, 1824, 1920, 3840)
OPTIMUM = [(n * n, n * n - 1, n * n - n) for n in range(3, 11)]  # Towers, Jones and Towers
BY_BEATS = [  # two beats that differ by one period
    (n, n - a, n - 2 * a + 1)
    for n in (30, 36, 48, 56, 64, 70, 73, 81, 90, 100, 128)
    for a in (3, 4, 5, 6, 9)
]
PAIRS = [(n, n - 1) for n in (4, 8, 12, 16, 20)]
SETS = [*OPTIMUM, *BY_BEATS, *PAIRS, (10, 9, 8), (100, 99, 90), (64, 63, 56), (70, 64, 59)]


def wall(width):
    """A view that shows each projector column, and the borders of the first and the last."""
    u = np.tile(np.r_[-0.499, np.arange(width), width - 0.501], (4, 1))
    return View(u, 0 * u, 0 * u + 0.8, 0 * u + 1, u == u)


def taken(folder, view, shown, system=SYSTEM, given=None, **camera):
    """The measurement of a view, and its capture; as if other patterns had been projected."""
    given = given or shown
    names = {(s.fringe, s.step): s.file for s in given.shots()}
    for shot in shown.shots():
        fringe = shown.fringes[shot.fringe]
        frame = view.frames(fringe, steps=[shown.shown(shot)], seed=shot.step, **camera)[0]
        np.save(folder / names[shot.fringe, shot.step], frame)
    capture = open_capture(folder, given)
    return measure(capture, given.axes[0]), capture


EVERY = sorted(set(SETS))
SOME = [EVERY[k :: len(WIDTHS)] for k in range(len(WIDTHS))]  # each set on one of the projectors


@pytest.mark.parametrize(
    "width, sets",
    [
        *zip(WIDTHS, SOME, strict=True),
        *(pytest.param(width, EVERY, marks=pytest.mark.slow) for width in WIDTHS),
    ],
    ids=[*(f"some {width}" for width in WIDTHS), *(f"all {width}" for width in WIDTHS)],
)
def test_sets_of_the_heterodyne_kind_give_the_columns(tmp_path, width, sets):
    assert len(EVERY) >= 60
    for periods in sets:
        fringes = fringe_set([width / n for n in periods], 4)
        patterns = Patterns((width, 100), fringes, "mw", files="{periods}-{step}.npy")
        result, _ = taken(tmp_path, wall(width), patterns, quantise=False)
        assert result.mask.mean() > 0.98, periods  # but for the border's noise
        off = np.abs(result.coordinate - wall(width).column)[result.mask]
        assert off.max() < 0.01, periods


def test_rounded_pitches_are_taken_and_their_ambiguous_borders_left_out(tmp_path):
    exact = Patterns((1920, 100), fringe_set([1920 / n for n in (70, 64, 59)], 4), "mw",
                     files="{step}-{pitch}.npy")  # fmt: skip
    rounded = replace(exact, fringes=fringe_set((27.43, 30, 32.54), 4))
    view = wall(1920)
    result, capture = taken(tmp_path, view, rounded, quantise=False)
    off = np.abs(result.coordinate - view.column)[result.mask]
    assert off.max() < 0.01 and 0.98 < result.mask.mean() < 1
    border = (view.column < 1) | (view.column > 1918)  # the beat is 1.6 columns short
    assert (result.reason[border] == Reason.OUTSIDE).all()
    result, capture = taken(tmp_path, view, exact, given=rounded, quantise=False)
    off = np.abs(result.coordinate - view.column)[result.mask]
    assert off.max() < 0.2  # what rounding does to the finest pitch over 70 periods
    assert not any(f.severe for f in diagnose(result, capture))


@pytest.fixture(scope="module")
def view():
    return raycast(shapes.sphere(100, [0, 0, 660]), SYSTEM)


MF, MW = ("mf", (912, 114, 19)), ("mw", [912 / n for n in (64, 63, 56)])
BEGUN = [(*one, start) for one in (MF, MW) for start in ("sine", -120, "black")]


@pytest.mark.parametrize("unwrap, pitches, start", BEGUN, ids=[f"{u} {s}" for u, _, s in BEGUN])
def test_fringes_that_begin_otherwise_are_named_and_taken(tmp_path, view, unwrap, pitches, start):
    files = "{pitch}-{step}.npy"
    begun = Patterns(
        PROJECTOR, fringe_set(pitches, 6, start=start_angle(start)), unwrap, files=files
    )
    plain = replace(begun, fringes=fringe_set(pitches, 6))
    result, capture = taken(tmp_path, view, begun, given=plain, noise=1.0)
    findings = [f for f in diagnose(result, capture) if f.severe]
    assert findings and all(f.code == "offset" for f in findings)
    assert f"give --start {start} if" in findings[0].remedy
    right = replace(capture, patterns=begun)
    result = measure(right)
    assert not any(f.severe for f in diagnose(result, right))
    assert np.abs(result.coordinate - view.column)[result.mask].max() < 1


def test_by_beats_a_start_of_a_twelfth_of_a_period_is_noticed(tmp_path, view):
    begun = Patterns(
        PROJECTOR, fringe_set(MW[1], 6, start=np.radians(30)), "mw", files="{pitch}-{step}.npy"
    )
    plain = replace(begun, fringes=fringe_set(MW[1], 6))
    result, capture = taken(tmp_path, view, begun, given=plain, noise=1.0)
    assert {f.code for f in diagnose(result, capture) if f.severe} == {"offset"}


def test_the_order_of_the_files_is_free(tmp_path, view):
    for unwrap, pitches in (("mf", (19, 912, 114)), ("mw", (16, 14, 15)), ("minimum", (18, 304))):
        patterns = Patterns(PROJECTOR, fringe_set(pitches, (4, 5, 6)[: len(pitches)]), unwrap)
        for shot, frame in photograph(view, patterns, SYSTEM, 0, noise=1.0):
            cv2.imwrite(str(tmp_path / shot.file), frame)
        capture = open_capture(tmp_path, patterns)
        result = measure(capture, system=SYSTEM if unwrap == "minimum" else None)
        assert result.pitch == min(pitches)
        assert np.abs(result.coordinate - view.column)[result.mask].max() < 1
        assert not any(f.severe for f in diagnose(result, capture))


def test_periods_and_starts_are_written_and_read(tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(
        'projector = [1920, 1080]\nunwrap = "mw"\nstart = "sine"\n'
        + "".join(f"[[fringes]]\nperiods = {n}\nsteps = 4\n" for n in (70, 64, 59))
        + '[[fringes]]\naxis = "row"\nperiods = 1\nsteps = 4\nstart = 30\n'
    )
    patterns = Patterns.load(path)
    assert [f.pitch for f in patterns.fringes] == [1920 / 70, 30, 1920 / 59, 1080]
    assert [f.start for f in patterns.fringes] == [-np.pi / 2] * 3 + [np.pi / 6]
    patterns.save(path)
    assert Patterns.load(path) == patterns
    named = replace(patterns, files="{axis}{periods}-{step}.png").shots()
    assert named[0].file == "column70-0.png" and named[-1].file == "row1-3.png"
    lines = [patterns.picture(shot)[0] for shot in patterns.shots()[:4]]
    x = np.arange(1920)
    for n, line in enumerate(lines):
        light = 127.5 * (1 + np.sin(2 * np.pi * 70 * x / 1920 + np.pi / 2 * n))
        assert np.abs(line - light).max() <= 0.5 + 1e-9


@pytest.mark.parametrize(
    "entry, said",
    [
        ('start = "tangent"\nprojector = [9, 9]\n[[fringes]]\npitch = 9\nsteps = 3', "start 'tang"),
        ("projector = [9, 9]\n[[fringes]]\nsteps = 3", "of pitch and periods, one is needed"),
        ("projector = [9, 9]\n[[fringes]]\nsteps = 3\nperiods = 0", "periods 0 given"),
        ("projector = []\n[[fringes]]\nsteps = 3\nperiods = 1", "p.toml: "),
    ],
)
def test_what_a_file_cannot_say_is_named(tmp_path, entry, said):
    (tmp_path / "p.toml").write_text(entry)
    with pytest.raises(ValueError, match="p.toml: ") as error:
        Patterns.load(tmp_path / "p.toml")
    assert said in str(error.value)


@pytest.mark.parametrize(
    "words, said",
    [
        ("--pitches 1 8 48 --projector 1920x1080", "these look like periods: 48 8 1 of them over"),
        ("--pitches 42 45 48 --projector 1920x1080", "they would do (unwrap mw)"),
        ("--pitches 1824 114 19", "likely to be wider than 912 x 1140, the default: give --proj"),
        ("--pitches 42 45 48 --unwrap mw", "tell 5040 pixels apart"),
        ("--periods 1 8 48", "--periods without --projector given"),
        ("--periods 1 --pitches 912", "--pitches and --periods given"),
        ("--periods 1 0 --projector 912x1140", "periods 0.0 given"),
        ("--start sine 30 --pitches 912", "2 starts and 1 pitches given"),
        ("--start sideways", "start 'sideways' given; one of cosine, sine, black, or degrees"),
    ],
)
def test_pitches_that_do_not_do_are_told_what_would(tmp_path, capsys, words, said):
    assert main(["patterns", str(tmp_path / "p"), *words.split()]) == 1
    assert said in capsys.readouterr().err


def test_periods_of_the_command_are_fractions_of_each_side(tmp_path):
    words = "--projector 1920x1080 --periods 70 64 59 --unwrap mw --steps 3 --axis both"
    assert main(["patterns", str(tmp_path / "p"), *words.split(), "--no-plain"]) == 0
    fringes = Patterns.load(tmp_path / "p" / "patterns.toml").fringes
    assert [f.pitch for f in fringes] == [s / n for s in (1920, 1080) for n in (70, 64, 59)]


def test_a_wider_projector_is_asked_for_and_the_start_taken_beside_a_file(tmp_path, capsys, view):
    shots = tmp_path / "shots"
    shots.mkdir()
    begun = replace(EIGHT, fringes=fringe_set((912, 114, 19), 4, start=-np.pi / 2))
    for shot, frame in photograph(view, begun, SYSTEM, 0, noise=1.0):
        cv2.imwrite(str(shots / shot.file), frame)
    replace(begun, fringes=fringe_set((912, 114, 19), 4)).save(shots / "patterns.toml")
    words = ["decode", str(shots), "--no-report", "--no-pictures", "--force"]
    assert main(words) == 1
    assert "give --start sine" in capsys.readouterr().err
    assert main([*words, "--start", "sine"]) == 0
    files = ["--files", "column-{pitch}-{step:02}.png", "--steps", "4", "--start", "-90"]
    assert main([*words, *files, "--pitches", "912", "114", "19"]) == 0
    capsys.readouterr()
    assert main([*words, *files, "--pitches", "1824", "114", "19"]) == 1
    assert "give --projector WIDTHxHEIGHT" in capsys.readouterr().err


@pytest.mark.parametrize("steps", [3, 4, 6, 8])
@pytest.mark.parametrize("rolled", [912, 114, 19])
def test_one_pitch_that_begins_with_another_step_is_not_taken_for_a_start_of_all(
    tmp_path, view, rolled, steps
):
    patterns = replace(EIGHT, fringes=fringe_set((912, 114, 19), steps), files="{pitch}-{step}.npy")
    fringes = (replace(f, start=2 * np.pi / steps * (f.pitch == rolled)) for f in patterns.fringes)
    shown = replace(patterns, fringes=tuple(fringes))
    findings = diagnose(*taken(tmp_path, view, shown, given=patterns, noise=1.0))
    assert not any("--start" in f.remedy for f in findings)


@pytest.mark.parametrize("periods", [(64, 63, 56), (70, 64, 59)])
def test_periods_that_were_given_as_pitches_are_named(tmp_path, view, periods):
    files = "{step}-{pitch}.npy"
    shown = Patterns(PROJECTOR, fringe_set([W / n for n in periods], 6), "mw", files=files)
    given = replace(shown, fringes=fringe_set(periods, 6))
    result, capture = taken(tmp_path, view, shown, given=given, noise=1.0)
    findings = [f for f in diagnose(result, capture) if f.severe]
    assert findings and "look like periods" in findings[0].remedy


def test_each_pitch_may_count_its_steps_on(tmp_path):
    counted = Patterns(
        PROJECTOR, fringe_set((912, 114), 3), files="IMG_{step:03}.png", first=(1, 4)
    )
    assert [s.file[4:7] for s in counted.shots()] == ["001", "002", "003", "004", "005", "006"]
    counted.save(tmp_path / "p.toml")
    assert Patterns.load(tmp_path / "p.toml") == counted
    with pytest.raises(ValueError, match=r"first \[1, 2, 3\] given; one number, or one of each"):
        replace(counted, first=(1, 2, 3))


def test_a_start_is_part_of_the_fringe():
    fringe = Fringe(24, 4, start=-np.pi / 2)
    column = np.array([0.0, 6.0, 12.0, 18.0])
    assert fringe.intensity(column, 0).round(6).tolist() == [127.5, 255, 127.5, 0]
    with pytest.raises(ValueError, match="start nan given"):
        Fringe(24, 4, start=float("nan"))
