"""The search for a learning rate: it goes on where the best is an end, and is made once."""

import json
import math

import pytest
import torch

from fpputil.experiments import learning_rate as rates
from fpputil.experiments import registry as experiments

pytestmark = pytest.mark.usefixtures("short_runs")


def test_the_search_goes_on_where_the_best_is_an_end(small_set, tmp_path, monkeypatch):
    """Least at 1.6e-2 for one method, at 2e-3 for the others."""
    path, seen = tmp_path / "tiny" / "rates.json", []
    known = experiments.methods("tiny")
    monkeypatch.setattr(rates, "methods", lambda preset: known)

    def fit(method, data, settings, **how):
        seen.append(settings.learning_rate)
        if method == known["sido"] and settings.learning_rate > 0.02:
            raise FloatingPointError("the loss is inf")
        best = 1.6e-2 if method == known["sido"] else 2e-3
        found = {
            f"validation_{k}": abs(math.log(settings.learning_rate / best)) for k in rates.MEASURES
        }
        return None, [{**found, "seconds": 1.0}]

    monkeypatch.setattr(rates, "fit", fit)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    monkeypatch.setattr(rates, "hardware", lambda device: device.type)
    found = rates.search_learning_rate(small_set, path)
    assert json.loads(path.read_text())["hardware"] == "cuda"  # where `fit` trains by default
    assert rates.search_learning_rate(small_set, path, ["psnet"]) == {"psnet": 2e-3}
    assert found == {"sfnet": 2e-3, "sido": 1.6e-2, "psnet": 2e-3, "dlalnet": 2e-3}
    made = json.loads(path.read_text())["runs"]
    assert list(made["sfnet"]) == ["0.001", "0.002", "0.004"]
    assert made["sido"]["0.032"] == {"mae": None}
    number = len(seen)
    assert rates.search_learning_rate(small_set, path) == found and len(seen) == number
    made["psnet"].popitem()
    path.write_text(json.dumps({**json.loads(path.read_text()), "runs": made}))
    assert rates.search_learning_rate(small_set, path) == found and len(seen) == number + 1


def test_a_search_is_a_training_run(small_set, tmp_path, monkeypatch):
    monkeypatch.setattr(rates, "_next_rate", lambda tried: None if tried else 1e-3)
    rates.search_learning_rate(small_set, tmp_path / "rates.json")
    found = json.loads((tmp_path / "rates.json").read_text())["runs"]["psnet"]["0.001"]
    assert 0 < found["mae"] < found["rmse"] and 0 < found["order_errors"] <= 1


def test_a_rate_that_diverges_is_not_the_best():
    tried = {"0.001": {"mae": 1.0}, "0.002": {"mae": None}, "0.004": {"mae": None}}
    assert rates._next_rate(tried) == 5e-4
    assert rates._next_rate({**tried, "0.0005": {"mae": 2.0}}) is None


@pytest.mark.parametrize(
    "tried, said",
    [
        ([], r"runs \[\] given; a table is needed"),
        ({"sfnet": [0.001]}, "runs.sfnet .0.001. given; a table is needed"),
        ({"sfnet": {"fast": {"mae": 1}}}, "could not convert string to float: 'fast'"),
        ({"sfnet": {"-1": {"mae": 1}}}, "rate in runs.sfnet -1.0 given; a positive number"),
        ({"sfnet": {"0.001": {}}}, "no runs.sfnet.0.001.mae"),
        ({"sfnet": {"0.001": {"mae": "1"}}}, "runs.sfnet.0.001.mae '1' given"),
    ],
)
def test_rates_of_another_structure(tried, said, tmp_path):
    path = tmp_path / "rates.json"
    path.write_text(json.dumps({"runs": tried}))
    with pytest.raises(ValueError, match=f"{path} is cut or no file of results .*{said}.*; remove"):
        rates.best_learning_rate(path, "sfnet")
