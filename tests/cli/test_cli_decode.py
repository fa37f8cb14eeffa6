"""From patterns to points without hardware, as an engineer types it; and what goes wrong."""

import json
import shutil
import signal
import subprocess
import sys
import time
import tracemalloc
from dataclasses import replace

import cv2
import numpy as np
import pytest
import tifffile
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.cli import main
from fpputil.decoding.pointcloud import fit_sphere
from fpputil.optics.shapes import rotation
from fpputil.optics.system import preset


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    """A folder with patterns `p` and photographs `shots` of a sphere by the system `tiny`."""
    root = tmp_path_factory.mktemp("loop")
    assert main(["patterns", str(root / "p"), "--pitches", "912", "114", "24"]) == 0
    patterns = ["--patterns", str(root / "p" / "patterns.toml")]
    options = ["--system", "tiny", "--sphere", "100"]
    assert main(["render", str(root / "shots"), *patterns, *options]) == 0
    return root


def test_a_body_stands_before_a_camera_that_looks_elsewhere(loop, tmp_path):
    system, turn = preset("tiny").system, rotation(90, 0)  # of the world
    moved = (replace(p, R=p.R @ turn.T) for p in (system.camera, system.projector))
    replace(system, **dict(zip(("camera", "projector"), moved, strict=True))).save(
        tmp_path / "turned.json"
    )
    options = ["--patterns", loop / "p" / "patterns.toml", "--sphere", 100, "--supersample", 1]
    words = ["render", tmp_path / "shots", "--system", tmp_path / "turned.json", *options]
    assert main([*map(str, words)]) == 0
    depth = np.load(tmp_path / "shots" / "truth.npz")["depth"]
    assert np.nanmin(depth) == pytest.approx(560, abs=0.5)


def test_the_loop_ends_in_points_on_the_sphere(loop, tmp_path, capsys):
    capsys.readouterr()
    shots, out = str(loop / "shots"), tmp_path / "out"
    system = ["--system", str(loop / "shots" / "system.json")]
    assert main(["decode", shots, "--out", str(out), *system]) == 0
    said = capsys.readouterr()
    assert "in the mask" in said.out and "points.ply" in said.out
    cloud = trimesh.load(out / "points.ply")
    assert fit_sphere(np.asarray(cloud.vertices)).radius == pytest.approx(100, abs=0.3)
    with np.load(out / "decoded.npz") as file, np.load(loop / "shots" / "truth.npz") as truth:
        found, mask = dict(file), truth["mask"]
        both = found["column_mask"] & mask
        assert both.sum() > 0.97 * mask.sum()
        assert np.abs(found["column_coordinate"] - truth["column"])[both].max() < 3
        assert np.median(np.abs(found["depth"] - truth["depth"])[both]) < 0.5
        assert {k for k in found if k.startswith("column_")} == {
            f"column_{n}" for n in ("wrapped", "Phi", "sigma", "coordinate", "modulation", "mask",
                                    "reason")}  # fmt: skip
    summary = json.loads((out / "summary.json").read_text())
    assert (
        summary["decoded"]
        and summary["findings"] == []
        and summary["points"] == len(cloud.vertices)
    )
    for name, values in found.items():
        picture = tifffile.imread(out / f"{name}.tif")
        assert picture.dtype == (np.float32 if values.dtype == np.float32 else np.uint8)
        np.testing.assert_array_equal(picture, values * (255 if values.dtype == bool else 1))
    page = (out / "report.html").read_text()
    assert "Nothing speaks against this capture" in page and page.count("<img") == 1
    assert 'src="http' not in page and "<script src" not in page and len(page) < 3e6


