"""Captures through a response of which three or four steps are all there is."""

import os
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from fpputil.capture.faults.curve import fit_response
from fpputil.capture.faults.diagnosis import diagnose
from fpputil.capture.faults.gamma import gamma_of_few, gamma_of_plain, linearise, power_profile
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.quality import Reason
from fpputil.decoding.unwrap import wrap
from fpputil.optics.fringes import Fringe, fringe_set

PROJECTOR = (912, 1140)
CAPTURES = Path(os.environ.get("FPP_CAPTURES", Path(__file__).parents[3] / "shared" / "captures"))
GAMMAS = (1.4, 1.8, 2.2, 2.6)


def three(steps=3, **plain):
    return Patterns(PROJECTOR, fringe_set((912, 114, 36), steps), **plain)


PLAIN = {"white": "white.png", "black": "black.png"}


@pytest.mark.parametrize("gamma", GAMMAS)
def test_three_steps_with_white_and_black_are_right_through_a_projector_gamma(judged, error, gamma):
    result, findings = judged(three(**PLAIN), response=gamma)
    off, share = error(result)
    assert result.gamma == pytest.approx(gamma, rel=0.02)
    assert "plain light" in result.told and result.numbers()["gamma"].endswith(result.told)
    assert np.sqrt(np.mean(off**2)) < 0.03 and share > 0.98
    assert findings == {}


@pytest.mark.parametrize("steps", [3, 4])
@pytest.mark.parametrize("gamma", [1.4, 2.2])
def test_three_and_four_steps_alone_tell_a_projector_gamma(judged, error, steps, gamma):
    result, findings = judged(three(steps), response=gamma)
    off, share = error(result)
    assert np.sqrt(np.mean(off**2)) < 0.03 and share > 0.97
    assert not any(finding.severe for finding in findings.values())


@pytest.mark.parametrize(
    ("steps", "noise", "without"), [(3, 0.3, 0.1), (4, 1, 0.05), (8, 1, 0.015)]
)
def test_black_is_subtracted_before_a_given_power(judged, error, steps, noise, without):
    def pixels(plain):
        patterns = Patterns(PROJECTOR, fringe_set((912, 114, 19), steps), **plain)
        result, _ = judged(patterns, response=2.2, gamma_back=2.2, noise=noise)
        return np.median(np.abs(error(result)[0])) * 19 / (2 * np.pi)

    assert pixels({}) > without
    assert pixels(PLAIN) <= 0.02


def test_a_white_photograph_in_another_light_is_not_believed(judged, error):
    def brighter(frames):
        return frames | {"white.png": np.clip(frames["white.png"] * 1.5, 0, 255).astype(np.uint8)}

    result, _ = judged(three(4, **PLAIN), brighter, response=2.2, gain=0.6)
    assert "curve" in result.told
    assert np.sqrt(np.mean(error(result)[0] ** 2)) < 0.03


@pytest.mark.parametrize("steps", [3, 4])
def test_a_linear_response_is_left_alone(judged, steps):
    for plain in (PLAIN, {}):
        result, findings = judged(three(steps, **plain))
        assert result.gamma == 1 and result.told == ""
        assert set(findings) <= {"noise"}


def test_a_response_that_is_not_taken_back_is_named_with_the_ways_out(judged):
    result, findings = judged(three(), response=2.2, gamma_back=1.0)
    assert findings["response"].severe
    assert "disagree" not in findings and "pitch" not in findings
    for way in ("--gamma", "five steps", "white", "fpp patterns --gamma"):
        assert way in findings["response"].remedy


@pytest.mark.parametrize("steps", [4, 5, 8])
@pytest.mark.parametrize("gamma", [0.5, 2.2, 2.6])
def test_harmonics_of_a_response_empty_no_mask(judged, steps, gamma):
    """The second is a quarter of the fringe and more, and no scatter."""
    result, findings = judged(three(steps), response=gamma, gamma_back=1.0)
    assert result.mask.sum() > 0.97 * result.lit.sum()
    assert not any(finding.severe for finding in findings.values())


def test_the_mean_between_black_and_white_is_that_of_the_power():
    rng = np.random.default_rng(0)
    for gamma in (0.5, 1.0, 2.2, 3.0):
        turn = rng.uniform(-np.pi, np.pi, 5000) + 2 * np.pi * np.arange(3)[:, None] / 3
        light = 30 + 150 * ((1 + np.cos(turn)) / 2) ** gamma
        plain = np.full(5000, 180.0), np.full(5000, 30.0)
        assert gamma_of_plain([light], *plain) == pytest.approx(gamma, rel=0.02)
    with pytest.raises(ValueError, match="another light"):
        gamma_of_plain([light], np.full(5000, 240.0), np.full(5000, 30.0))
    with pytest.raises(ValueError, match="too few pixels"):
        gamma_of_plain([light], np.full(5000, 255.0), np.full(5000, 30.0))


@pytest.mark.parametrize("steps", [3, 5])
@pytest.mark.parametrize("plain", [None, 200.0, 255.0], ids=["no white", "white", "white clipped"])
def test_what_a_power_leaves_is_the_variance_of_the_noise(steps, plain):
    shape, fringe, rng = (100, 200), Fringe(24, steps), np.random.default_rng(0)
    turn = rng.uniform(-np.pi, np.pi, shape) + fringe.shifts[:, None, None]
    frames = 20 + 180 * ((1 + np.cos(turn)) / 2) ** 2.2 + rng.normal(0, 2, (steps, *shape))
    white = None if plain is None else plain + rng.normal(0, 2 * (plain < 255), shape)
    result = fit_response(frames, fringe, gamma=2.2, black=20.0, white=white)
    assert result.residual.mean() == pytest.approx(4, rel=0.05)


