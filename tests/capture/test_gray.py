"""Gray code with phase shifting and alone: columns, orders, faults, and the command."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from fpputil.capture.faults.diagnosis import diagnose
from fpputil.capture.folder import board_pose
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.virtual import photograph, photograph_into
from fpputil.cli import main
from fpputil.optics import shapes
from fpputil.optics.fringes import Fringe, fringe_set
from fpputil.optics.graycode import KINDS, GrayCode, gray_code
from fpputil.optics.parts import part
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import preset

SYSTEM = preset("small").system
W, H = PROJECTOR = (912, 1140)
PLAIN = {"white": "white.png", "black": "black.png"}


def coded(pitch=19, kind="complementary", steps=4, **more):
    fringes = (*fringe_set((pitch,), steps), gray_code(pitch, W, kind))
    return Patterns(PROJECTOR, fringes, "gray", **more)


LYING = (Fringe(19, 4, "row"), gray_code(19, H, axis="row"))
ROWS = Patterns(PROJECTOR, LYING, "gray")
ALONE = Patterns(PROJECTOR, (GrayCode(1, 10),), "gray", **PLAIN)
NEGATIVES = Patterns(PROJECTOR, (GrayCode(1, 10, inverse=True),), "gray")


@pytest.fixture(scope="module")
def view():
    return raycast(shapes.place(part(3), 240, [0, 0, 660]), SYSTEM, supersample=2)


@pytest.fixture
def taken(tmp_path, view, photographs):
    """Function from patterns, and a change of the pictures of their code, to a measurement."""

    def take(patterns, change=None, given=None):
        frames = photographs(view, patterns, noise=2.0)
        if change is not None:
            files = [file for file in frames if "gray" in file]
            mean = np.mean([frames[file] for file in frames if "gray" not in file], axis=0)
            frames |= change([frames[file] for file in files], files, mean)
        for name, frame in frames.items():
            cv2.imwrite(str(tmp_path / name), frame)
        capture = open_capture(tmp_path, given or patterns)
        result = measure(capture, capture.patterns.axes[0])
        return result, diagnose(result, capture)

    return take


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("pitch", [19, 14.25])
def test_four_steps_and_a_code_give_the_orders(taken, view, kind, pitch):
    result, findings = taken(coded(pitch, kind))
    known = result.mask & view.mask
    assert (np.abs(result.coordinate - view.column)[known] > pitch / 2).sum() == 0
    assert known.sum() > (0.99 if kind == "complementary" else 0.95) * view.mask.sum()
    assert not any(f.severe for f in findings)


@pytest.mark.parametrize("plain", [{}, PLAIN], ids=["no plain light", "plain light"])
@pytest.mark.parametrize("response, steps", [(0.5, 4), (2.2, 3), (2.2, 4)])
def test_a_response_with_ambient_light_takes_no_order(tmp_path, view, response, steps, plain):
    patterns = coded(steps=steps, **plain)
    for shot, frame in photograph(view, patterns, SYSTEM, 0, response, noise=1.0, ambient=10.0):
        cv2.imwrite(str(tmp_path / shot.file), frame)
    capture = open_capture(tmp_path, patterns)
    result = measure(capture)
    known = result.mask & view.mask
    assert known.sum() > 0.95 * view.mask.sum()
    assert (np.abs(result.coordinate - view.column)[known] > 9.5).sum() == 0
    assert not any(f.severe for f in diagnose(result, capture))


@pytest.mark.parametrize("kind", KINDS)
def test_steps_the_other_way_are_told_from_an_inverted_picture(taken, kind):
    """Both look alike; the remedy that needs no new photographs comes first, and works."""
    given = coded(kind=kind)
    _, findings = taken(replace(given, shift=-1), given=given)
    assert findings[0].code == "against" and findings[0].remedy.startswith("give --shift -1;")
    assert not any(f.severe for f in taken(replace(given, shift=-1))[1])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("response, steps", [(0.5, 3), (2.2, 3), (0.5, 4)])
def test_a_phase_that_a_response_turns_takes_no_wrong_order(tmp_path, view, kind, response, steps):
    patterns = coded(kind=kind, steps=steps)
    for shot, frame in photograph(view, patterns, SYSTEM, 0, response, noise=2.0):
        cv2.imwrite(str(tmp_path / shot.file), cv2.GaussianBlur(frame, (0, 0), 0.7))
    result = measure(open_capture(tmp_path, patterns))
    inner = cv2.erode(view.mask.astype(np.uint8), np.ones((9, 9))) > 0
    known = result.mask & inner
    assert known.sum() > 0.97 * inner.sum()
    assert np.abs(result.coordinate - view.column)[known].max() < 9.5


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_wrong_orders_are_fewer_than_one_in_a_hundred_thousand(tmp_path, kind):
    """Of the mask, with four steps and noise 2, at the resolution of the paper."""
    system, patterns = preset("paper").system, coded(W / 64, kind)
    wrong = total = 0
    for body in (shapes.sphere(100, [0, 0, 660]), shapes.place(part(3), 240, [0, 0, 660])):
        view = raycast(body, system, supersample=2)
        for seed in range(3):
            for shot, frame in photograph(view, patterns, system, seed, noise=2.0):
                cv2.imwrite(str(tmp_path / shot.file), frame)
            result = measure(open_capture(tmp_path, patterns))
            known = result.mask & view.mask
            wrong += (np.abs(result.coordinate - view.column)[known] > W / 128).sum()
            total += known.sum()
    assert total > 500_000 and wrong < 1e-5 * total


@pytest.mark.parametrize("patterns", [ALONE, NEGATIVES], ids=["plain light", "negatives"])
def test_a_code_alone_gives_the_cell(taken, view, patterns):
    result, findings = taken(patterns)
    known = result.mask & view.mask
    off = np.abs(result.coordinate - view.column)[known]
    assert known.sum() > 0.9 * view.mask.sum() and not any(f.severe for f in findings)
    assert np.median(off) < 0.5 and np.quantile(off, 0.999) < 3
    assert 1 / 12**0.5 == pytest.approx(np.nanmin(result.sigma) * 1024 / (2 * np.pi), rel=1e-5)
    assert (result.gamma, result.told, result.curved) == (1.0, "", False)


def exchanged(a, b):
    return lambda frames, files, mean: {files[a]: frames[b], files[b]: frames[a]}


def backwards(frames, files, mean):
    return dict(zip(files, frames[::-1], strict=True))


def negative(*which):
    def change(frames, files, mean):
        turned = [np.clip(2 * mean - f, 0, 255).astype(np.uint8) for f in frames]
        return {files[n]: turned[n] for n in which or range(len(files))}

    return change


FAULTS = [
    (exchanged(0, 1), "bits 0 and 1"),
    (exchanged(2, 4), "bits 2 and 4"),
    (backwards, "least significant one first"),
    (negative(), "exchanged in all of"),
    (negative(0), "exchanged in the code's first picture"),
    (negative(3), "exchanged in 3 of"),
]


@pytest.mark.parametrize(
    "patterns",
    [*(coded(kind=kind) for kind in KINDS), ROWS, ALONE],
    ids=[*KINDS, "rows", "alone"],
)
def test_faults_of_the_code_are_named(taken, patterns):
    for change, said in FAULTS:
        if patterns is ALONE and said == "exchanged in the code's first picture":
            continue  # which mirrors the columns: the direction tells
        _, findings = taken(patterns, change)
        assert [f.severe for f in findings[:1]] == [True], said
        assert said in findings[0].message, (said, findings)


def test_binary_numbers_are_not_a_gray_code(taken, view):
    def binary(frames, files, mean):
        cell = np.nan_to_num(view.column).round().astype(int) * 2 // 19
        return {
            file: np.where(cell >> (len(files) - 1 - n) & 1, 2 * mean, 0).clip(0, 255).astype("u1")
            for n, file in enumerate(files)
        }

    _, findings = taken(coded(), binary)
    assert "plain binary numbers" in findings[0].message


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("degrees, name", [(-90, "sine"), (180, "black"), (-120, "-120"), (30, "")])
def test_the_start_of_the_fringes_is_told_by_the_code(taken, kind, degrees, name):
    given = coded(kind=kind)
    fringe, code = given.fringes
    shown = replace(given, fringes=(replace(fringe, start=np.deg2rad(degrees)), code))
    _, findings = taken(shown, given=given)
    assert [f.code for f in findings if f.severe] == ["offset"]
    assert not name or f"give --start {name} if" in findings[0].remedy
    assert not any(f.severe for f in taken(shown)[1])


def test_several_pitches_go_on_from_the_code(taken, view):
    fringes = (*fringe_set((18, 114), 4), gray_code(114, W))
    result, _ = taken(Patterns(PROJECTOR, fringes, "gray"))
    assert result.pitch == 18 and len(result.offsets) == 2
    known = result.mask & view.mask
    assert np.abs(result.coordinate - view.column)[known].max() < 4.5


def test_thresholds_that_are_not_there_are_asked_for(taken, view):
    with pytest.raises(ValueError, match="white and black"):
        taken(replace(ALONE, white="", black=""))
    with pytest.raises(ValueError, match="seem to be exchanged"):
        taken(ALONE, given=replace(ALONE, white="black.png", black="white.png"))


@pytest.mark.parametrize(
    "fringes, unwrap, said",
    [
        ((Fringe(19, 4),), "gray", "Gray codes along no axis given"),
        ((Fringe(19, 4), GrayCode(19, 6)), "mf", "the others none"),
        ((Fringe(19, 4), GrayCode(19, 6), GrayCode(19, 6)), "gray", "one code along each axis"),
        ((Fringe(19, 4), GrayCode(19, 5)), "gray", "it numbers 608 pixels, and the projector"),
        ((Fringe(19, 4), GrayCode(38, 5)), "gray", "a cell is at most a period"),
    ],
)
def test_codes_that_do_not_fit_are_refused(taken, fringes, unwrap, said):
    with pytest.raises(ValueError) as error:
        taken(Patterns(PROJECTOR, fringes, unwrap))
    assert said in str(error.value)


def test_the_pattern_file_holds_the_code(tmp_path):
    patterns = coded(kind="shifted", **PLAIN)
    patterns.save(tmp_path / "p.toml")
    assert Patterns.load(tmp_path / "p.toml") == patterns
    files = [shot.file for shot in patterns.shots()]
    assert files[:3] == ["white.png", "black.png", "column-19-00.png"]
    assert files[-1] == "column-gray-05.png"
    picture = patterns.picture(patterns.shots()[-1])
    assert set(np.unique(picture)) == {0, 255} and (picture == picture[0]).all()


@pytest.mark.parametrize(
    "options",
    [
        "",
        "--code-first --start sine",
        "--code plain --periods 64 --steps 12",
        "--code shifted",
        "--code alone",
        "--code alone --inverse --no-plain",
    ],
)
def test_the_command_makes_and_decodes_them(tmp_path, options, capsys):
    """With a report of fringes under a code, and of a code alone."""
    bare = [] if options in ("", "--code alone") else ["--no-report", "--no-pictures"]
    words = ["patterns", str(tmp_path / "p"), "--unwrap", "gray", "--projector", "912x1140"]
    assert main([*words, *options.split()]) == 0
    toml = ["--patterns", str(tmp_path / "p" / "patterns.toml")]
    render = ["render", str(tmp_path / "s"), *toml, "--sphere", "100", "--system", "small"]
    assert main(render) == 0
    out = ["--out", str(tmp_path / "out"), "--system", "small"]
    assert main(["decode", str(tmp_path / "s"), *out, *bare]) == 0, capsys.readouterr().err
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["decoded"] and summary["points"] > 15_000
    with np.load(tmp_path / "out" / "decoded.npz") as found:
        depth = found["depth"]
    with np.load(tmp_path / "s" / "truth.npz") as truth:
        off = np.abs(depth - truth["depth"])
    assert np.nanmedian(off) < (4 if "alone" in options else 0.3)


@pytest.mark.parametrize(
    "words, said",
    [
        ("--code plain", "--code with unwrap 'mf' given"),
        ("--code-first", "--code-first with unwrap 'mf' given"),
        ("--unwrap gray --code alone --pitches 16", "--code alone with pitches given"),
        ("--unwrap gray --pitches 16", "without --projector given"),
    ],
)
def test_options_that_do_not_go_together(tmp_path, capsys, words, said):
    assert main(["patterns", str(tmp_path / "p"), *words.split()]) == 1
    assert said in capsys.readouterr().err


def test_photographs_in_the_order_of_time_and_a_start_beside_a_file(tmp_path, view, capsys):
    """The code first, as a projector's own software may show it; fringes that begin as a sine."""
    code, fringe = gray_code(19, W), Fringe(19, 4, start=-np.pi / 2)
    shown = Patterns(PROJECTOR, (code, fringe), "gray", files="IMG_{number:03}.png")
    photograph_into(tmp_path / "s", view, shown, SYSTEM, noise=1.0)
    replace(shown, fringes=(code, Fringe(19, 4))).save(tmp_path / "s" / "patterns.toml")
    words = ["decode", str(tmp_path / "s"), "--no-report", "--no-pictures", "--force"]
    assert main(words) == 1 and "give --start sine if" in capsys.readouterr().err
    assert main([*words, "--start", "sine"]) == 0
    (tmp_path / "s" / "patterns.toml").unlink()
    words += ["--files", "*.png", "--unwrap", "gray", "--pitches", "19", "--steps", "4"]
    words += ["--projector", "912x1140", "--start", "sine"]
    assert main([*words, "--code-first"]) == 0
    with np.load(tmp_path / "s-decoded" / "decoded.npz") as found:
        off = np.abs(found["column_coordinate"] - view.column)[view.mask]
    assert np.nanmedian(off) < 0.1 and np.nanmax(off) < 9.5
    assert main(words) == 1


def test_a_board_under_a_code_is_a_pose(tmp_path, view):
    fringes = tuple(
        f for axis, side in (("column", W), ("row", H))
        for f in (Fringe(19, 4, axis), gray_code(19, side, axis=axis))
    )  # fmt: skip
    patterns = Patterns(PROJECTOR, fringes, "gray")
    photograph_into(tmp_path / "pose", view, patterns, SYSTEM, noise=1.0)
    pose, projector = board_pose(tmp_path / "pose")
    assert projector == PROJECTOR
    for seen, true in ((pose.column, view.column), (pose.row, view.row)):
        assert np.nanmax(np.abs(seen - true)[view.mask]) < 4
