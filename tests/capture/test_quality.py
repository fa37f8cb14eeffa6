"""The fit of a fringe, its noise and its faults, against the equations written out."""

import numpy as np
import pytest

from fpputil.capture.faults.curve import fit_response
from fpputil.capture.quality import Noise, Reason, judge, noise_of, parted
from fpputil.decoding import phase
from fpputil.optics.fringes import Fringe


def photographs(steps, dtype, full, shape=(37, 61)):
    """Of which many are dark, scattered or saturated."""
    rng = np.random.default_rng(steps)
    phi, B, A = rng.uniform(-3, 3, shape), rng.uniform(0, 0.2, shape), rng.uniform(0.2, 0.95, shape)
    delta = 2 * np.pi * np.arange(steps)[:, None, None] / steps
    scatter = rng.uniform(0, 0.06, shape) * rng.standard_normal((steps, *shape))
    light = np.clip(A + B * np.cos(phi + delta) + scatter, 0, 1) * full
    return light.astype(dtype) if dtype == np.float32 else np.rint(light).astype(dtype)


@pytest.mark.parametrize("shift", [1, -1])
@pytest.mark.parametrize("dtype, full", [(np.uint8, 255), (np.uint16, 4095), (np.float32, 1.0)])
@pytest.mark.parametrize("steps", [3, 4, 15])
def test_the_fit_is_that_of_least_squares(steps, dtype, full, shift, monkeypatch):
    monkeypatch.setattr("fpputil.capture.faults.curve.BLOCK", 2000)  # several blocks of rows
    frames = photographs(steps, dtype, full)
    result = fit_response(frames, Fringe(20, steps), shift, 1.0, full)
    grey = frames.astype(np.float64) * (255 / full)
    M, D = phase.numerator_denominator(grey)
    B = phase.modulation(M, D, steps)
    off = np.angle(np.exp(1j * (result.wrapped - shift * phase.wrapped_phase(M, D))))
    assert np.abs(off)[B > 1].max() < 1e-5
    np.testing.assert_allclose(result.modulation, B, atol=1e-3)
    np.testing.assert_allclose(result.average, grey.mean(axis=0), atol=1e-3)
    np.testing.assert_array_equal(result.clipped, (frames >= full).sum(axis=0))
    delta = 2 * np.pi * np.arange(steps) / steps
    terms = np.stack([np.ones(steps), np.cos(delta), np.sin(delta)], 1)
    flat = grey.reshape(steps, -1)
    left = flat - terms @ np.linalg.lstsq(terms, flat, rcond=None)[0]
    variance = (left**2).sum(axis=0).reshape(B.shape) / max(steps - 3, 1)
    np.testing.assert_allclose(result.residual, variance, atol=0.02)


@pytest.mark.parametrize("steps", [3, 4, 12])
def test_pixels_are_left_out_as_the_criteria_say(steps):
    noise, threshold = Noise(2.0, 0.05, True), 8.0
    fringe = Fringe(912, steps)
    one = fit_response(photographs(steps, np.uint8, 255), fringe)
    column = np.full(one.wrapped.shape, 3.0, np.float32)  # radians, well inside the projector
    reason, sigmas, *_ = judge([one], [fringe], [column], noise, threshold, "mf", 912)
    variance = noise.variance(one.average)
    expected = np.select(
        [
            one.modulation <= threshold,
            one.clipped > 0.1 * steps,
            np.sqrt(one.residual) > 0.25 * one.modulation + 3 * np.sqrt(variance),
        ],
        [Reason.DARK, Reason.SATURATED, Reason.SCATTERED],
        Reason.GOOD,
    )
    np.testing.assert_array_equal(reason, expected)
    assert len(np.unique(expected)) == (3 if steps == 3 else 4)  # three steps have no scatter
    lit = one.modulation > 0
    sigma = np.sqrt(2 / steps * variance[lit]) / one.modulation[lit]
    np.testing.assert_allclose(sigmas[0][lit], sigma, rtol=1e-5)


