"""The one-pass kernel against the equations it stands for."""

import numpy as np
import pytest

from fpputil.decoding import unwrap
from fpputil.decoding.decoder import decode
from fpputil.optics.fringes import fringe_set

SETS = {
    "three": ((912, 114, 15), 15),
    "two": ((912, 24), (3, 7)),
    "even": ((912, 24), (4, 8)),
    "four": ((912, 304, 114, 24), 5),
}


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.int32])
@pytest.mark.parametrize("name", SETS)
def test_kernel_equals_equations(sphere_view, dtype, name):
    fringes = fringe_set(*SETS[name])
    frames = sphere_view.frames(fringes, 1.0, 3)
    fast = decode(frames.astype(dtype), fringes, 912)
    slow = decode(frames.astype(np.float64), fringes, 912)
    assert fast.Phi.dtype == fast.wrapped.dtype == np.float32 and slow.Phi.dtype == np.float64
    assert (fast.mask != slow.mask).sum() <= 1
    both = fast.mask & slow.mask
    assert np.abs(unwrap.wrap(fast.wrapped - slow.wrapped))[:, both].max() < 2e-6
    np.testing.assert_allclose(fast.modulation, slow.modulation, atol=1e-4)
    agree = np.abs(fast.Phi - slow.Phi)[both] < 1e-4
    assert agree.mean() > 0.9999  # a tie of the rounding may fall either way


@pytest.mark.parametrize("kind", [">u2", ">f8", "F", "strided", "list"])
def test_any_layout_of_frames(sphere_view, kind):
    fringes = fringe_set((912, 114, 24), 5)
    frames = sphere_view.frames(fringes)
    same = {
        "F": lambda: np.asfortranarray(frames),
        "strided": lambda: np.repeat(frames, 2, axis=2)[:, :, ::2][:, ::-1][:, ::-1],
        "list": lambda: list(frames),
    }.get(kind, lambda: frames.astype(kind))()
    expected = decode(frames, fringes, 912)
    got = decode(same, fringes, 912)
    np.testing.assert_allclose(got.Phi, expected.Phi, atol=1e-4)
    assert got.Phi.dtype == (np.float64 if kind == ">f8" else np.float32)


def test_an_earlier_result_is_filled_anew(sphere_view):
    fringes = fringe_set((912, 114, 24), 5)
    first, second = (sphere_view.frames(fringes, 1.0, seed) for seed in (0, 1))
    result = decode(first, fringes, 912)
    again = decode(second, fringes, 912, out=result)
    assert again is result
    for name in ("wrapped", "modulation", "Phi", "mask"):
        np.testing.assert_array_equal(
            getattr(again, name), getattr(decode(second, fringes, 912), name)
        )
    with pytest.raises(ValueError, match="out of shape"):
        decode(second[:, ::2], fringes, 912, out=result)
    with pytest.raises(ValueError, match="out with float64"):
        decode(second.astype(float), fringes, 912, out=result)


@pytest.mark.parametrize("dtype, atol", [(np.float32, 2e-4), (np.float64, 1e-9)])
@pytest.mark.parametrize("shape", [(1, 1), (3, 683), (2, 1024), (1, 2049), (64, 65)])
def test_every_block_size(shape, dtype, atol):
    fringes = fringe_set((912, 114, 15), 4)
    column = np.linspace(0, 911, shape[0] * shape[1]).reshape(shape)
    frames = np.concatenate([[f.intensity(column, n) for n in range(4)] for f in fringes])
    Phi = decode(frames.astype(dtype), fringes, 912).Phi
    np.testing.assert_allclose(Phi, 2 * np.pi * column / 15, atol=atol)


def test_atan2_of_the_kernel_all_round():
    phi = np.linspace(-np.pi, np.pi, 20_001)[None]
    delta = 2 * np.pi * np.arange(3) / 3
    frames = (100 + 100 * np.cos(phi + delta[:, None, None])).astype(np.float32)
    got = decode(frames, fringe_set((912,), 3), 912).wrapped[0]
    assert np.abs(unwrap.wrap(got - phi)).max() < 2e-6


