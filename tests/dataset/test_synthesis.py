"""Items made on the device against those of the loader."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.utils.data import default_collate

from fpputil.dataset.augmentation import Augmentation
from fpputil.dataset.synthesis import ViewMaps, synthesise
from fpputil.dataset.synthfringe import SynthFringe

CAMERA = Augmentation(gain=(0.6, 1.3), gamma=(0.8, 1.25))
SHOTS = (("high", 15, 0), ("zmin", 4, 1), ("unit", 15, 3))


def both(camera, number=4):
    """The same views from the loader and from the device."""
    data = SynthFringe("data/tiny", "training", SHOTS, camera, seed=3)
    data.set_epoch(2)
    maps = ViewMaps(data)
    made = synthesise(default_collate([maps[k] for k in range(number)]), data)
    return made, default_collate([data[k] for k in range(number)]), data


def test_items_are_those_of_the_loader_but_for_rounding():
    made, read, data = both(CAMERA)
    assert made.keys() == read.keys()
    low, high = data.extremes
    off = (made["frames"] - read["frames"]).abs() * (high - low)
    assert off.max() <= 1.001 and (off > 0.5).float().mean() < 1e-3  # grey levels
    agree = made["mask"] == read["mask"]
    assert (~agree).sum() <= 2
    for name in ("M", "D", "M_r", "D_r", "phi_r", "Phi", "Phi_true", "depth", "modulation"):
        assert made[name].dtype == read[name].dtype and made[name].shape == read[name].shape
        where = agree[:, None].expand_as(made[name]) if made[name].dim() == 4 else agree
        turns = (made[name] - read[name])[where].abs()
        assert turns.quantile(0.999) < 1e-3 and turns.mean() < 2e-4, name
    for name in ("index", "model"):
        assert made[name].tolist() == read[name].tolist()


def test_noise_is_drawn_anew_from_the_seeds():
    made, read, data = both(Augmentation(noise=(3.0, 3.0)))
    again = both(Augmentation(noise=(3.0, 3.0)))[0]
    assert torch.equal(made["frames"], again["frames"])
    low, high = data.extremes
    plain = both(Augmentation())[0]["frames"] * (high - low) + low
    clear = (plain > 15) & (plain < 240)  # where nothing is cut off
    off = ((made["frames"] - read["frames"])[clear] * (high - low)).numpy()
    sigma = np.sqrt(2 * (9 + 1 / 12))  # of two noises, each rounded
    assert abs(off.std() / sigma - 1) < 4 / np.sqrt(2 * off.size)
    assert abs(off.mean()) < 4 * sigma / np.sqrt(off.size)


def test_texture_and_photographs_are_refused():
    data = SynthFringe("data/tiny", "training", texture=0.3)
    with pytest.raises(ValueError, match=r"texture 0\.3 given; items are made on the device"):
        ViewMaps(data)


def test_a_network_learns_from_them_as_from_the_loaders(tmp_path):
    from fpputil.learning.config import TrainingConfig
    from fpputil.learning.training import fit
    from fpputil.networks.sfnet import SFNetMethod

    method = SFNetMethod(base=2, levels=3, dropout=0.0)
    config = TrainingConfig(epochs=1, training_views=16, validation_views=4, precision="float32")
    config = replace(config, learning_rate=1e-3)
    (_, one), (_, other) = (
        fit(method, "data/tiny", config, on_device=where) for where in (False, True)
    )
    for name in ("total", "validation_mae"):
        assert one[0][name] == pytest.approx(other[0][name], rel=1e-3)


def test_a_run_goes_on_where_it_made_its_items(tmp_path):
    from fpputil.learning.config import TrainingConfig
    from fpputil.learning.training import fit
    from fpputil.networks.sfnet import SFNetMethod

    method = SFNetMethod(base=2, levels=3)
    config = TrainingConfig(epochs=1, training_views=8, validation_views=4)
    fit(method, "data/tiny", config, tmp_path / "run", on_device=True)
    with pytest.raises(ValueError, match="has on_device True, and None is asked for"):
        fit(method, "data/tiny", config, tmp_path / "run", resume=True)
