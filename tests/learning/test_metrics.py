"""Metrics against errors made by hand, SciPy's filters, straight geometry and another bootstrap."""

import math

import numpy as np
import pytest
from scipy.ndimage import generic_filter

from fpputil.learning.metrics import Score, errors, spikes

TWO_PI = 2 * math.pi
PITCH = 24.0


def view(rad, **more):
    """Errors of one view, as `errors` gives them, with nothing wrong but what is given."""
    rad = np.asarray(rad, float)
    fine = np.zeros(len(rad), bool)
    found = {"rad": rad, "mm": rad, "insensitive": fine, "order": np.abs(rad) > math.pi}
    return found | {"spike": fine, "own_spike": fine} | more


def score_of(*views):
    score = Score()
    for model, values in views:
        score.add(model, values)
    return score


def values_of(score, **options):
    return {k: v[0] for k, v in score.summary(**options).items()}


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 1.0, 30.0])
@pytest.mark.parametrize("number", [1, 2, 4001, 4002])
def test_means_and_medians(scale, number):
    rng = np.random.default_rng(number)
    e = scale * rng.uniform(0.9, 1.1, number) * rng.choice([-1, 1], number)
    found = values_of(score_of((0, view(e, mm=3 * e))))
    for unit, factor in (("rad", 1), ("mm", 3)):
        size = factor * np.abs(e)
        assert found[f"mae_{unit}"] == pytest.approx(size.mean(), rel=1e-12)
        assert found[f"rmse_{unit}"] == pytest.approx(math.sqrt((size**2).mean()), rel=1e-12)
        off = 0.005 if number > 2 else 0.12  # the median of two is any number between them
        assert found[f"median_{unit}"] == pytest.approx(np.median(size), rel=off)


def test_a_median_lies_inside_its_class_of_errors():
    """A class is half a percent wide; among many errors the place in it is told, too."""
    for low, high in ((0.5, 0.9), (0.1, 0.1013), (2.0, 2.3)):
        e = np.linspace(low, high, 200_001)
        assert values_of(score_of((0, view(e))))["median_rad"] == pytest.approx(
            (low + high) / 2, rel=2e-5
        )


@pytest.mark.parametrize("e", [0.0, 1e-6, 1e-5, 0.02, 7.0, 999.0])
def test_a_median_of_equal_errors_is_that_error(e):
    found = values_of(score_of((0, view(np.full(7, e)))))
    assert found["median_rad"] == pytest.approx(e, rel=0.005, abs=1e-5)


def test_a_wild_error_leaves_the_median_alone():
    found = values_of(score_of((0, view([0.1] * 99 + [1e9]))))
    assert found["median_rad"] == pytest.approx(0.1, rel=0.005)
    assert found["mae_rad"] == pytest.approx((99 * 0.1 + 1e9) / 100)


def test_shares():
    """Of 8 pixels: 2 wrong orders, 3 spikes, 1 of the truth, 4 not sensitive; 1 of 4 no depth."""
    marks = np.arange(8)
    more = {"spike": marks < 3, "own_spike": marks < 1, "insensitive": marks < 4}
    more |= {"high": np.full(8, -0.2), "low": np.full(8, 0.3)}
    rad = [0, 3.1, -3.1, 3.2, -6.3, 0, 0, 0]
    found = values_of(score_of((0, view(rad, mm=np.array([1, -2, np.nan, 3.0]), **more))))
    assert found["order_errors"] == 2 / 8
    assert (found["spikes"], found["spikes_of_truth"]) == (3 / 8, 1 / 8)
    assert (found["insensitive"], found["no_depth"]) == (4 / 8, 1 / 4)
    assert (found["mae_mm"], found["rmse_mm"]) == (2, pytest.approx(math.sqrt(14 / 3)))
    assert found["mae_high"] == pytest.approx(0.2) and found["mae_low"] == pytest.approx(0.3)
    assert list(found)[-2:] == ["mae_high", "mae_low"]  # files of results have one order


def test_wrapped_phases_are_scored_where_there_are_such():
    assert "mae_low" not in values_of(score_of((0, view([1], high=np.ones(1)))))


def test_errors_are_pooled_over_pixels_not_over_models():
    rng = np.random.default_rng(0)
    a, b, c = rng.normal(size=100), 5 * rng.normal(size=7), rng.normal(size=31)
    found = values_of(score_of((4, view(a)), (9, view(b)), (4, view(c))))
    together = np.abs(np.concatenate([a, b, c]))
    assert found["mae_rad"] == pytest.approx(together.mean(), rel=1e-12)
    assert found["rmse_rad"] == pytest.approx(math.sqrt((together**2).mean()), rel=1e-12)
    assert found["order_errors"] == pytest.approx((together > math.pi).mean(), rel=1e-12)
    assert score_of((4, view(a)), (9, view(b)), (4, view(c))).models.keys() == {4, 9}


