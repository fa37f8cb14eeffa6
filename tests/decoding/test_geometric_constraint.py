"""Minimum phase and refined reference against geometry."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from fpputil.decoding import geometric_constraint as ref
from fpputil.decoding import unwrap


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("centred", [True, False])
@pytest.mark.parametrize("z", [481.0, 560.0, 664.0, 819.0])
def test_order_is_right_anywhere_in_the_range(tiny, side, centred, z):
    system = tiny.system if side == "right" else tiny.system.mirrored()
    column = system.columns_at(z)
    lit = (column >= -0.5) & (column < 911.5)
    Phi = 2 * np.pi * column / 304
    phi = unwrap.wrap(Phi)
    Phi_min = ref.minimum_phase(system, 304, centred=centred)
    np.testing.assert_allclose((phi + 2 * np.pi * ref.zmin_order(phi, Phi_min))[lit], Phi[lit])


@settings(deadline=None, max_examples=40)
@given(z=st.floats(480, 820), noise=st.floats(-1.4, 1.4))
def test_centring_leaves_room_for_noise(z, noise):
    """At least 2.8 rad of the period are free: half of them on either side."""
    from fpputil.optics.system import preset

    system = preset("tiny").system
    Phi = 2 * np.pi * system.columns_at(z) / 304
    lit = (Phi > 0) & (Phi < 6 * np.pi)
    phi = unwrap.wrap(Phi + noise)
    got = phi + 2 * np.pi * ref.zmin_order(phi, ref.minimum_phase(system, 304))
    np.testing.assert_allclose(got[lit], (Phi + noise)[lit], atol=1e-9)


def test_range_fills_the_period_as_designed(tiny):
    near, far = (tiny.system.columns_at(z) for z in (480.0, 820.0))
    span = 2 * np.pi * np.abs(far - near) / 304
    assert span.min() < 0.02 and span.max() < 2 * np.pi - 2.8


@pytest.mark.parametrize("pitch", [15, 114])
def test_range_longer_than_a_period(tiny, pitch):
    with pytest.raises(ValueError, match="spans .* periods, and the minimum phase needs less"):
        ref.minimum_phase(tiny.system, pitch)
    assert np.isfinite(ref.minimum_phase(tiny.system, pitch, ambiguous=True)).all()


@pytest.mark.parametrize("pitch", [15, 114, 304])
def test_depth_range_moves_the_column_by_one_pitch(tiny, pitch):
    system, z = tiny.system, 560.0
    reach = ref.depth_range(system, pitch, z)
    finite = np.isfinite(reach)
    moved = np.abs(system.columns_at(z + np.where(finite, reach, 0)) - system.columns_at(z))
    np.testing.assert_allclose(moved[finite], pitch, rtol=1e-6)


def test_depth_range_is_proportional_to_the_pitch_for_small_pitches(tiny):
    """Not inversely proportional: the paper's prose says both."""
    a, b = (ref.depth_range(tiny.system, p, 660.0)[60, 40] for p in (1.0, 2.0))
    assert b / a == pytest.approx(2, rel=0.02)


def refined(view, noise=0.0, seed=0, pitch_h=15):
    rng = np.random.default_rng(seed)
    column = view.column[view.mask].astype(np.float64)
    phi = {
        p: unwrap.wrap(2 * np.pi * column / p + rng.normal(0, noise, column.shape))
        for p in (912, 304, 114, pitch_h)
    }
    return column, phi


def test_two_wrapped_phases_equal_three_frequencies(tiny, sphere_view):
    _, phi = refined(sphere_view, 0.03)
    Phi_1, Phi_8, Phi_h = unwrap.mf_tpu([phi[912], phi[114], phi[15]], (912, 114, 15), 912)
    Phi_min = ref.minimum_phase(tiny.system, 304)[sphere_view.mask]
    K_z = ref.zmin_order(phi[304], Phi_min)
    phi_r, M_r, D_r = ref.refined_reference(Phi_8, K_z, 114, 304)
    from_network = -np.arctan2(M_r, D_r)
    two = ref.two_phase_absolute(phi[15], from_network, Phi_min, 15, 304)
    np.testing.assert_allclose(two, Phi_h, atol=1e-9)
    np.testing.assert_allclose(unwrap.wrap(phi_r - from_network), 0, atol=1e-9)


def test_the_low_frames_cancel_from_the_target(tiny, sphere_view):
    """Any whole K_z, even a wrong one, gives the same M_r and D_r."""
    _, phi = refined(sphere_view, 0.03)
    Phi_8 = unwrap.mf_tpu([phi[912], phi[114]], (912, 114), 912)[-1]
    K = np.random.default_rng(0).integers(-5, 5, Phi_8.shape)
    right = ref.refined_reference(Phi_8, 0 * K, 114, 304)
    wrong = ref.refined_reference(Phi_8, K, 114, 304)
    for a, b in zip(right[1:], wrong[1:], strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


def test_refined_reference_is_the_phase_of_the_low_pitch():
    column = np.linspace(0, 911, 500)
    _, M, D = ref.refined_reference(2 * np.pi * column / 114, 0 * column, 114, 304)
    np.testing.assert_allclose(M, -np.sin(2 * np.pi * column / 304), atol=1e-12)
    np.testing.assert_allclose(D, np.cos(2 * np.pi * column / 304), atol=1e-12)


def test_torch_takes_the_same_line_and_no_gradient_passes_the_rounding():
    phi_h = torch.tensor([0.3, -1.0], dtype=torch.float64, requires_grad=True)
    phi_z = torch.tensor([0.1, 2.0], dtype=torch.float64, requires_grad=True)
    Phi = ref.two_phase_absolute(phi_h, phi_z, torch.zeros(2, dtype=torch.float64), 15, 304)
    Phi.sum().backward()
    assert phi_h.grad.tolist() == [1, 1] and phi_z.grad.tolist() == [0, 0]
    expected = ref.two_phase_absolute(
        phi_h.detach().numpy(), phi_z.detach().numpy(), np.zeros(2), 15, 304
    )
    np.testing.assert_allclose(Phi.detach(), expected)


def test_near_objects_need_pitch_304():
    """There the range is longer than a period of pitch 114 where objects stand; nowhere at 304."""
    from fpputil.optics.system import preset

    system = preset("near").system
    periods = {
        pitch: np.ptp(ref.phase_range(system, pitch), axis=0) / (2 * np.pi) for pitch in (114, 304)
    }
    assert 1.8 < periods[114][60, 80] < 2
    assert np.nanmax(periods[304]) < 0.9


def test_a_range_ends_where_the_projector_does(tiny):
    """Half a pixel beyond the centres of its first and last column."""
    low, high = ref.phase_range(tiny.system, 24)
    assert np.nanmin(low) == pytest.approx(2 * np.pi * -0.5 / 24)
    assert np.nanmax(high) == pytest.approx(2 * np.pi * 911.5 / 24)
