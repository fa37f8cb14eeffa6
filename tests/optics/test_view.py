"""Photographs against Eq. 1 and the options of a camera."""

import numpy as np
import pytest

from fpputil.optics.fringes import Fringe, fringe_set
from fpputil.optics.view import View


def flat(column=300.0, shade=0.5, shape=(40, 50), lit=True):
    full = np.full(shape, 1, np.float32)
    return View(full * column, full * 17, full * shade, full * 600, np.full(shape, lit))


@pytest.mark.parametrize("axis", ["column", "row"])
def test_a_frame_is_shade_times_pattern(axis):
    rng = np.random.default_rng(0)
    column, row = rng.uniform(0, 911, (2, 40, 50)).astype(np.float32)
    shade = rng.uniform(0.1, 1, (40, 50)).astype(np.float32)
    view = View(column, row, shade, shade, np.ones((40, 50), bool))
    fringe = Fringe(15, 7, axis=axis)
    frames = view.frames(fringe, quantise=False)
    coordinate = column if axis == "column" else row
    for n in range(7):
        np.testing.assert_allclose(frames[n], shade * fringe.intensity(coordinate, n), atol=1e-9)


def test_uint8_frames_round_float_frames(sphere_view):
    fringes = fringe_set((912, 114, 24), (3, 5, 7))
    exact = sphere_view.frames(fringes, quantise=False)
    frames = sphere_view.frames(fringes)
    assert frames.dtype == np.uint8 and exact.dtype == np.float64 and len(frames) == 15
    assert np.abs(frames - exact).max() < 0.501
    assert (frames[:, ~sphere_view.mask] == 0).all()


def test_slow_path_agrees_with_the_fast_one(sphere_view):
    """A gamma that is one but for 1e-12 takes the general path."""
    fast = sphere_view.frames(Fringe(24), quantise=False)
    slow = sphere_view.frames(Fringe(24, gamma=1 + 1e-12), quantise=False)
    np.testing.assert_allclose(fast, slow, atol=1e-6)


def test_noise_has_its_sigma_and_seed():
    view, fringe = flat(shape=(200, 200)), Fringe(912, 9)
    clean = view.frames(fringe, quantise=False)
    a, b = (view.frames(fringe, 2.0, seed, quantise=False) for seed in (5, 5))
    c = view.frames(fringe, 2.0, 6, quantise=False)
    np.testing.assert_array_equal(a, b)
    assert np.abs(a - c).max() > 1
    assert np.std(a - clean) == pytest.approx(2.0, rel=0.01)
    assert np.corrcoef((a - clean)[0].ravel(), (a - clean)[1].ravel())[0, 1] < 0.02


@pytest.mark.parametrize(
    "option, expected",
    [
        ({}, 127.5),
        ({"gain": 1.5}, 191.25),
        ({"ambient": 10}, 137.5),
        ({"gamma": 2.0}, 255 * 0.25),
        ({"saturation": 100.0}, 100.0),
        ({"gain": 4.0}, 510.0),
        ({"gain": 4.0, "ambient": 10}, 520.0),
    ],
)
def test_camera_options(option, expected):
    white = flat(column=0.0).frames(Fringe(912, 4), quantise=False, **option)[0]
    np.testing.assert_allclose(white, expected, rtol=1e-6)


@pytest.mark.parametrize("gamma", [0.45, 2.2])
@pytest.mark.parametrize("steps", [4, 15])
def test_black_stays_black_under_a_camera_response(paper_sphere_view, gamma, steps):
    """float32 leaves black a hair below zero, and a power of that is not a number."""
    view, fringe = paper_sphere_view, Fringe(15, steps)
    frames = view.frames(fringe, gamma=gamma)
    exact = view.frames(fringe, gamma=gamma, quantise=False)
    assert np.abs(frames - exact).max() < (0.6 if gamma > 1 else 1.6)


def test_uint8_saturates_at_255():
    assert (flat(column=0.0).frames(Fringe(912, 4), gain=4)[0] == 255).all()


def test_plain_light(sphere_view):
    np.testing.assert_allclose(
        sphere_view.plain(quantise=False), 255.0 * sphere_view.shade, atol=1e-6
    )


def test_any_light(sphere_view):
    """An image in the projector, no light at all, and a number for all pixels."""
    assert (sphere_view.dark(ambient=7, gain=3) == 7).all()
    image = np.random.default_rng(0).integers(0, 256, (1140, 912)).astype(float)
    u, v = (np.nan_to_num(np.rint(a)).astype(int) for a in (sphere_view.column, sphere_view.row))
    sent = image[v.clip(0, 1139), u.clip(0, 911)]
    frame = sphere_view.photograph(sent, quantise=False)
    np.testing.assert_allclose(frame, [sent * sphere_view.shade], atol=1e-9)
