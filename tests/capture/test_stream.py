"""Sums photograph by photograph against the equations on all of them at once."""

import numpy as np
import pytest

from fpputil.capture.stream import Sums
from fpputil.decoding import phase
from fpputil.optics.fringes import Fringe


def photographs(steps, dtype, full, shape=(37, 61)):
    rng = np.random.default_rng(steps)
    phi, B = rng.uniform(-3, 3, shape), rng.uniform(0.1, 0.4, shape)
    delta = 2 * np.pi * np.arange(steps)[:, None, None] / steps
    light = 0.5 + B * np.cos(phi + delta) + 0.02 * rng.standard_normal((steps, *shape))
    light = np.clip(light, 0, 1) * full
    return light.astype(dtype) if dtype == np.float32 else np.rint(light).astype(dtype)


@pytest.mark.parametrize("dtype, full", [(np.uint8, 255), (np.uint16, 4095), (np.float32, 1.0)])
@pytest.mark.parametrize("steps", [3, 4, 15])
def test_sums_are_those_of_the_equations(steps, dtype, full):
    frames = photographs(steps, dtype, full)
    sums = Sums.empty(Fringe(20, steps), frames.shape[1:])
    order = np.random.default_rng(0).permutation(steps)
    for part in np.array_split(order, 2):
        sums.add(frames[part], part, 255 / full, full)
    grey = frames.astype(np.float64) * (255 / full)
    M, D = phase.numerator_denominator(grey)
    off = np.angle(np.exp(1j * (sums.wrapped - phase.wrapped_phase(M, D))))
    assert np.abs(off).max() < 1e-5
    np.testing.assert_allclose(sums.modulation, phase.modulation(M, D, steps), atol=1e-3)
    np.testing.assert_allclose(sums.average, grey.mean(axis=0), atol=1e-3)
    np.testing.assert_array_equal(sums.clipped, (frames >= full).sum(axis=0))
    if steps == 3:
        assert np.isnan(sums.scatter).all()
        return
    delta = 2 * np.pi * np.arange(steps) / steps
    terms = np.stack([np.ones(steps), np.cos(delta), np.sin(delta)], 1)
    flat = grey.reshape(steps, -1)
    rest = flat - terms @ np.linalg.lstsq(terms, flat, rcond=None)[0]
    expected = (rest**2).sum(axis=0).reshape(frames.shape[1:]) / (steps - 3)
    np.testing.assert_allclose(sums.scatter, expected, atol=0.02)