def test_a_change_of_the_modulation_is_left_out_where_it_is_not_that_around():
    fringes, shape = (Fringe(912, 8), Fringe(114, 8)), (60, 60)
    delta = 2 * np.pi * np.arange(8)[:, None, None] / 8
    column = np.full(shape, 456.0)
    B = [np.full(shape, 50.0), np.full(shape, 40.0)]  # as out of focus everywhere
    B[1][30, 30] *= np.exp(-0.2 - 0.1)
    frames = [120 + b * np.cos(f.phase(column) + delta) for b, f in zip(B, fringes, strict=True)]
    fits = [fit_response(f, fringe) for f, fringe in zip(frames, fringes, strict=True)]
    Phis = [f.phase(column).astype(np.float32) for f in fringes]
    reason, *_ = judge(fits, fringes, Phis, Noise(0.1, 0, True), 8.0, "mf", 912)
    assert reason[30, 30] == Reason.UNSTEADY
    assert (reason != Reason.GOOD).sum() == 1


def test_four_steps_tell_the_noise_whatever_the_response():
    """Their second harmonic is noise where twice the phase is a right angle, nowhere else."""
    rng = np.random.default_rng(0)
    phi = rng.uniform(-np.pi, np.pi, 40000) + np.pi / 2 * np.arange(4)[:, None]
    frames = 120 + 60 * np.cos(phi) + 2 * np.cos(2 * phi) + rng.standard_normal(phi.shape)
    assert noise_of([frames], 8).variance(120) == pytest.approx(1, abs=0.5)


def test_the_noise_is_found_as_a_line_over_the_grey_level():
    rng = np.random.default_rng(0)
    level = rng.uniform(30, 200, 40000)
    for steps in (4, 5, 8, 12, 20):
        phi = rng.uniform(-3, 3, 40000) + 2 * np.pi * np.arange(steps)[:, None] / steps
        frames = level + 25 * np.cos(phi)
        frames = frames + np.sqrt(2 + 0.03 * frames) * rng.standard_normal(frames.shape)
        noise = noise_of([frames], 8)
        for grey in (50, 180):
            assert noise.variance(grey) == pytest.approx(2 + 0.03 * grey, rel=0.1)
    assert not noise_of([rng.uniform(0, 255, (3, 4000))], 8).known
    assert Noise(0, 0, True).variance(5) == pytest.approx(1 / 12)


@pytest.mark.parametrize("steps", [5, 6, 8, 12])
def test_a_response_is_not_taken_for_noise(steps):
    """Its harmonics of more than half the steps alias to the highest one that is looked at."""
    rng = np.random.default_rng(0)
    turn = rng.uniform(-np.pi, np.pi, 20000) + 2 * np.pi * np.arange(steps)[:, None] / steps
    frames = 10 + 200 * ((1 + np.cos(turn)) / 2) ** 0.5 + rng.standard_normal(turn.shape)
    assert noise_of([frames], 8).variance(120) == pytest.approx(1, abs=0.35)


@pytest.mark.parametrize("periods, pair", [((64, 63, 56), 1), ((64, 57, 56), 0)])
def test_every_pitch_is_held_against_the_shortest_beat(periods, pair):
    pitches, off = [912 / n for n in periods], np.array([0.02, -0.01, 0.03])  # periods
    column = np.linspace(50, 800, 7)
    Phis = [np.float32(2 * np.pi * (column / p + d)) for p, d in zip(pitches, off, strict=True)]
    beat = 912 / (periods[pair] - periods[pair + 1])
    held = [k for k in range(3) if k != pair + 1]
    expected = [beat / pitches[k] * (off[pair] - off[pair + 1]) - off[k] for k in held]
    found = list(parted(Phis, pitches, [np.float32(0.1)] * 3, "mw", 912))
    assert len(found) == 3  # and one beat against the other
    for (apart, _), value in zip(found, expected, strict=False):
        np.testing.assert_allclose(apart, value, atol=1e-3)