def test_outside_the_mask_is_nan(sphere_view):
    fringes = fringe_set((912, 114, 15), 15)
    d = decode(sphere_view.frames(fringes), fringes, 912)
    assert np.isnan(d.Phi[~d.mask]).all() and np.isnan(d.wrapped[:, ~d.mask]).all()
    assert np.isfinite(d.Phi[d.mask]).all() and np.isfinite(d.modulation).all()
    np.testing.assert_array_equal(d.mask, d.modulation[-1] > 8)


@pytest.mark.parametrize("dtype", [np.uint8, np.float64])
def test_the_threshold_itself_is_outside_the_mask(sphere_view, dtype):
    fringes = fringe_set((912, 24), 4)
    frames = sphere_view.frames(fringes).astype(dtype)
    modulation = decode(frames, fringes, 912).modulation[-1]
    threshold = modulation[60, 80]
    mask = decode(frames, fringes, 912, threshold).mask
    np.testing.assert_array_equal(mask, modulation > threshold)


def test_horizontal_fringes(sphere_view):
    fringes = fringe_set((1140, 114, 15), 5, axis="row")
    d = decode(sphere_view.frames(fringes), fringes, 1140)
    error = (d.Phi - fringes[-1].phase(sphere_view.row))[d.mask & sphere_view.mask]
    assert np.sqrt(np.mean(error**2)) < 0.02


@pytest.mark.slow
def test_memory_stays_within_outputs_and_64_mib():
    """Peak resident set of a fresh process, above its warmed state."""
    import subprocess
    import sys

    program = """
import resource, numpy as np
from fpputil.decoding.decoder import decode
from fpputil.optics.fringes import Fringe, fringe_set
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
fringes = fringe_set((912, 114, 15), 15)
rng = np.random.default_rng(0)
frames = rng.integers(0, 255, (45, 1200, 1920), dtype=np.uint8)
decode(frames[:, :64].copy(), fringes, 912)
before = peak()
d = decode(frames, fringes, 912)
outputs = sum(a.nbytes for a in (d.wrapped, d.modulation, d.Phi, d.mask))
print(peak() - before - outputs)
"""
    if sys.platform != "linux":
        pytest.skip("ru_maxrss is in kilobytes on Linux alone")
    extra = int(subprocess.check_output([sys.executable, "-c", program]))
    assert extra < 64 * 2**20


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_guard_takes_the_borders_out_of_the_mask(dtype):
    """At sigma_phi = 0.02, with both borders in view: order errors without, none with."""
    rng = np.random.default_rng(0)
    fringes = fringe_set((912, 114, 15), 15)
    column = np.broadcast_to(np.linspace(-0.5, 911.5, 2000), (50, 2000))
    frames = np.concatenate([[f.intensity(column, n) for n in range(15)] for f in fringes])
    frames = frames + rng.normal(0, 0.02 * 127.5 / np.sqrt(2 / 15), frames.shape)

    def wrong(decoded):
        return np.abs(decoded.Phi - fringes[-1].phase(column))[decoded.mask] > np.pi

    free = decode(frames.astype(dtype), fringes, 912)
    guarded = decode(frames.astype(dtype), fringes, 912, sigma_phi=0.02)
    assert wrong(free).any() and not wrong(guarded).any()
    guard = unwrap.guard_columns(0.02, 912)
    assert guarded.mask.mean() == pytest.approx(1 - 2 * guard / 912, abs=1e-3)
    assert column[guarded.mask].mean() == pytest.approx(455.5, abs=0.05)  # as much at either border
    assert np.isnan(guarded.Phi[~guarded.mask]).all()
    assert np.isnan(guarded.wrapped[:, ~guarded.mask]).all()


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_fringes_may_begin_as_a_sine(dtype):
    column = np.linspace(1, 910, 500)[None]
    fringes = fringe_set((912, 114, 15), 4, start=-np.pi / 2)
    frames = np.stack([f.intensity(column, n) for f in fringes for n in range(4)]).astype(dtype)
    assert abs(frames[0, 0, 0] - 127.5 * (1 + np.sin(2 * np.pi / 912))) < 1e-4
    decoded = decode(frames, fringes, 912)
    np.testing.assert_allclose(decoded.Phi * 15 / (2 * np.pi), column, atol=1e-3)
    np.testing.assert_allclose(
        np.exp(1j * decoded.wrapped[2]), np.exp(2j * np.pi * column / 15), atol=1e-4
    )
