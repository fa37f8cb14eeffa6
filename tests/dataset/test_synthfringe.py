"""Items of the torch dataset against the geometry and the equations."""

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from fpputil.dataset.augmentation import Augmentation
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.decoding.decoder import decode
from fpputil.decoding.geometric_constraint import minimum_phase, two_phase_absolute
from fpputil.optics.fringes import Fringe, fringe_set
from fpputil.optics.system import FREQUENCIES

TYPES = {"mask": torch.bool, "index": torch.int64, "model": torch.int64}


@pytest.fixture(scope="module")
def training(small_set):
    return SynthFringe(small_set, "training")


def test_shapes_and_types_and_no_nan(training):
    assert len(training) == 16
    for item in training:
        for name, value in item.items():
            assert value.dtype == TYPES.get(name, torch.float32), name
            assert value.shape[-2:] == (120, 160) or value.ndim == 0, name
            assert torch.isfinite(value.float()).all(), name
        assert item["frames"].shape[0] == 2 and item["M"].shape[0] == item["D"].shape[0] == 4
        outside = ~item["mask"]
        for name in ("M", "D", "M_r", "D_r", "phi_r", "Phi", "Phi_true", "depth", "modulation"):
            assert (item[name][..., outside] == 0).all(), name


def test_targets_are_the_phases_of_the_geometry(training):
    """8-bit frames of 15 steps leave millirads where there is light; M and D are of unit length."""
    for number in range(0, len(training), 3):
        item = training[number]
        bright = item["mask"] & (item["modulation"] > 20)
        column = item["Phi_true"] * training.pitches.high / (2 * np.pi)
        error = (item["Phi"] - item["Phi_true"])[bright]
        assert error.abs().max() < 0.02 and error.square().mean().sqrt() < 4e-3
        np.testing.assert_allclose((item["M"] ** 2 + item["D"] ** 2)[:, bright], 1, atol=1e-5)
        for k, name in enumerate(FREQUENCIES):
            phi = 2 * np.pi * column / getattr(training.pitches, name)
            np.testing.assert_allclose(item["M"][k][bright], -phi[bright].sin(), atol=0.02)
            np.testing.assert_allclose(item["D"][k][bright], phi[bright].cos(), atol=0.02)


def test_absolute_phase_is_the_decoders(training):
    item, view = training[0], training.store.view(int(training.indices[0]))
    p = training.pitches
    fringes = fringe_set((p.unit, p.mid, p.high))
    decoded = decode(view.frames(fringes), fringes, 912)
    mask = item["mask"].numpy()
    np.testing.assert_array_equal(mask, decoded.mask & view.mask)
    np.testing.assert_allclose(item["Phi"].numpy()[mask], decoded.Phi[mask], atol=2e-4)
    np.testing.assert_allclose(
        item["modulation"].numpy()[mask], decoded.modulation[-1][mask], atol=1e-3
    )


def test_the_refined_reference_unwraps_the_high_phase(training):
    """Targets alone, as a network would give them, lead back to the absolute phase."""
    p = training.pitches
    Phi_min = minimum_phase(training.store.system, p.zmin)
    for number in range(len(training)):
        item = training[number]
        mask = item["mask"]
        phi_h = -torch.atan2(item["M"][0], item["D"][0])
        phi_r = -torch.atan2(item["M_r"], item["D_r"])
        Phi = two_phase_absolute(
            phi_h.double().numpy(), phi_r.double().numpy(), Phi_min, p.high, p.zmin
        )
        np.testing.assert_allclose(Phi[mask], item["Phi"][mask], atol=2e-3)
        np.testing.assert_allclose(
            np.exp(1j * item["phi_r"][mask].numpy()), np.exp(1j * phi_r[mask].numpy()), atol=1e-4
        )


def test_photographs_are_normalised_by_the_training_extremes(small_set):
    for split in ("training", "test", "held-out"):
        data = SynthFringe(
            small_set, split, frames=(("high", 15, 0), ("zmin", 4, 2), ("mid", 3, 1))
        )
        low, high = data.extremes
        view = data.store.view(int(data.indices[0]))
        expected = [
            Fringe(getattr(data.pitches, f), n) for f, n in (("high", 15), ("zmin", 4), ("mid", 3))
        ]
        shots = [view.frames(e, steps=(s,))[0] for e, s in zip(expected, (0, 2, 1), strict=True)]
        np.testing.assert_allclose(
            data[0]["frames"] * (high - low) + low, np.stack(shots), atol=1e-4
        )
    training = SynthFringe(small_set, "training", frames=(("unit", 15, 0), ("high", 15, 0)))
    values = torch.stack([item["frames"] for item in training])
    assert values.min() == 0 and 0.8 < values.max() <= 1
    other = SynthFringe(small_set, "training", extremes=(20.0, 220.0))
    grey = 20 + 200 * other[0]["frames"]
    low, high = training.extremes
    torch.testing.assert_close(grey[0], low + (high - low) * training[0]["frames"][1])


