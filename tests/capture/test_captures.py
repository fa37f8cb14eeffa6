"""Real light: photographs of a real projector, decoded by the command.

Three pitches that stand as 14 : 15 : 16, twelve steps each. The photographs are not part of the
project: set FPP_CAPTURES to their folder, or keep it at ../shared/captures.
"""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fpputil.capture.faults.diagnosis import diagnose
from fpputil.capture.faults.gamma import estimate_gamma, linearise
from fpputil.capture.folder import decode_folder
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.cli import main
from fpputil.decoding import phase, unwrap
from fpputil.optics.fringes import fringe_set

ROOT = Path(__file__).parents[2]
CAPTURES = Path(os.environ.get("FPP_CAPTURES", ROOT.parent / "shared" / "captures"))
PITCHES = (14, 15, 16)
WIDTH = 1000  # columns of these pitches in view; the beat of all three is 1680 long
SCENES = ("david", "bottle")
PATTERNS = Patterns(
    (WIDTH, WIDTH), fringe_set(PITCHES, 12), "mw", files="period{pitch}_step{step:02}.png",
    white="white.png",
)  # fmt: skip

pytestmark = pytest.mark.skipif(
    not CAPTURES.is_dir(), reason=f"no real captures at {CAPTURES.name}/"
)


def frames_of(scene, fringe=0):
    capture = open_capture(CAPTURES / scene, PATTERNS)
    return capture.frames(fringe)


def wrapped(frames):
    M, D = phase.numerator_denominator(frames.astype(np.float64))
    return phase.wrapped_phase(M, D), phase.modulation(M, D, len(frames))


@pytest.mark.parametrize("scene", SCENES)
def test_three_pitches_agree_on_the_column(scene):
    capture = open_capture(CAPTURES / scene, PATTERNS)
    result = measure(capture)
    Phis = unwrap.mw_tpu(list(result.wrapped), PITCHES, WIDTH)
    columns = [P * p / (2 * np.pi) for P, p in zip(Phis, PITCHES, strict=True)]
    spread = np.ptp(columns, axis=0)
    strong = result.modulation[0] > 10
    assert (spread[strong] < 1).mean() >= 0.997  # by a plain mask
    assert (spread[result.mask] < 1).mean() >= 0.999
    assert result.mask[strong].mean() >= 0.98
    assert not any(d.severe for d in diagnose(result, capture))


@pytest.mark.parametrize("scene, other", [SCENES, SCENES[::-1]])
def test_three_steps_gain_by_the_response_of_the_other_scene(scene, other):
    frames, others = frames_of(scene), frames_of(other)
    lit = (wrapped(others)[1] > 10) & (others.max(axis=0) < 255)
    gamma = estimate_gamma(others[:, lit])
    twelve, modulation = wrapped(frames)

    def error(few):
        off = unwrap.wrap(wrapped(few)[0] - twelve)[modulation > 10]
        return np.sqrt(np.mean(off**2))

    assert error(frames[[0, 4, 8]]) > 0.1
    assert error(linearise(frames, gamma)[[0, 4, 8]]) <= 0.04


@pytest.mark.parametrize("scene", SCENES)
def test_the_command_decodes_the_folder(scene, tmp_path, capsys):
    given = ["--files", PATTERNS.files, "--pitches", "14", "15", "16", "--steps", "12"]
    given += ["--unwrap", "mw", "--projector", f"{WIDTH}x{WIDTH}", "--white", "white.png"]
    out = tmp_path / "out"
    assert main(["decode", str(CAPTURES / scene), "--out", str(out), *given]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["decoded"] and (out / "report.html").stat().st_size > 100_000
    assert main(["decode", str(CAPTURES / scene), "--out", str(out), "--force", *given,
                 "--shift", "-1"]) == 1  # fmt: skip
    assert "grow from right to left" in capsys.readouterr().err


@pytest.mark.parametrize("scene", SCENES)
def test_the_body_stands_before_a_flat_ground(scene, tmp_path):
    """Without a calibration, the fine pitch first and last in no order."""
    patterns = replace(PATTERNS, fringes=fringe_set((16, 14, 15), 12))
    out = decode_folder(
        CAPTURES / scene, tmp_path / "out", patterns=patterns, relief="cubic", report=False
    ).out
    with np.load(out / "decoded.npz") as found:
        relief = found["column_relief"]
    ground = np.isfinite(relief) & (np.indices(relief.shape)[0] < 100)  # above the body
    assert np.median(np.abs(relief[ground])) < 0.3
    assert (np.abs(relief) > 5).mean() > 0.03


@pytest.mark.parametrize("scene", SCENES)
def test_swapped_pitches_of_a_real_scene_are_noticed(scene):
    swapped = replace(PATTERNS, fringes=fringe_set((13, 15, 17.5), 12))
    capture = open_capture(CAPTURES / scene, PATTERNS)
    capture = replace(capture, patterns=replace(swapped, files=PATTERNS.files))
    assert any(d.severe for d in diagnose(measure(capture), capture))
