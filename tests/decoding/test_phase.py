"""Phase shifting against closed forms, in NumPy and in torch."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from fpputil.decoding import phase
from fpputil.decoding.noise import phase_density, phase_sigma
from fpputil.decoding.unwrap import mf_tpu, wrap
from fpputil.optics.fringes import fringe_set


def ideal(phi, A=100.0, B=50.0, steps=15):
    delta = 2 * np.pi * np.arange(steps) / steps
    return A + B * np.cos(phi[None] + delta.reshape(-1, *[1] * phi.ndim))


PHI = np.linspace(-np.pi + 1e-6, np.pi - 1e-6, 300).reshape(20, 15)


@pytest.mark.parametrize("steps", range(3, 16))
@pytest.mark.parametrize("kind", ["numpy", "torch"])
def test_three_unknowns_are_recovered(steps, kind):
    frames = ideal(PHI, 100, 50, steps)
    frames = torch.from_numpy(frames) if kind == "torch" else frames
    M, D = phase.numerator_denominator(frames)
    assert type(M) is type(frames)
    np.testing.assert_allclose(np.asarray(phase.wrapped_phase(M, D)), PHI, atol=1e-12)
    np.testing.assert_allclose(np.asarray(phase.modulation(M, D, steps)), 50)
    np.testing.assert_allclose(np.asarray(phase.average(frames)), 100)


@pytest.mark.parametrize("steps", range(3, 16))
@pytest.mark.parametrize("scene", ["sphere_view", "paper_sphere_view"])
def test_absolute_phase_is_the_stored_column(request, scene, steps, tiny):
    """Float frames without noise: geometry to 1e-9 rad, borders included."""
    view = request.getfixturevalue(scene)
    fringes = fringe_set((912, 114, 15), steps)
    sums = [phase.numerator_denominator(view.frames(f, quantise=False)) for f in fringes]
    Phi = mf_tpu([phase.wrapped_phase(*s) for s in sums], [f.pitch for f in fringes], 912)
    error = (Phi[-1] - fringes[-1].phase(view.column))[view.mask]
    assert np.abs(error).max() < 1e-9


def test_absolute_phase_at_the_borders_of_the_projector():
    column = np.array([[-0.5, -0.4999, 0, 911, 911.4999]])
    fringes = fringe_set((912, 114, 15), 5)
    phis = []
    for f in fringes:
        frames = np.stack([f.intensity(column, n) for n in range(5)])
        phis.append(phase.wrapped_phase(*phase.numerator_denominator(frames)))
    Phi = mf_tpu(phis, [912, 114, 15], 912)[-1]
    np.testing.assert_allclose(Phi[:, 1:], fringes[-1].phase(column)[:, 1:], atol=1e-9)


@given(st.floats(-1e4, 1e4))
def test_wrap_is_idempotent_and_keeps_the_phasor(x):
    w = wrap(np.array([x]))
    assert -np.pi - 1e-9 < w[0] <= np.pi + 1e-9
    np.testing.assert_allclose(np.exp(1j * w), np.exp(1j * x), atol=1e-9)
    np.testing.assert_allclose(wrap(w), w, atol=1e-9)


@pytest.mark.parametrize(
    "threshold, kept", [(8.0, [False, False, True]), (7.0, [False, True, True])]
)
def test_mask_is_strict(threshold, kept):
    assert phase.mask(np.array([1.0, 8.0, 8.1]), threshold).tolist() == kept


@pytest.mark.parametrize("noise, B, steps", [(1, 50, 3), (2, 20, 5), (3, 60, 15)])
def test_phase_noise_is_the_closed_form(noise, B, steps):
    rng = np.random.default_rng(0)
    phi = rng.uniform(-np.pi, np.pi, 100_000)
    frames = ideal(phi, 100, B, steps) + rng.normal(0, noise, (steps, phi.size))
    error = wrap(phase.wrapped_phase(*phase.numerator_denominator(frames)) - phi)
    assert error.std() == pytest.approx(phase_sigma(noise, B, steps), rel=0.01)


@pytest.mark.parametrize("sigma", [0.02, 0.12, 0.5, 2.0])
def test_phase_density_is_a_density_and_is_sampled(sigma):
    grid = np.linspace(-np.pi, np.pi, 20001)
    density = phase_density(grid, sigma)
    assert trapezoid(density, grid) == pytest.approx(1, abs=1e-6)
    rng = np.random.default_rng(1)
    z = 1 + sigma * (rng.standard_normal(400_000) + 1j * rng.standard_normal(400_000))
    measured, edges = np.histogram(np.angle(z), bins=40, range=(-np.pi, np.pi), density=True)
    within = np.linspace(edges[:-1], edges[1:], 101)
    predicted = phase_density(within, sigma).mean(axis=0)
    np.testing.assert_allclose(measured, predicted, atol=0.02 * predicted.max() + 0.01)


def test_torch_differentiates_through_the_equations():
    x = torch.tensor(ideal(PHI, 100, 50, 5), requires_grad=True)
    phase.wrapped_phase(*phase.numerator_denominator(x)).sum().backward()
    delta = 2 * np.pi / 5
    expected = -np.sin(PHI + delta) * 2 / (5 * 50)  # d phi / d I_1
    np.testing.assert_allclose(x.grad[1], expected, atol=1e-12)
