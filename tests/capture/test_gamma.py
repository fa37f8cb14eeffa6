"""A response that is not linear: seen in the second harmonic, and taken back."""

import numpy as np
import pytest

from fpputil.capture.faults.gamma import estimate_gamma, harmonic_ratio, linearise
from fpputil.decoding import phase


def photographs(steps, gamma, pixels=2000, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    phi, albedo = rng.uniform(-np.pi, np.pi, pixels), rng.uniform(0.3, 0.9, pixels)
    delta = 2 * np.pi * np.arange(steps)[:, None] / steps
    light = albedo * (1 + np.cos(phi + delta)) / 2
    return 255 * light**gamma + noise * rng.standard_normal(light.shape), phi


@pytest.mark.parametrize("gamma", [2.5, 1.0, 1 / 2.2])
@pytest.mark.parametrize("steps", [5, 8, 12])
def test_gamma_is_found_and_takes_the_harmonics_away(gamma, steps):
    frames, _ = photographs(steps, gamma)
    result = estimate_gamma(frames)
    assert result == pytest.approx(gamma, rel=0.02 if steps > 5 else 0.15)
    assert abs(harmonic_ratio(linearise(frames, result), 2)) < 1e-4
    assert harmonic_ratio(frames / 1e6, 2) == pytest.approx(harmonic_ratio(frames, 2))


def test_three_steps_gain_by_the_gamma_that_twelve_found():
    many, _ = photographs(12, 1 / 0.45, noise=0.1)
    few, phi = photographs(3, 1 / 0.45, noise=0.1, seed=1)
    gamma = estimate_gamma(np.clip(many, 0, 255))

    def error(frames):
        phi_found = phase.wrapped_phase(*phase.numerator_denominator(frames.astype(np.float64)))
        return np.sqrt(np.mean(np.angle(np.exp(1j * (phi_found - phi))) ** 2))

    clipped = np.clip(few, 0, 255)
    best = error(linearise(clipped, 1 / 0.45))  # with the gamma that is true
    assert error(linearise(clipped, gamma)) < 1.05 * best < 0.2 * error(clipped)


def test_linear_is_one_curve_for_all_depths():
    grey = np.array([0, 51, 255], np.uint8)
    expected = 255 * np.array([0, 0.2, 1]) ** 0.5
    np.testing.assert_allclose(linearise(grey, 2), expected, rtol=1e-6)
    np.testing.assert_allclose(
        linearise(grey.astype(np.uint16) * 257, 2, 65535), expected, rtol=1e-6
    )
    np.testing.assert_allclose(linearise(grey / 255.0, 2, 1.0), expected, rtol=1e-6)
    np.testing.assert_allclose(linearise(grey.astype(int), 2), expected, rtol=1e-6)