def test_the_profile_is_the_power_of_a_fringe_and_its_slope():
    light, slope = power_profile(1.7)
    x = 2 * np.pi * np.arange(len(light)) / len(light)
    np.testing.assert_allclose(light, ((1 + np.cos(x)) / 2) ** 1.7, atol=1e-4)
    np.testing.assert_allclose(slope, np.gradient(light, x[1]), atol=2e-3)
    blurred, _ = power_profile(1.7, blur=0.1)
    ratio = np.abs(np.fft.rfft(blurred))[1:3] / np.abs(np.fft.rfft(light))[1:3]
    np.testing.assert_allclose(ratio, np.exp([-0.1, -0.4]), rtol=1e-3)


@pytest.mark.parametrize("steps", [3, 4])
def test_few_steps_of_a_camera_gamma_tell_it(steps):
    rng = np.random.default_rng(0)
    phis = rng.uniform(-np.pi, np.pi, (3, 4000))
    turns = phis[:, None] + 2 * np.pi * np.arange(steps)[:, None] / steps
    light = 255 * ((1.2 + np.cos(turns)) / 2.2) ** 2.2
    gamma = gamma_of_few(list(light))
    assert gamma == pytest.approx(2.2, rel=0.05)
    straight = linearise(light[0], gamma)
    assert np.ptp(straight.mean(axis=0)) < 0.1 * np.ptp(light[0].mean(axis=0)) or steps == 4


@pytest.mark.skipif(not CAPTURES.is_dir(), reason=f"no real captures at {CAPTURES.name}/")
@pytest.mark.parametrize("scene", ["david", "bottle"])
def test_real_captures_of_three_steps_are_kept_and_right(scene, tmp_path):
    every = Patterns((1000, 1000), fringe_set((14, 15, 16), 12), "mw",
                     files="period{pitch}_step{step:02}.png")  # fmt: skip
    whole = open_capture(CAPTURES / scene, every)
    few = replace(every, fringes=fringe_set((14, 15, 16), 3))
    for k, pitch in enumerate((14, 15, 16)):
        for n, frame in enumerate(whole.frames(k)[::4]):
            cv2.imwrite(str(tmp_path / f"period{pitch}_step{n:02}.png"), frame)
    truth, capture = measure(whole), open_capture(tmp_path, few)
    result = measure(capture)
    assert not any(finding.severe for finding in diagnose(result, capture))
    assert result.mask.sum() > 0.95 * result.lit.sum()
    both = result.mask & truth.mask
    assert (np.abs(result.Phi - truth.Phi)[both] < 1).mean() > 0.999
    off = wrap(result.wrapped[0] - truth.wrapped[0])[truth.modulation[0] > 10]
    assert np.sqrt(np.mean(off**2)) < 0.035  # 0.12 and 0.10 as photographed
    plain = measure(capture, gamma=1.0)
    assert (plain.reason == Reason.UNSTEADY).sum() < 0.03 * plain.lit.sum()  # 0.35 and 0.25 once


def test_a_board_through_a_gamma_is_a_pose(tmp_path, wall):
    from fpputil.capture.folder import board_pose
    from fpputil.capture.virtual import photograph_into
    from fpputil.optics.system import preset

    fringes = (*fringe_set((1140, 114, 36), 3), *fringe_set((1140, 114, 36), 3, axis="row"))
    for plain in (PLAIN, {}):
        patterns = Patterns(PROJECTOR, fringes, **plain)
        folder = tmp_path / f"pose-{len(plain)}"
        camera = {"noise": 1.0, "ambient": 10.0}
        photograph_into(folder, wall, patterns, preset("small").system, response=2.2, **camera)
        pose, _ = board_pose(folder)
        for found, truth in ((pose.column, wall.column), (pose.row, wall.row)):
            assert np.isfinite(found).mean() > 0.95 * wall.mask.mean()
            assert np.nanmedian(np.abs(found - truth)) < 0.15


def test_corrected_patterns_are_photographed_as_sinusoids(judged, error):
    patterns = three(gamma=2.2)
    shown = patterns.picture(patterns.shots()[0])[0].astype(float)
    through = 255 * (shown / 255) ** 2.2
    line = Fringe(912, 3).intensity(np.arange(912), 0)
    assert np.abs(through - line).max() < 1.5
    result, findings = judged(patterns, response=2.2)
    assert result.gamma == 1 and np.sqrt(np.mean(error(result)[0] ** 2)) < 0.03
    assert set(findings) <= {"noise"}
    with pytest.raises(ValueError, match="a number from 0.1 to 10 is needed"):
        three(gamma=0)


def test_corrected_patterns_say_so_in_their_file(tmp_path):
    for gamma in (1.0, 2.2):
        three(gamma=gamma).save(tmp_path / "patterns.toml")
        text = (tmp_path / "patterns.toml").read_text()
        assert ("gamma" in text) == (gamma != 1)
        assert Patterns.load(tmp_path / "patterns.toml") == three(gamma=gamma)
