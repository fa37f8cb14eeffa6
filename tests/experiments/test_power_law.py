"""A power law of errors against images seen."""

import numpy as np
import pytest

from fpputil.experiments.statistics import power_law


@pytest.mark.parametrize("number", [1, 3])
def test_a_power_law_holds_its_truth_in_95_of_100_cases(number):
    rng, x = np.random.default_rng(0), np.repeat([900.0, 3600.0, 14400.0], number)
    held = 0
    for _ in range(400):
        law = power_law(x, 5 * x**-0.4 * np.exp(rng.normal(0, 0.05, len(x))))
        value, low, high = law(3.6e6)
        assert low < value < high
        held += low < 5 * 3.6e6**-0.4 < high
    assert 0.92 < held / 400 < 0.98


@pytest.mark.parametrize("images, errors", [((1, 2), (1, 2)), ((5, 5, 5), (1, 2, 3))])
def test_a_power_law_needs_trainings_that_differ(images, errors):
    with pytest.raises(ValueError, match="three or more are needed, of at least two numbers"):
        power_law(images, errors)


def test_errors_of_a_power_law_are_above_nothing():
    with pytest.raises(ValueError, match=r"errors \[1, 0, 3\] given; numbers above 0"):
        power_law([1, 2, 3], [1, 0, 3])
