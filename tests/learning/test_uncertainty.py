"""What two phases that should agree tell of the error of each pixel."""

import math

import numpy as np
import pytest

from fpputil.decoding.unwrap import wrap
from fpputil.learning import Uncertainty, assess_uncertainty, calibrate_uncertainty, doubt
from fpputil.learning.evaluation import evaluate, open_split
from fpputil.learning.uncertainty import KEPT, Disagreements, doubt_of, keep, uncertainty_of
from fpputil.learning.weights import Trained, load_weights, save_weights, write_metrics
from fpputil.networks import SFNetMethod, SIDOMethod

RATIO = 304 / 24
TWO_PI = 2 * math.pi
METHOD = SFNetMethod(base=2, levels=2)


def test_phases_that_agree_leave_no_doubt_whatever_the_order():
    Phi = np.random.default_rng(0).uniform(0, 240, (20, 30))
    mask = np.ones(Phi.shape, bool)
    assert doubt(Phi, wrap(Phi / RATIO), mask, RATIO).max() < 1e-4
    assert doubt(Phi, wrap(Phi / RATIO) + TWO_PI, mask, RATIO).max() < 1e-4


def test_one_doubtful_pixel_is_seen_around_and_not_beyond():
    Phi, mask = np.full((40, 40), 100.0), np.ones((40, 40), bool)
    phi_r = np.array(wrap(Phi / RATIO))
    phi_r[20, 20] += 0.3 * TWO_PI / RATIO
    found = doubt(Phi, phi_r, mask, RATIO)
    expected = [0.3 * math.sqrt(share / 3) for share in (1 + 1 / 25 + 1 / 121, 1 / 25 + 1 / 121)]
    assert found[20, 20] == pytest.approx(expected[0], rel=1e-3)
    assert found[20, 22] == pytest.approx(expected[1], rel=1e-3)
    assert found[20, 25] == pytest.approx(0.3 * math.sqrt(1 / 121 / 3), rel=1e-3)
    assert found[20, 26] < 1e-4


def test_what_lies_outside_the_mask_does_not_count():
    rng = np.random.default_rng(1)
    Phi, phi_r = rng.uniform(0, 200, (16, 16)), rng.uniform(-3, 3, (16, 16))
    mask = rng.random((16, 16)) < 0.5
    found = doubt(Phi, phi_r, mask, RATIO)[mask]
    for name in (np.nan, 1e6):
        other = np.where(mask, phi_r, name)
        np.testing.assert_allclose(doubt(Phi, other, mask, RATIO)[mask], found, rtol=1e-4)


def test_as_many_errors_are_as_small_as_told_as_are_told():
    """Errors that grow with the score, one in twenty a whole order where it is high."""
    rng = np.random.default_rng(2)

    def drawn(number):
        score = rng.uniform(0, 0.5, number)
        error = np.abs(rng.normal(0, 0.01 + score))
        return score, error + TWO_PI * (rng.random(number) < 0.1 * score)

    told = Uncertainty.of(*drawn(60_000))
    score, error = drawn(60_000)
    for share, end in zip((0.68, 0.95), told(score), strict=True):
        assert (error <= end).mean() == pytest.approx(share, abs=0.01)
        for half in (score < 0.25, score >= 0.25):
            assert (error <= end)[half].mean() == pytest.approx(share, abs=0.02)
    assert all(np.diff(end).min() >= 0 for end in (told.error_68, told.error_95))


@pytest.fixture(scope="module")
def trained(small_set, tmp_path_factory):
    from fpputil.learning import TrainingConfig, fit

    out = tmp_path_factory.mktemp("run")
    settings = TrainingConfig(epochs=1, validation_views=2, precision="float32")
    fit(METHOD, small_set, settings, out)
    return load_weights(out / "weights.safetensors")


def test_a_network_is_calibrated_on_one_split_and_judged_on_another(small_set, trained, tmp_path):
    told = calibrate_uncertainty(trained, open_split(trained, small_set, "validation"))
    views = open_split(trained, small_set, "test")
    seen = Disagreements(trained)
    evaluate(trained, views, seen.add)
    found = assess_uncertainty(told, *seen.together)
    pixels = sum(int(views[k]["mask"].sum()) for k in range(len(views)))
    assert found["pixels"] == pixels and found["kept"] == KEPT
    assert 0 < found["coverage_68"] < found["coverage_95"] <= 1
    assert found["mae"][0] == pytest.approx(found["mae_best"][0]) and found["mae"][0] > 0
    assert all(a >= b for a, b in zip(found["mae"], found["mae_best"], strict=True))
    doubts, errors = seen.together
    for share, mae, best in zip(KEPT, found["mae"], found["mae_best"], strict=True):
        number = round(share * pixels)
        sure = np.argsort(doubts, kind="stable")[:number]
        assert mae == pytest.approx(errors[sure].mean())
        assert best == pytest.approx(np.sort(errors)[:number].mean())
    assert found["mae_best"] == sorted(found["mae_best"], reverse=True)
    path = tmp_path / "mine.safetensors"
    save_weights(path, trained)
    saved = load_weights(path)
    assert uncertainty_of(path) is None
    keep(path, saved, told)
    write_metrics(path, saved, "test", {"mae_rad": [1.0, 0.5, 2.0]})  # which keeps it
    assert uncertainty_of(path) == told


def test_one_phase_alone_tells_nothing(trained):
    other = Trained(SIDOMethod(base=2, levels=2), None, trained.metadata)
    with pytest.raises(ValueError, match="a method of one wrapped phase given; two are needed"):
        doubt_of(other, None, np.ones((120, 160), bool))
