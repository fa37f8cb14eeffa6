"""The trials beside the book: what they photograph is what they say they photograph."""

import numpy as np

from benchmarks.real_light import photograph, scene, smooth


def test_drawn_photographs_show_the_phase_that_goes_with_them():
    one = scene(3)
    assert one.column.shape == one.shade.shape == (480, 640)
    for seed in range(4):
        image, phi, seen = photograph(one, np.random.default_rng(seed))
        assert image.dtype == np.float32 and image.min() >= 0 and image.max() <= 1
        assert 0.1 < seen.mean() <= (one.shade > 0).mean()
        bright = image[seen] - image[seen].mean()
        along, across = (np.mean(bright * turn(phi[seen])) for turn in (np.cos, np.sin))
        assert along > 5 * abs(across)  # a crest where the phase is a whole turn


def test_a_carrier_is_the_polynomial_below_the_body():
    v, u = np.indices((40, 60)) / 60
    Phi = 3 + 40 * u + 2 * v - 5 * u**2 + u * v
    mask = (v > 0.1) & (u < 0.9)
    np.testing.assert_allclose(smooth(Phi, mask), Phi, atol=1e-9)