def test_points_carry_their_uncertainty_and_the_colour_of_the_white_photograph(loop, tmp_path):
    shots, out = shutil.copytree(loop / "shots", tmp_path / "shots"), tmp_path / "out"
    grey = cv2.imread(str(shots / "000-white.png"), cv2.IMREAD_GRAYSCALE)
    cv2.imwrite(
        str(shots / "000-white.png"), np.stack([grey // 4, grey // 2, grey], -1)
    )  # blue first
    main(["decode", str(shots), "--out", str(out), "--system", "tiny", "--no-report"])
    head = (out / "points.ply").read_bytes().split(b"end_header\n")[0].decode()
    assert "property float sigma" in head and "property uchar red" in head
    assert not (out / "report.html").exists()
    red, green, blue, _ = np.asarray(trimesh.load(out / "points.ply").colors).T.astype(int)
    assert np.median(red) > 1.8 * np.median(green) > 3 * np.median(blue) > 0


@pytest.mark.parametrize("steps, plain", [(3, "--plain"), (4, "--no-plain")])
def test_a_gamma_of_few_steps_is_told_and_taken_back(fpp, tmp_path, steps, plain):
    pitches = ["--pitches", 912, 114, 36, "--steps", steps, plain]
    assert fpp("patterns", tmp_path / "p", *pitches)[0] == 0
    body = ["--patterns", tmp_path / "p/patterns.toml", "--system", "tiny", "--sphere", 100]
    assert fpp("render", tmp_path / "shots", *body, "--projector-gamma", 2.2)[0] == 0
    bare = ["--system", "tiny", "--no-report", "--no-pictures"]
    code, said, error = fpp("decode", tmp_path / "shots", *bare)
    assert code == 0 and "error:" not in error
    gamma = float(said.split("response of gamma ")[1].split(",")[0])
    assert gamma == pytest.approx(2.2, rel=0.05) and "taken back" in said
    with np.load(tmp_path / "shots-decoded/decoded.npz") as found:
        with np.load(tmp_path / "shots/truth.npz") as truth:
            both = found["column_mask"] & truth["mask"]
            off = np.abs(found["column_coordinate"] - truth["column"])[both]
            assert both.sum() > 0.9 * truth["mask"].sum()
    assert np.median(off) < 0.15


def test_json_is_for_machines(loop, tmp_path, capsys):
    capsys.readouterr()
    assert main(["patterns", str(tmp_path / "p"), "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["files"]) == 26
    out = ["--out", str(tmp_path / "out"), "--no-report", "--no-pictures", "--json"]
    assert main(["decode", str(loop / "shots"), *out]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["decoded"] and said.err == ""


def test_a_fault_is_named_and_phases_are_not_written(loop, tmp_path, capsys):
    shots = shutil.copytree(loop / "shots", tmp_path / "shots")
    text = (shots / "patterns.toml").read_text()
    (shots / "patterns.toml").write_text(text.replace("shift = 1", "shift = -1"))
    assert main(["decode", str(shots)]) == 1
    said = capsys.readouterr().err
    assert "grow from right to left" in said and "give shift 1" in said
    out = tmp_path / "shots-decoded"
    left = sorted(p.name for p in out.iterdir())
    assert left == [".fpputil.json", "report.html", "summary.json"]
    assert "The phases are wrong" in (out / "report.html").read_text()
    assert main(["decode", str(shots)]) == 1 and "is not empty" in capsys.readouterr().err
    again = ["decode", str(shots), "--no-report", "--no-pictures", "--force"]
    assert main([*again, "--accept"]) == 0
    assert (out / "decoded.npz").is_file()
    assert main([*again, "--shift", "1"]) == 0  # as the error advises
    assert "no --system given" in capsys.readouterr().out


def test_numbered_photographs_with_plain_ones_first(loop, tmp_path, capsys):
    shots, patterns = shutil.copytree(loop / "shots", tmp_path / "shots"), loop / "p/patterns.toml"
    for n, shot in enumerate(Patterns.load(patterns).shots()):
        (shots / shot.file).rename(shots / f"IMG_{998 + n}.png")
    text = patterns.read_text().replace("{number:03}-{axis}-{pitch}-{step:02}", "*")
    (shots / "patterns.toml").write_text(text)
    assert main(["decode", str(shots), "--system", "tiny", "--no-report", "--no-pictures"]) == 0
    for n in range(998, 1024):
        (shots / f"IMG_{n}.png").rename(shots / f"IMG_{n}.jpg")
    (shots / "patterns.toml").write_text(patterns.read_text())
    assert main(["decode", str(shots), "--force"]) == 1
    assert "; 26 others are there, as IMG_1000.jpg: name them" in capsys.readouterr().err


def test_photographs_without_a_pattern_file(loop, tmp_path, capsys):
    shots = shutil.copytree(loop / "shots", tmp_path / "shots")
    (shots / "patterns.toml").unlink()
    (shots / "000-white.png").unlink()
    (shots / "001-black.png").unlink()
    for n, name in enumerate(s.file for s in Patterns.load(loop / "p/patterns.toml").shots()[2:]):
        (shots / name).rename(shots / f"img {n}.png")
    given_ = ["--files", "*.png", "--pitches", "912", "114", "24", "--steps", "8"]
    assert main(["decode", str(shots)]) == 1
    assert "no patterns.toml in" in capsys.readouterr().err
    assert main(["decode", str(shots), *given_[2:]]) == 1
    assert "--pitches without --files given" in capsys.readouterr().err
    assert main(["decode", str(shots), *given_, "--no-report", "--no-pictures"]) == 0
    assert main(["decode", str(shots), *given_[:-1], "7", "--force"]) == 1
    assert (
        "24 files match '*.png'; the fringes have 7 + 7 + 7 = 21 steps" in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    "command, said",
    [
        (["decode", "nowhere"], "nowhere given; there is no such folder"),
        (["decode", ".", "--gamma", "x"], "gamma 'x' given"),
        (["decode", ".", "--gamma", "0"], "gamma 0.0 given"),
        (["decode", ".", "--patterns", "a", "--files", "b"], "--patterns and --files given"),
        (["decode", ".", "--system", "huge"], "preset 'huge' given"),
        (["patterns", "p", "--pitches", "912", "912"], "they must descend strictly"),
        (["patterns", "p", "--pitches", "114", "24"], "must cover the whole projector"),
        (["patterns", "p", "--unwrap", "nt"], "without --pitches given"),
        (["patterns", "p", "--steps", "2"], "2 steps given"),
        (["patterns", "none/p"], "its folder"),
        (["render", "r", "--patterns", "none.toml", "--part", "1"], "no such pattern file"),
        (["calibrate", "none", "s.json", "--board", "9x6", "--range", "1", "2"], "no such folder"),
        (["calibrate", ".", "s.json", "--board", "9x6", "--range", "1", "2"], "holds no folder"),
    ],
)
def test_errors_name_what_was_given(tmp_path, monkeypatch, capsys, command, said):
    monkeypatch.chdir(tmp_path)
    assert main(command) == 1
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_patterns_and_system_are_of_one_projector(loop, tmp_path, capsys):
    """Without --projector it is the system's."""
    system = preset("tiny").system
    wide = replace(system, projector=replace(system.projector, width=1824))
    wide.save(tmp_path / "wide.json")
    names = ["--files", "*.png", "--steps", "8", "--pitches"]
    shots = ["decode", str(loop / "shots"), "--out", str(tmp_path / "out"), "--system"]
    assert main([*shots, str(tmp_path / "wide.json")]) == 1
    sizes = "projector of 912 x 1140 pixels given; the system has one of 1824 x 1140"
    assert sizes in capsys.readouterr().err and not (tmp_path / "out").exists()
    (tmp_path / "twice").mkdir()
    for shot in sorted((loop / "shots").glob("*.png"))[2:]:  # white and black come first
        shutil.copy(shot, tmp_path / "twice" / shot.name)
    shots = ["decode", str(tmp_path / "twice"), "--out", str(tmp_path / "out"), *names]
    shots += ["1824", "228", "48", "--system", str(tmp_path / "wide.json"), "--no-report"]
    code, said = main(shots), capsys.readouterr()
    assert code == 1 and "pixels in the mask have no depth from 480 to 820 mm" in said.err
    assert "only the report is written; --accept" in said.err


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_leaves_nothing(loop, tmp_path, number):
    command = [sys.executable, "-m", "fpputil.cli", "decode", str(loop / "shots"), "--out"]
    run = subprocess.Popen([*command, str(tmp_path / "out")], stderr=subprocess.PIPE, text=True)
    partial = lambda: list(tmp_path.iterdir())  # noqa: E731
    end = time.monotonic() + 60
    while not partial() and time.monotonic() < end:
        time.sleep(0.01)
    run.send_signal(number)
    _, said = run.communicate(timeout=60)
    # Python ends by the signal itself if it came within exec(); a shell shows 130 for both.
    assert run.returncode in (130, -signal.SIGINT)
    assert "nothing was written" in said and "Traceback" not in said
    assert partial() == []


def test_memory_does_not_grow_with_the_photographs(tmp_path):
    shape, steps = (600, 800), 60
    patterns = Patterns((912, 1140), Patterns.load(_toml(tmp_path, steps)).fringes,
                        files="{pitch}-{step}.npy")  # fmt: skip
    u = np.arange(shape[1])
    for shot in patterns.shots():
        delta = 2 * np.pi * shot.step / steps
        line = 127.5 * (1 + np.cos(2 * np.pi * u / 912 + delta))
        np.save(tmp_path / shot.file, np.broadcast_to(np.rint(line), shape).astype(np.uint16))
    patterns.save(tmp_path / "patterns.toml")
    tracemalloc.start()
    measure(open_capture(tmp_path, full=255), gamma=1.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    all_frames = 3 * steps * shape[0] * shape[1] * 2  # bytes
    assert peak < 0.75 * all_frames


def _toml(folder, steps):
    text = "projector = [912, 1140]\n"
    for pitch in (912, 911, 910):
        text += f"[[fringes]]\npitch = {pitch}\nsteps = {steps}\n"
    (folder / "patterns.toml").write_text(text)
    return folder / "patterns.toml"


BYTES = st.binary(max_size=200)


NAMES = ["002-column-912-00.png", "025-column-24-07.png", "patterns.toml", "013-column-114-03.png",
         "system.json", "x.png"]  # fmt: skip
CHANGES = st.one_of(st.none(), BYTES, st.just("swap"), st.just("small"))
OPTIONS = [[], ["--system", "system.json"], ["--accept"], ["--files", "*.png"]]


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.dictionaries(st.sampled_from(NAMES), CHANGES, max_size=4), st.sampled_from(OPTIONS))
def test_any_folder_is_decoded_or_refused_and_nothing_is_left(
    loop, tmp_path_factory, changes, options
):
    root = tmp_path_factory.mktemp("fuzz")
    shots = shutil.copytree(loop / "shots", root / "shots")
    for name, change in changes.items():
        path = shots / name
        if change is None:
            path.unlink(missing_ok=True)
        elif change == "swap":
            shutil.copy(loop / "shots" / "018-column-24-00.png", path)
        elif change == "small":
            cv2.imwrite(str(shots / "a.png"), np.zeros((5, 5), np.uint16))
            (shots / "a.png").replace(path)
        else:
            path.write_bytes(change)
    options = [str(shots / o) if o == "system.json" else o for o in options]
    code = main(["decode", str(shots), *options, "--no-report", "--no-pictures"])
    left = sorted(p.name for p in root.iterdir())
    assert code in (0, 1) and left in (["shots"], ["shots", "shots-decoded"])
    if code == 0:
        assert (root / "shots-decoded" / "decoded.npz").is_file()
    shutil.rmtree(root)


@pytest.mark.slow
def test_a_reader_who_has_enough_is_no_error(loop):
    run = f"{sys.executable} -m fpputil.cli results list --results {loop} --preset tiny | head -1"
    done = subprocess.run(["bash", "-c", run], capture_output=True, text=True)
    assert done.stdout.count("\n") == 1 and done.stderr == ""
