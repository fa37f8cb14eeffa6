"""The course of a training: when its rate falls, when it ends, and which epoch is kept."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from fpputil.dataset.augmentation import Augmentation
from fpputil.learning.checkpoint import read_state
from fpputil.learning.config import TrainingConfig
from fpputil.learning.log import read_log
from fpputil.learning.training import CHECKPOINT, WEIGHTS, fit
from fpputil.networks.methods import SFNetMethod

pytestmark = pytest.mark.usefixtures("small_and_quick")
METHOD = SFNetMethod(base=2, levels=2)
QUICK = TrainingConfig(
    epochs=20,
    training_views=3,
    validation_views=1,
    batch=3,
    learning_rate=3e-3,
    precision="float32",
    augmentation=Augmentation(gain=(0.8, 1.2), noise=(0.0, 1.0)),
)  # one batch an epoch


def measured_as(monkeypatch, maes):
    """Let validation find these MAEs, epoch by epoch."""
    values = iter(maes)

    def validate(*_):
        names = ("validation_mae", "validation_rmse", "validation_order_errors")
        return dict.fromkeys(names, next(values))

    monkeypatch.setattr("fpputil.learning.training.validate", validate)


@pytest.mark.parametrize(
    "patience, maes, epochs",
    [(2, [5, 4, 4, 4, 3], 4), (3, [5, 6, 6, 4, 5, 6, 7, 0], 7), (0, [1] + [2] * 7, 8)],
)
def test_patience_ends(small_set, monkeypatch, patience, maes, epochs):
    """After so many epochs without a better one; never at 0."""
    measured_as(monkeypatch, maes)
    settings = replace(QUICK, early_stopping=patience, epochs=len(maes))
    _, history = fit(METHOD, small_set, settings)
    assert [row["validation_mae"] for row in history] == maes[:epochs]


def test_patience_goes_on_after_a_stop(interrupt, small_set, monkeypatch, tmp_path):
    settings = replace(QUICK, early_stopping=3)
    measured_as(monkeypatch, [5, 6])
    with monkeypatch.context() as patched:
        interrupt(patched, 3)
        with pytest.raises(KeyboardInterrupt):
            fit(METHOD, small_set, settings, tmp_path)
    measured_as(monkeypatch, [7, 8, 0])
    _, history = fit(METHOD, small_set, settings, tmp_path, resume=True)
    assert [row["validation_mae"] for row in history] == [5, 6, 7, 8]


def test_a_plateau_halves_the_rate(small_set, monkeypatch):
    """After so many epochs without a better one; a better one starts the count anew."""
    measured_as(monkeypatch, [9, 9, 8, 8, 8, 8, 8, 7.9999, 8])
    settings = replace(QUICK, plateau_patience=2, early_stopping=0, learning_rate=1e-3, epochs=9)
    _, history = fit(METHOD, small_set, settings)
    rates = [1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 5e-4, 5e-4, 2.5e-4, 2.5e-4]
    assert [row["learning_rate"] for row in history] == rates


def test_one_cycle_rises_to_the_rate_and_falls_to_nothing(small_set):
    settings = replace(
        QUICK, schedule="one-cycle", epochs=12, training_views=4, batch=2, learning_rate=1e-2
    )
    _, history = fit(METHOD, small_set, settings)
    rates = [row["learning_rate"] for row in history]
    k = np.arange(2, 24, 2)  # two steps an epoch; 24 in all, the rise in the first 15 %
    up, all_steps = 0.15 * 24 - 1, 23
    t = np.where(k < up, k / up, (k - up) / (all_steps - up))
    low, high = np.where(k < up, 1e-2 / 25, 1e-2), np.where(k < up, 1e-2, 1e-2 / 25e4)
    expected = high + (low - high) * (1 + np.cos(np.pi * t)) / 2
    np.testing.assert_allclose(rates[:-1], expected, rtol=1e-6)
    assert rates[-1] < 1e-4


def test_gradients_are_clipped_and_weights_decay(small_set):
    """Gradients clipped to nothing leave the decay of AdamW alone: 1 - rate decay a step."""
    settings = replace(
        QUICK,
        epochs=1,
        training_views=6,
        batch=3,
        learning_rate=1e-2,
        weight_decay=0.5,
        max_grad_norm=1e-14,
    )
    trained, _ = fit(METHOD, small_set, settings)
    with torch.random.fork_rng():
        torch.manual_seed(settings.seed)
        first = METHOD.network().state_dict()
    for name, tensor in trained.network.state_dict().items():
        expected = first[name] * (1 - 1e-2 * 0.5) ** 2
        torch.testing.assert_close(tensor, expected, rtol=1e-5, atol=1e-6)


def test_the_best_epoch_is_kept(small_set, monkeypatch, tmp_path):
    measured_as(monkeypatch, [3, 1, 2])
    fit(METHOD, small_set, replace(QUICK, epochs=3), tmp_path)
    measured_as(monkeypatch, [3, 1])
    best, _ = fit(METHOD, small_set, replace(QUICK, epochs=2))
    kept = load_file(tmp_path / WEIGHTS)
    for name, tensor in best.network.state_dict().items():
        assert torch.equal(tensor.half(), kept[name])


def test_a_network_that_answers_nan_is_not_kept(small_set, monkeypatch, tmp_path):
    measured_as(monkeypatch, [3, math.nan])
    with pytest.raises(FloatingPointError, match="answers with nan after epoch 2"):
        fit(METHOD, small_set, replace(QUICK, epochs=3), tmp_path)
    assert len(read_state(tmp_path / CHECKPOINT)["history"]) == 1


@pytest.mark.parametrize("fails", ["save_weights", "write_log"])
def test_a_file_that_cannot_be_written_costs_no_epoch(small_set, monkeypatch, tmp_path, fails):
    """Weights and log follow from the checkpoint, which is written first."""
    undisturbed, stopped = tmp_path / "a", tmp_path / "b"
    fit(METHOD, small_set, replace(QUICK, epochs=1), undisturbed)

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(f"fpputil.learning.training.{fails}", full)
        with pytest.raises(OSError, match="No space left"):
            fit(METHOD, small_set, replace(QUICK, epochs=1), stopped)
    before = (stopped / CHECKPOINT).read_bytes()
    _, history = fit(METHOD, small_set, replace(QUICK, epochs=1), stopped, resume=True)
    assert (stopped / CHECKPOINT).read_bytes() == before
    assert read_log(stopped / "log.csv") == history and len(history) == 1
    assert (stopped / WEIGHTS).read_bytes() == (undisturbed / WEIGHTS).read_bytes()
