"""`fpp calibrate` takes photographs, names and units as `fpp decode` and people do."""

import json
import os
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

from fpputil.capture.patterns import Patterns
from fpputil.cli import main
from fpputil.optics.system import System, preset

BOARD = ["--board", "8x6", "--lens", "0", "--projector-lens", "0"]
MM = ["--square", "35", "--range", "480", "820"]


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Four poses of a board by the system `small`, and their patterns."""
    root = tmp_path_factory.mktemp("boards")
    patterns = ["--axis", "both", "--pitches", "1140", "114", "24", "--steps", "4", "--no-plain"]
    assert main(["patterns", str(root / "p"), *patterns]) == 0
    render = ["--patterns", str(root / "p/patterns.toml"), "--system", "small", "--board", "8x6"]
    render += ["--square", "35", "--poses", "4", "--supersample", "1"]
    assert main(["render", str(root / "poses"), *render]) == 0
    return root / "poses"


@pytest.fixture
def poses(rendered, tmp_path):
    return shutil.copytree(rendered, tmp_path / "poses")


def calibrated(poses, *options):
    """The system that comes out, which must be nearly the one of the photographs."""
    out = poses.parent / "system.json"
    out.unlink(missing_ok=True)
    assert main(["calibrate", str(poses), str(out), *map(str, options)]) == 0
    system, truth = System.load(out), preset("small").system
    assert np.linalg.norm(system.projector.centre) == pytest.approx(156.6, abs=1.5)
    assert (system.z_min, system.z_max) == pytest.approx((480, 820))
    assert system.camera.K[0, 0] == pytest.approx(truth.camera.K[0, 0], rel=0.01)
    return system


@pytest.mark.parametrize(
    "unit, factor", [("m", 1e-3), ("cm", 0.1), ("inch", 1 / 25.4), ("mm", 1.0)]
)
def test_lengths_are_taken_in_the_unit_that_is_said(poses, capsys, unit, factor):
    lengths = ["--square", 35 * factor, "--range", 480 * factor, 820 * factor]
    calibrated(poses, *BOARD, *lengths, "--unit", unit)
    said = capsys.readouterr().out
    assert "baseline 15" in said and f"was taken for {unit})" in said


@pytest.mark.parametrize(
    "lengths, said",
    [
        (["--square", "0.035", "--range", "0.48", "0.82"], "--square 0.035 without --unit given"),
        (["--square", "35", "--range", "0.48", "0.82"], "--range 0.48 without --unit given"),
    ],
)
def test_a_unit_is_asked_for_where_millimetres_cannot_be(refused, poses, lengths, said):
    error = refused("calibrate", poses, poses / "s.json", *BOARD, *lengths)
    assert said in error and "give --unit m, cm or inch" in error


def test_foreign_and_decoded_folders_are_passed_over(poses):
    assert main(["decode", str(poses / "pose-00"), "--no-report", "--no-pictures"]) == 0
    elsewhere = ["--out", str(poses / "first"), "--no-report", "--no-pictures"]
    assert main(["decode", str(poses / "pose-00"), *elsewhere]) == 0
    assert {p.name for p in poses.iterdir()} > {"pose-00-decoded", "first"}
    for name in (".ipynb_checkpoints", "__MACOSX"):
        (poses / name).mkdir()
    for pose in poses.glob("pose-0?"):
        (pose / "._column-24-00.png").write_bytes(b"\0\5\x16\7")
    calibrated(poses, *BOARD, *MM)


def test_poses_without_a_pattern_file_of_12_bits_and_one_named_in_another_script(poses):
    patterns = Patterns.load(poses / "pose-00" / "patterns.toml")
    for pose in sorted(poses.glob("pose-0?")):
        for number, shot in enumerate(patterns.shots()):
            image = cv2.imread(str(pose / shot.file), cv2.IMREAD_GRAYSCALE)
            levels = np.rint(image * (4095 / 255)).astype(np.uint16) | 1
            cv2.imwrite(str(pose / f"IMG_{number}.tif"), levels)
            (pose / shot.file).unlink()
        (pose / "patterns.toml").unlink()
    (poses / "pose-01").rename(poses / "поза 1")
    (poses / "pose-02").rename(poses / os.fsdecode(b"caf\xe9"))
    files = ["--files", "*.tif", "--pitches", 1140, 114, 24, "--steps", 4]
    calibrated(poses, *BOARD, *MM, *files)
    calibrated(poses, *BOARD, *MM, *files, "--full", 4095, "--gamma", 1, "--threshold", 10)


def test_the_direction_of_the_steps_may_be_turned_for_all_poses(refused, poses):
    for file in poses.glob("pose-0?/patterns.toml"):
        replace(Patterns.load(file), shift=-1).save(file)
    calibrated(poses, *BOARD, *MM, "--shift", 1)


def test_json_says_what_came_out(poses, capsys):
    capsys.readouterr()
    calibrated(poses, *BOARD, *MM, "--json")
    about = json.loads(capsys.readouterr().out)
    assert max(about["camera_errors"].values()) < 0.3 and about["rejected"] == {}


def test_the_board_that_is_there_is_proposed(refused, poses):
    wrong = ["--board", "9x7", *MM]
    error = refused("calibrate", poses, poses / "s.json", *wrong)
    assert "it looks like --kind chessboard --board 8x6" in error


def test_a_board_is_rendered_and_calibrates_the_system(poses, tmp_path, capsys):
    board = ["--board", "8x6", "--square", "35"]
    out, reach = str(tmp_path / "s.json"), ["--range", "480", "820"]
    found = ["calibrate", str(poses), out, *board, *reach, "--lens", "0"]
    assert main([*found, "--projector-lens", "0"]) == 0
    said = capsys.readouterr()
    assert "baseline 15" in said.out and "4 poses were used" in said.err
    assert main([*found]) == 1 and "is there already" in capsys.readouterr().err
    wrong = [{"35": "3.5"}.get(w, w) for w in found]
    assert main([*wrong, "--force"]) == 0
    assert "outside the measuring range of 480 to 820 mm" in capsys.readouterr().err
    wrong = [{"8x6": "9x7"}.get(w, w) for w in found]
    assert main([*wrong, "--force"]) == 1
    said = capsys.readouterr().err
    assert "pose-00, pose-01, pose-02, pose-03: no chessboard" in said and "inner corners" in said
    (poses / "pose-01/patterns.toml").unlink()  # one bad pose of four is left out by name
    assert main([*found, "--force"]) == 0
    said = capsys.readouterr()
    assert "pose-01              left out: no patterns.toml in" in said.out
    assert "3 poses were used" in said.err
    next((poses / "pose-02").glob("*.png")).unlink()
    assert main([*found, "--force"]) == 1
    said = capsys.readouterr().err
    assert "2 of 4 poses can be used; 3 are needed" in said
    assert "pose-01: no patterns.toml in" in said and "pose-02: " in said


OTHERS = {
    "asymmetric circles": "--board 4x7 --kind asymmetric --square 26",
    "legacy ChArUco": "--board 7x5 --kind charuco --square 30 --dictionary 5x5_100 --legacy",
}


@pytest.mark.slow
@pytest.mark.parametrize("board", OTHERS.values(), ids=OTHERS)
def test_boards_of_other_makers_calibrate(rendered, tmp_path, board):
    board = board.split()
    pattern = ["--patterns", str(rendered.parent / "p/patterns.toml"), "--system", "small"]
    out = str(tmp_path / "poses")
    assert main(["render", out, *pattern, *board, "--poses", "4"]) == 0
    lenses = ["--lens", "0", "--projector-lens", "0", "--range", "480", "820"]
    calibrated(tmp_path / "poses", *board, *lenses)