@pytest.mark.parametrize("workers", [0, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 2))])
def test_items_do_not_depend_on_the_workers(workers, small_set):
    how = {"gain": (0.5, 1.2), "noise": (0.5, 3.0), "gamma": (0.8, 1.2)}
    data = SynthFringe(small_set, "training", augmentation=Augmentation(**how), seed=3)
    plain = [data[n] for n in range(len(data))]
    kept = {} if workers == 0 else {"persistent_workers": True}
    loader = DataLoader(data, batch_size=4, num_workers=workers, **kept)
    for batch, first in zip(loader, range(0, 16, 4), strict=True):
        for name, value in batch.items():
            assert torch.equal(value, torch.stack([plain[first + k][name] for k in range(4)])), name
    data.set_epoch(1)  # workers that stay alive see it too
    after = next(iter(loader))["frames"]
    assert not torch.equal(after[0], plain[0]["frames"])
    assert torch.equal(after[0], data[0]["frames"])


def test_each_augmentation_does_what_it_says(small_set):
    plain = SynthFringe(small_set, "training")[0]
    lit = plain["mask"]

    def changed(**how):
        return SynthFringe(small_set, "training", augmentation=Augmentation(**how), seed=1)[0]

    dark = changed(gain=(0.5, 0.5))
    np.testing.assert_allclose(dark["frames"][:, lit], plain["frames"][:, lit] / 2, atol=0.006)
    np.testing.assert_allclose(
        dark["modulation"][lit & dark["mask"]],
        plain["modulation"][lit & dark["mask"]] / 2,
        atol=0.5,
    )
    assert dark["mask"].sum() <= lit.sum()
    noisy = changed(noise=(2.0, 2.0))
    low, high = SynthFringe(small_set, "training").extremes
    bright = lit & (plain["frames"].min(0).values > 0.1)
    deviation = ((noisy["frames"] - plain["frames"]) * (high - low))[:, bright].std()
    assert 1.7 < deviation < 2.3
    assert torch.equal(noisy["Phi"], plain["Phi"])
    bent = changed(gamma=(0.5, 0.5))
    expected = 255 * (plain["frames"] * high / 255) ** 0.5 / high
    np.testing.assert_allclose(bent["frames"][:, bright], expected[:, bright], atol=0.02)


def test_a_model_is_in_one_split_of_items(small_set):
    models = [
        {int(item["model"]) for item in SynthFringe(small_set, s)}
        for s in ("training", "validation", "test", "held-out")
    ]
    assert sum(map(len, models)) == len(set.union(*models)) == 11


def test_draws_differ_between_views_seeds_and_photographs(small_set):
    how = Augmentation(gain=(0.5, 1.2), noise=(2.0, 2.0))
    twice = (("high", 15, 0), ("high", 15, 0))

    def data(seed):
        return SynthFringe(small_set, "training", twice, augmentation=how, seed=seed)

    first, other = data(0), data(1)
    assert not torch.equal(first[0]["frames"], other[0]["frames"])
    assert not torch.equal(first[0]["frames"][0], first[0]["frames"][1])
    plain = SynthFringe(small_set, "training", twice)
    gains = [
        (first[n]["modulation"][m] / plain[n]["modulation"][m]).median().item()
        for n in range(6)
        for m in [first[n]["mask"]]
    ]
    assert np.ptp(gains) > 0.1


def test_the_threshold_is_the_modulation_of_the_mask(small_set):
    for threshold in (8.0, 40.0):
        item = SynthFringe(small_set, "training", threshold=threshold)[0]
        assert item["modulation"][item["mask"]].min() > threshold
    assert SynthFringe(small_set, "training", threshold=0)[0]["mask"].sum() > item["mask"].sum()


def test_extremes_of_another_dataset_may_be_an_array(small_set):
    data = SynthFringe(small_set, "test", extremes=np.array([0, 100]))
    assert data.extremes == (0.0, 100.0)


def test_texture_is_darker_by_its_contrast_in_half_of_the_pixels():
    plain, blotched = (SynthFringe("data/tiny", "test", texture=c) for c in (0.0, 0.4))
    shares = []
    for k in range(3):
        one, other = plain[k], blotched[k]
        both = (one["mask"] & other["mask"]).numpy()
        ratio = (other["modulation"] / one["modulation"]).numpy()[both]
        dark = np.abs(ratio - 0.6) < 0.05
        assert (dark | (np.abs(ratio - 1) < 0.05)).all()
        shares.append(dark.mean())
        same = blotched[k]  # in every epoch
        assert (same["modulation"] == other["modulation"]).all()
    assert 0.3 < np.mean(shares) < 0.7
