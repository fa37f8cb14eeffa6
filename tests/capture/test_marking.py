"""What the compiled passes mark, against the same criteria written out with the equations."""

import numpy as np
import pytest

from fpputil.capture import marking
from fpputil.capture.marking import Reason
from fpputil.capture.stream import Sums
from fpputil.optics.fringes import Fringe

THRESHOLD, NOISE, SHAPE = 8.0, np.float32([2.0, 0.05, 0.1]), (40, 50)


def sums_of(steps):
    """Sums of photographs of which many are dark, scattered or saturated."""
    rng = np.random.default_rng(steps)
    phi, B = rng.uniform(-3, 3, SHAPE), rng.uniform(0, 40, SHAPE)
    A = rng.uniform(60, 240, SHAPE)
    delta = 2 * np.pi * np.arange(steps)[:, None, None] / steps
    light = A + B * np.cos(phi + delta)
    light += rng.uniform(0, 15, SHAPE) * rng.standard_normal(light.shape)
    sums = Sums.empty(Fringe(20, steps), SHAPE)
    sums.add(np.clip(np.rint(light), 0, 255).astype(np.uint8), range(steps))
    return sums


@pytest.mark.parametrize("steps", [3, 4, 12])
def test_look_marks_by_modulation_saturation_and_scatter(steps):
    sums = sums_of(steps)
    reason, sigma = np.zeros(SHAPE, np.uint8), np.empty(SHAPE, np.float32)
    reason[:4] = Reason.UNSURE
    marking.look(sums.values, sums.clipped, steps, NOISE, THRESHOLD, reason, sigma)
    B = sums.modulation
    variance = np.maximum(NOISE[0] + NOISE[1] * sums.average, NOISE[2])
    with np.errstate(divide="ignore"):  # a pixel that is white in all photographs
        np.testing.assert_allclose(sigma, np.sqrt(2 / steps * variance) / B, rtol=1e-4)
    scatter = np.sqrt(np.nan_to_num(sums.scatter))  # of three steps there is none
    expected = np.select(
        [B <= THRESHOLD, sums.clipped > marking.CLIPPED * steps,
         scatter > marking.SCATTER * B + 3 * np.sqrt(variance)],
        [Reason.DARK, Reason.SATURATED, Reason.SCATTERED], Reason.GOOD,
    )  # fmt: skip
    expected[:4] = Reason.UNSURE  # what is marked stays
    wanted = {Reason.GOOD, Reason.DARK, Reason.SATURATED, Reason.UNSURE}
    assert set(reason.ravel()) == wanted | ({Reason.SCATTERED} if steps > 3 else set())
    assert (reason != expected).mean() < 1e-3  # by rounding, at a limit


def test_changes_of_the_modulation_are_marked_beyond_their_noise():
    rng = np.random.default_rng(0)
    B, other, sigma = (rng.uniform(0.5, 1.5, SHAPE).astype(np.float32) for _ in range(3))
    sigma *= 0.05
    reason = rng.choice([0, int(Reason.DARK)], SHAPE).astype(np.uint8)
    was = reason.copy()
    change, good = marking.compared(B, other, reason)
    np.testing.assert_array_equal(good, was == 0)
    np.testing.assert_allclose(change, np.where(was == 0, np.log(B / other), 0), atol=1e-6)
    near, share = np.full_like(B, 0.02), np.full_like(B, 0.5)
    marking.mark_unsteady(change, near, share, sigma, sigma, reason)
    off = np.abs(np.log(B / other) - 0.04) > marking.UNSTEADY + 4 * np.sqrt(2) * sigma
    np.testing.assert_array_equal(reason == Reason.UNSTEADY, (was == 0) & off)
    assert 0 < (reason == Reason.UNSTEADY).sum() < (was == 0).sum()
