"""The recipes of the presets: every method has one, and all cost about the same."""

import pytest

from fpputil.experiments.registry import CAMERA, recipe, sized
from fpputil.networks import METHODS, SFNetMethod, Weights


def test_recipes():
    for name in ("tiny", "small"):
        method, settings = recipe(name)
        assert isinstance(method, SFNetMethod) and settings.augmentation == CAMERA
        assert (settings.schedule, settings.early_stopping) == ("one-cycle", 0)
    method, settings = recipe("paper")
    assert (method.levels, method.frames, method.mixing) == (6, 1, "deepest")
    assert method.weights == Weights(1.0, 1e-2, 1e-6, order=True, mean=False)
    assert (settings.epochs, settings.schedule, settings.batch) == (250, "plateau", 8)
    with pytest.raises(
        ValueError, match="preset 'huge' given; the presets are tiny, small, paper, near"
    ):
        recipe("huge")


@pytest.mark.parametrize("unit, levels", [(4, 5), (8, 6)])
def test_all_methods_cost_about_the_same(unit, levels):
    numbers = []
    for name, kind in METHODS.items():
        network = kind(base=sized(name, unit), levels=levels).network()
        numbers.append(sum(p.numel() for p in network.parameters()))
    assert max(numbers) < 1.15 * min(numbers)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("preset", ["tiny", "small", "paper"])
def test_every_method_has_a_recipe(name, preset):
    method, settings = recipe(preset, name)
    assert isinstance(method, METHODS[name])
    assert settings == recipe(preset)[1]  # the budget is the same for all


def test_an_unknown_method_is_named():
    with pytest.raises(ValueError, match="method 'unet' given; the methods are sfnet, sido, psnet"):
        recipe("tiny", "unet")
