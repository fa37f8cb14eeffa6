"""Fringes against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fpputil.optics.fringes import Fringe, fringe_set

COLUMN = np.linspace(-0.5, 911.5, 4001)


@pytest.mark.parametrize("pitch", [15, 114, 304, 912, 17.3])
@pytest.mark.parametrize("steps", [3, 4, 15])
def test_equation_1(pitch, steps):
    fringe = Fringe(pitch, steps)
    for n in range(steps):
        expected = 255 / 2 * (1 + np.cos(2 * np.pi * COLUMN / pitch + 2 * np.pi * n / steps))
        np.testing.assert_allclose(fringe.intensity(COLUMN, n), expected, atol=1e-9)


@pytest.mark.slow
@given(
    pitch=st.floats(1.0, 2000.0),
    steps=st.integers(3, 30),
    column=st.floats(-0.5, 911.5),
)
def test_steps_sum_to_a_constant(pitch, steps, column):
    fringe = Fringe(pitch, steps)
    total = sum(fringe.intensity(np.array([column]), n)[0] for n in range(steps))
    assert total == pytest.approx(steps * 255 / 2)


@pytest.mark.parametrize("axis, shape", [("column", (1, 912)), ("row", (1140, 1))])
def test_images_vary_along_one_axis(axis, shape):
    images = Fringe(15, 4, axis=axis, levels=256).images(912, 1140)
    assert images.shape == (4, 1140, 912) and images.dtype == np.uint8
    line = images[1].reshape(1140, 912)[: shape[0], : shape[1]]
    assert (images[1] == line).all()
    i = np.arange(912 if axis == "column" else 1140)
    expected = np.rint(255 / 2 * (1 + np.cos(2 * np.pi * i / 15 + np.pi / 2)))
    np.testing.assert_array_equal(line.ravel(), expected)


@pytest.mark.parametrize("levels, error", [(256, 0.5), (16, 8.5), (2, 127.5)])
def test_quantisation_rounds_to_the_nearest_level(levels, error):
    difference = Fringe(15, levels=levels).intensity(COLUMN, 0) - Fringe(15).intensity(COLUMN, 0)
    assert np.abs(difference).max() <= error + 1e-9
    assert len(np.unique(Fringe(15, levels=levels).intensity(COLUMN, 0).round(6))) <= levels


def test_gamma_is_a_power_of_the_normalised_intensity():
    expected = 255 * (Fringe(15).intensity(COLUMN, 2) / 255) ** 2.2
    np.testing.assert_allclose(Fringe(15, gamma=2.2).intensity(COLUMN, 2), expected)


def test_pixel_grid_is_constant_over_a_pixel():
    value = Fringe(15, grid=True).intensity(np.array([6.5, 6.9, 7.0, 7.49]), 0)
    np.testing.assert_allclose(value, Fringe(15).intensity(np.array(7.0), 0))


@pytest.mark.parametrize("pitch", [15, 24])
@pytest.mark.parametrize("sigma", [1.5, 3.0])
def test_defocus_attenuates_as_a_gaussian(pitch, sigma):
    column = np.linspace(300, 300 + pitch, 200, endpoint=False)
    blurred = Fringe(pitch, defocus=sigma).intensity(column, 0)
    first = 2 * np.abs(np.mean(blurred * np.exp(2j * np.pi * column / pitch)))
    pixel = np.sinc(1 / pitch)
    assert first / 127.5 == pytest.approx(
        np.exp(-2 * (np.pi * sigma / pitch) ** 2) * pixel, rel=2e-3
    )
    assert blurred.mean() == pytest.approx(127.5, rel=1e-6)


def test_sets_pair_pitches_with_steps():
    fringes = fringe_set((912, 114, 15), (3, 5, 15), gamma=1.1)
    assert [(f.pitch, f.steps, f.gamma) for f in fringes] == [
        (912, 3, 1.1),
        (114, 5, 1.1),
        (15, 15, 1.1),
    ]
