"""Unwrapping against known columns; order errors against theory."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from fpputil.decoding import unwrap
from fpputil.decoding.noise import order_error_rate, phase_sigma
from fpputil.decoding.phase import numerator_denominator, wrapped_phase
from fpputil.optics.fringes import Fringe
from fpputil.optics.view import View

WIDTH = 912
COLUMN = np.linspace(-0.49, 911.49, 40_001)


def wrapped(column, *pitches):
    return [unwrap.wrap(2 * np.pi * column / p) for p in pitches]


@pytest.mark.parametrize("pitches", [(912, 15), (912, 114, 15), (1000, 200, 50, 12.5), (912,)])
@pytest.mark.parametrize("kind", ["numpy", "torch"])
def test_multi_frequency(pitches, kind):
    phis = wrapped(COLUMN, *pitches)
    phis = [torch.from_numpy(p) for p in phis] if kind == "torch" else phis
    for Phi, pitch in zip(unwrap.mf_tpu(phis, pitches, WIDTH), pitches, strict=True):
        np.testing.assert_allclose(np.asarray(Phi), 2 * np.pi * COLUMN / pitch, atol=1e-9)


@pytest.mark.parametrize(
    "pitches, noise",
    [
        ((14, 15, 16), 0),
        ((70, 75), 0),
        ((18, 19, 20), 0),
        ((14, 15, 16, 17.2), 0),
        ((14, 14.508, 14.815), 0.015),  # from the longer beat, one order in 400 would be wrong
    ],
)
def test_multi_wavelength(pitches, noise):
    rng = np.random.default_rng(0)
    phis = [p + rng.normal(0, noise, p.shape) for p in wrapped(COLUMN[100:-100], *pitches)]
    for Phi, pitch in zip(unwrap.mw_tpu(phis, pitches, WIDTH), pitches, strict=True):
        expected = 2 * np.pi * COLUMN[100:-100] / pitch
        np.testing.assert_allclose(Phi, expected, atol=1e-7 + 6 * noise)


@pytest.mark.parametrize("pitches", [(15, 64), (31, 30), (33, 32), (24, 50), (28, 45)])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_number_theoretical(pitches, noise):
    if np.lcm(*pitches) < WIDTH:
        with pytest.raises(ValueError, match="least common multiple"):
            unwrap.nt_tpu(wrapped(COLUMN, *pitches), pitches, WIDTH)
        return
    rng = np.random.default_rng(0)
    phis = [p + rng.normal(0, noise, p.shape) for p in wrapped(COLUMN, *pitches)]
    for Phi, pitch in zip(unwrap.nt_tpu(phis, pitches, WIDTH), pitches, strict=True):
        np.testing.assert_allclose(Phi, 2 * np.pi * COLUMN / pitch, atol=1e-9 + 6 * noise)


@settings(deadline=None)
@given(
    column=st.floats(0, 911),
    high=st.floats(8, 60),
    error=st.floats(-0.9, 0.9),
)
def test_an_order_survives_any_error_below_half_a_period(column, high, error):
    """The reference may be off by just under pi in the units of the high phase."""
    Phi_ref = 2 * np.pi * column / 912 + error * np.pi * high / 912
    phi = unwrap.wrap(np.array(2 * np.pi * column / high))
    K = unwrap.fringe_order(phi, Phi_ref, 912 / high)
    np.testing.assert_allclose(unwrap.absolute_phase(phi, K), 2 * np.pi * column / high, atol=1e-6)


def test_unit_phase_starts_half_a_pixel_before_the_first_column():
    edge = np.array([-0.4999, 911.4999])
    Phi = unwrap.unit_phase(unwrap.wrap(2 * np.pi * edge / 912), 912, 912)
    np.testing.assert_allclose(Phi, 2 * np.pi * edge / 912, atol=1e-12)


def test_naive_unit_interval_costs_a_quarter_of_a_percent():
    """[0, 2 pi) at sigma_phi = 0.02 with both borders in view: about 0.26 % order errors."""
    rng = np.random.default_rng(0)
    column = np.linspace(-0.5, 911.5, 1_000_000)
    noisy = [
        unwrap.wrap(2 * np.pi * column / p + rng.normal(0, 0.02, column.shape))
        for p in (912, 114, 15)
    ]
    guard = unwrap.guard_columns(0.02, 912)
    inner = (column > guard) & (column < 911 - guard)

    def wrong(Phi_1):
        Phi_8 = noisy[1] + 2 * np.pi * unwrap.fringe_order(noisy[1], Phi_1, 8)
        Phi = noisy[2] + 2 * np.pi * unwrap.fringe_order(noisy[2], Phi_8, 7.6)
        return np.abs(Phi - 2 * np.pi * column / 15) > np.pi

    assert wrong(np.mod(noisy[0], 2 * np.pi)).mean() == pytest.approx(0.0026, abs=3e-4)
    ours = wrong(unwrap.unit_phase(noisy[0], 912, 912))
    assert ours[inner].sum() == 0


def test_an_order_is_wrong_once():
    """Predicted from the law, against a million drawn phasors whose first order may be wrong, too.

    Of three pitches, so that errors of both orders meet at one point: it counts once.
    """
    noise, B, steps, pitches = 60.0, 60.0, 15, (912, 152, 30)
    rng = np.random.default_rng(0)
    sigma = float(phase_sigma(noise, B, steps))
    first, second, third = np.angle(1 + sigma * (rng.normal(size=(3, 1_000_000, 2)) @ (1, 1j)))
    wrong = (np.abs(6 * first - second) > np.pi) | (np.abs(152 / 30 * second - third) > np.pi)
    assert order_error_rate(noise, B, steps, pitches) == pytest.approx(wrong.mean(), abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("pitches", [(912, 15), (912, 114, 15)])
def test_order_errors_are_those_predicted(pitches):
    """Within the 99 % interval, corrected for the levels, from sigma, B, N and pitches alone."""
    levels = {2: (1.0, 2.0, 3.0, 4.0, 6.0), 3: (9.0, 16.0, 18.0, 21.0, 26.0)}[len(pitches)]
    B, steps, shape = 60.0, 15, (500, 1200)
    for level in levels:
        sigma = float(phase_sigma(level, B, steps))
        guard = unwrap.guard_columns(sigma, WIDTH)
        column = np.linspace(guard, 911 - guard, shape[1], dtype=np.float32)
        column = np.broadcast_to(column, shape)
        shade = np.full(shape, 2 * B / 255, np.float32)
        view = View(column, column, shade, shade, np.ones(shape, bool))
        sums = [
            numerator_denominator(view.frames(Fringe(p, steps), level, seed, quantise=False))
            for seed, p in enumerate(pitches)
        ]
        Phi = unwrap.mf_tpu([wrapped_phase(*s) for s in sums], pitches, WIDTH)[-1]
        wrong = np.abs(Phi - 2 * np.pi * column / pitches[-1]) > np.pi
        confidence = 1 - 0.01 / len(levels)
        interval = binomtest(int(wrong.sum()), wrong.size).proportion_ci(confidence)
        predicted = order_error_rate(level, B, steps, pitches)
        assert interval.low <= predicted <= interval.high, (level, predicted, wrong.mean())


def test_spatial_unwrapping_of_one_part_and_its_loss_between_two(sphere_view):
    Phi = 2 * np.pi * np.nan_to_num(sphere_view.column).astype(float) / 114
    got = unwrap.spatial(unwrap.wrap(Phi), sphere_view.mask)
    offset = (got - Phi)[sphere_view.mask]
    np.testing.assert_allclose(offset, offset[0], rtol=0, atol=1e-9)
    assert offset[0] / (2 * np.pi) == pytest.approx(round(offset[0] / (2 * np.pi)), abs=1e-6)
    assert np.isnan(got[~sphere_view.mask]).all()


def test_spatial_unwrapping_leaves_nan_out():
    phi = np.full((6, 6), 1.0)
    phi[2, 3] = np.nan
    got = unwrap.spatial(phi, np.ones((6, 6), np.uint8))
    assert np.isnan(got).sum() == 1 and np.isnan(got[2, 3])