def models(number, seed=0):
    """Models of unequal difficulty and size."""
    rng = np.random.default_rng(seed)
    return [rng.exponential() * np.abs(rng.normal(size=rng.integers(50, 150)))
            for _ in range(number)]  # fmt: skip


def test_the_interval_is_that_of_another_bootstrap():
    """Whole models drawn anew, their pixels put in a row."""
    own = models(12)
    rng = np.random.default_rng(5)
    drawn = [np.concatenate([own[k] for k in rng.choice(12, 12)]) for _ in range(2000)]
    found = score_of(*((k, view(e)) for k, e in enumerate(own))).summary(draws=2000)
    for name, measure, near in (
        ("mae_rad", np.mean, 0.03),
        ("rmse_rad", lambda e: math.sqrt((e**2).mean()), 0.03),
        ("median_rad", np.median, 0.05),
    ):
        _, low, high = found[name]
        expected = np.percentile([measure(e) for e in drawn], (2.5, 97.5))
        assert (low, high) == pytest.approx(tuple(expected), abs=near * (high - low) * 2), name


def test_the_interval_shrinks_with_models_and_not_with_pixels():
    def width(own):
        _, low, high = score_of(*((k, view(e)) for k, e in enumerate(own))).summary()["mae_rad"]
        return high - low

    few = models(10)
    assert width([np.tile(e, 9) for e in few]) == pytest.approx(width(few), rel=1e-9)
    copies = few * 9
    assert width(copies) == pytest.approx(width(few) / 3, rel=0.15)


def test_one_model_has_no_interval():
    value, low, high = score_of((0, view([1, 2, 3.0]))).summary()["mae_rad"]
    assert value == low == high == 2


def test_the_seed_decides_the_draws():
    score = score_of(*((k, view(e)) for k, e in enumerate(models(9))))
    assert score.summary(3) == score.summary(3)
    a, b = score.summary(3)["mae_rad"], score.summary(4)["mae_rad"]
    assert a[0] == b[0] and a[1:] != b[1:]


@pytest.mark.parametrize("score", [Score(), score_of((0, view([])))])
def test_nothing_to_score(score):
    with pytest.raises(ValueError, match="no pixel to score"):
        score.summary()


def test_a_view_without_pixels_adds_nothing():
    score = score_of((0, view([1.0, 3.0])), (1, view([])))
    value, low, high = score.summary()["mae_rad"]
    assert value == low == high == 2  # draws of the empty model alone are left out


def test_without_a_depth_there_are_no_millimetres():
    """A geometry on which no column moves with depth: NaN, without a warning, never 0."""
    found = score_of((0, view([1.0, 2.0], mm=np.zeros(0)))).summary()
    for name in ("mae_mm", "rmse_mm", "median_mm", "no_depth"):
        assert np.isnan(found[name]).all(), name
    assert found["mae_rad"][0] == 1.5


@pytest.mark.parametrize("options, said", [({"draws": 0}, "draws 0"), ({"seed": -1}, "seed -1")])
def test_wrong_options_are_named(options, said):
    with pytest.raises(ValueError, match=said):
        score_of((0, view([1.0]))).summary(**options)


@pytest.mark.parametrize("seed", range(4))
def test_spikes_are_those_of_scipys_median(seed):
    rng = np.random.default_rng(seed)
    mask = rng.random((23, 31)) < (0.25, 0.6, 0.9, 1.0)[seed]
    Phi = (
        np.linspace(0, 40, 31)
        + rng.normal(size=mask.shape)
        + TWO_PI * (rng.random(mask.shape) < 0.1)
    )
    Phi = Phi.astype(np.float32)
    seen = np.where(mask, Phi, np.nan).astype(float)
    medians = generic_filter(
        seen, lambda w: np.nanmedian(w) if np.isfinite(w).any() else np.nan, 5,
        mode="constant", cval=np.nan,
    )  # fmt: skip
    off = np.abs(seen - medians)[mask]
    clear = np.abs(off - math.pi) > 1e-4
    found = spikes(np.where(mask, Phi, 1e6), mask)
    assert found.sum() > 5 and clear.mean() > 0.99
    np.testing.assert_array_equal(found[clear], (off > math.pi)[clear])


def test_a_smooth_phase_has_no_spikes_and_a_lonely_pixel_none():
    v, u = np.mgrid[:20, :20]
    mask = np.ones((20, 20), bool)
    assert not spikes(0.5 * u + 0.4 * v, mask).any()
    alone = np.zeros((20, 20), bool)
    alone[3, 3] = alone[0, 19] = True
    assert spikes(100.0 * u, alone).tolist() == [False, False]
    one = 0.1 * u
    one[5, 7] += 3.3
    assert np.argwhere(spikes(one, mask).reshape(20, 20)).tolist() == [[5, 7]]


def depth_by_hand(column, system):
    """z of the point of each camera ray whose projector column is given, from the two pinholes."""
    camera, projector = system.camera, system.projector
    v, u = np.mgrid[: camera.height, : camera.width]
    K, P = camera.K, projector.K
    d = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(u.shape)], -1)
    a = (d @ projector.R[0]) * P[0, 0] - (column - P[0, 2]) * (d @ projector.R[2])
    b = (column - P[0, 2]) * projector.t[2] - P[0, 0] * projector.t[0]
    z = b / a
    return np.where(z > 0, z, np.nan)


@pytest.fixture(scope="module")
def scene(tiny):
    """A wavy surface in the measuring range, seen everywhere but in one corner."""
    system = tiny.system
    v, u = np.mgrid[: system.camera.height, : system.camera.width]
    depth = 650 + 60 * np.sin(u / 15) * np.cos(v / 11)
    mask = (u + v) > 40
    Phi = TWO_PI * system.columns_at(depth) / PITCH
    truth = {"mask": mask, "Phi": Phi, "phi_r": Phi * PITCH / 304, "depth": depth}
    return system, {k: np.where(mask, v, np.zeros_like(v)) for k, v in truth.items()}


def test_millimetres_count_where_a_column_moves(scene):
    system, truth = scene
    mask, depth = truth["mask"], truth["depth"]
    step = np.random.default_rng(0).normal(0, 0.3, mask.shape)
    Phi = truth["Phi"] + np.where(mask, step, 0)
    found = errors(Phi, None, None, truth, system, PITCH)
    moved = system.columns_at(depth + 0.5) - system.columns_at(depth - 0.5)
    sensitive = mask & (np.abs(moved) > 0.1)
    assert 0.1 < sensitive.sum() / mask.sum() < 0.9
    expected = depth_by_hand(Phi * PITCH / TWO_PI, system) - depth
    np.testing.assert_allclose(found["mm"], expected[sensitive], rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(found["insensitive"], ~sensitive[mask])
    np.testing.assert_allclose(found["rad"], step[mask], atol=1e-12)
    assert np.abs(found["mm"]).max() > 1


def test_rays_that_meet_no_plane_have_no_depth(scene):
    system, truth = scene
    Phi = truth["Phi"] + np.where(truth["mask"], 60.0, 0)
    found = errors(Phi, None, None, truth, system, PITCH)
    mm = depth_by_hand(Phi * PITCH / TWO_PI, system)[truth["mask"]][~found["insensitive"]]
    assert np.isnan(mm).any()
    np.testing.assert_array_equal(np.isnan(found["mm"]), np.isnan(mm))
    share = values_of(score_of((0, found)))["no_depth"]
    assert share == pytest.approx(np.isnan(mm).mean(), rel=1e-12)


def test_errors_of_phases(scene):
    """Orders count on the absolute phase; wrapped phases are compared modulo 2 pi."""
    system, truth = scene
    mask = truth["mask"]
    off = np.where(np.arange(mask.size).reshape(mask.shape) % 3 == 0, TWO_PI, 0.0)
    found = errors(
        truth["Phi"] + off + 0.1,
        truth["Phi"] - 7 * TWO_PI - 0.2,
        truth["phi_r"] + 2 * TWO_PI + 0.3,
        truth, system, PITCH,
    )  # fmt: skip
    np.testing.assert_array_equal(found["order"], (off > 0)[mask])
    np.testing.assert_allclose(found["high"], -0.2, atol=1e-9)
    np.testing.assert_allclose(found["low"], 0.3, atol=1e-9)
    assert not found["own_spike"].any()
    assert found.keys() == errors(truth["Phi"], truth["Phi"], None, truth, system, PITCH).keys() | {
        "low"
    }


def test_what_lies_outside_the_mask_does_not_count(scene):
    system, truth = scene
    Phi = np.where(truth["mask"], truth["Phi"] + 0.1, np.nan)
    wild = np.where(truth["mask"], truth["Phi"] + 0.1, 1e9)
    a, b = (errors(x, x, x, truth, system, PITCH) for x in (Phi, wild))
    for name in a:
        np.testing.assert_array_equal(a[name], b[name])
        assert len(a[name]) in (truth["mask"].sum(), len(a["mm"]))


def test_a_pixel_without_a_phase_has_a_wrong_order(scene):
    system, truth = scene
    mask = truth["mask"]
    lost = np.arange(mask.size).reshape(mask.shape) % 4 == 0
    found = errors(np.where(lost, np.nan, truth["Phi"]), None, None, truth, system, PITCH)
    np.testing.assert_array_equal(found["order"], lost[mask])
    assert found["spike"][lost[mask]].all()
