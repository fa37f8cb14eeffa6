"""What a network measures, tried with one that tells the truth, or misses it by a known amount."""

import json
import math

import numpy as np
import pytest
import torch
import trimesh
from safetensors.torch import load_file
from torch import nn

from fpputil.dataset.augmentation import Augmentation
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.learning.evaluation import (
    evaluate,
    open_split,
    predict_batch,
    predictions,
    save_points,
)
from fpputil.learning.weights import (
    Trained,
    load_weights,
    read_metrics,
    save_weights,
    write_metrics,
)
from fpputil.networks.geometry import Geometry
from fpputil.networks.methods import SFNetMethod, settings_of

TWO_PI = 2 * math.pi
METHOD = SFNetMethod(base=2, levels=2)


@pytest.fixture(scope="module")
def about(small_set):
    data = SynthFringe(small_set, "training")
    return {
        "pitches": data.pitches._asdict(),
        "camera": [120, 160],
        "extremes": list(data.extremes),
    }


class Oracle(nn.Module):
    """In place of a network: the targets of the views of a split, turned by given phases.

    It knows a view by its photographs.
    """

    def __init__(self, items, high, low):
        super().__init__()
        self.items, self.off = list(items), (high, low)
        self.weight = nn.Parameter(torch.zeros(1))

    def forward(self, frames):
        return torch.stack([self.answer(f) for f in frames])

    def answer(self, frames):
        (item,) = (i for i in self.items if torch.equal(i["frames"], frames))
        pairs = (item["M"][0], item["D"][0]), (item["M_r"], item["D_r"])
        return torch.stack([
            torch.stack([M * math.cos(d) - D * math.sin(d), M * math.sin(d) + D * math.cos(d)])
            for (M, D), d in zip(pairs, self.off, strict=True)
        ])  # fmt: skip


def oracle(small_set, about, split="training", high=0.0, low=0.0):
    data = open_split(Trained(METHOD, None, about), small_set, split)
    items = [data[k] for k in range(len(data))]
    return Trained(METHOD, Oracle(items, high, low), about), data


def values(score):
    return {k: v[0] for k, v in score.summary().items()}


def test_the_truth_has_no_error(small_set, about):
    trained, data = oracle(small_set, about)
    both, told, alone = (values(score) for score in evaluate(trained, data))
    assert set(both) - set(alone) == set(both) - set(told) == {"mae_low"}
    assert told["order_errors"] == 0 and told["mae_rad"] < 2e-4
    for name in ("mae_rad", "rmse_rad", "mae_high", "mae_low"):
        assert both[name] < 2e-4, name
    assert both["order_errors"] == 0 and both["no_depth"] == 0
    assert both["spikes"] == both["spikes_of_truth"]
    assert both["median_mm"] < 0.02 and both["mae_mm"] < 0.05
    assert 0 < both["insensitive"] < 0.5
    assert alone["order_errors"] > 0.5 and alone["mae_high"] == both["mae_high"]


def test_each_model_is_scored_with_all_its_views(small_set, about):
    trained, data = oracle(small_set, about)
    both, *_ = evaluate(trained, data)
    models = {int(data[k]["model"]) for k in range(len(data))}
    assert set(both.models) == models and len(models) == 8
    pixels = sum(int(data[k]["mask"].sum()) for k in range(len(data)))
    assert sum(own["rad"][0] for own in both.models.values()) == pixels


@pytest.mark.parametrize("split", ["test", "held-out"])
def test_errors_are_those_made(small_set, about, split):
    """phi_h 0.1 rad too high: so is Phi. phi_r half a low period off: every order is wrong."""
    trained, data = oracle(small_set, about, split, high=0.1)
    both, told, alone = (values(score) for score in evaluate(trained, data))
    for found in (both["mae_rad"], both["mae_high"], both["rmse_rad"], alone["mae_high"]):
        assert found == pytest.approx(0.1, abs=2e-4)
    assert both["mae_low"] < 2e-4 and both["order_errors"] == 0
    trained, data = oracle(small_set, about, split, low=math.pi / 2)
    both, told, alone = (values(score) for score in evaluate(trained, data))
    assert both["mae_low"] == pytest.approx(math.pi / 2, abs=2e-4)
    assert both["order_errors"] == 1 and both["mae_high"] < 2e-4
    off = both["mae_rad"] / TWO_PI  # about a quarter of 304 / 24 orders
    assert 2.5 < off < 12
    assert told["mae_rad"] < 0.6 * both["mae_rad"]  # the range holds fewer orders than that


def test_views_may_be_chosen(small_set, about):
    trained, data = oracle(small_set, about)
    chosen = [3, 0, 11]
    found = list(predictions(trained, data, views=chosen))
    assert [int(item["index"]) for item, _ in found] == data.indices[chosen].tolist()
    for (item, one), k in zip(found, chosen, strict=True):
        truth = data[k]
        assert item.keys() == truth.keys()
        for name, value in item.items():
            np.testing.assert_array_equal(value, truth[name])
        mask = item["mask"]
        np.testing.assert_allclose(one.Phi[mask], item["Phi"][mask], atol=1e-3)
        Phis = (one.Phi, one.Phi_in_range, one.Phi_from_one)
        assert {a.shape for a in (one.phi_h, one.phi_r, *Phis)} == {(120, 160)}
        assert one.Phi.dtype == np.float32
    assert len(list(predictions(trained, data))) == 16  # two whole batches
    assert len(evaluate(trained, data, views=chosen)[0].models) == 3


def network(seed=0):
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return METHOD.network().eval()


def test_measure_is_network_and_method(small_set, about):
    trained = Trained(METHOD, network(), about)
    data = open_split(trained, small_set, "test")
    frames = torch.stack([data[0]["frames"], data[1]["frames"]])
    geometry = Geometry.of(data.store.system, data.pitches)
    found = predict_batch(trained, frames, geometry)
    with torch.no_grad():
        outputs = trained.network(frames)
        phi_h, phi_r = METHOD.phases(outputs)
        maps = (
            phi_h,
            phi_r,
            METHOD.absolute_phase(outputs, geometry),
            geometry.from_one_phase(phi_h),
        )
    for one, *expected in zip(found, *maps, strict=True):
        for got, value in zip(
            (one.phi_h, one.phi_r, one.Phi, one.Phi_from_one), expected, strict=True
        ):
            turned = np.exp(1j * (got - value.numpy()).astype(float))
            np.testing.assert_allclose(turned, 1, atol=1e-3)
    again = predict_batch(trained, frames.numpy(), geometry)
    np.testing.assert_array_equal(again[1].Phi, found[1].Phi)
    lower = predict_batch(trained, frames, geometry, "bfloat16")
    off = np.abs(np.angle(np.exp(1j * (lower[0].phi_h - found[0].phi_h))))
    assert 0 < off.mean() < 0.02


def test_predictions_in_sixteen_bit_are_near_and_leave_the_network_in_float32(small_set, about):
    trained = Trained(METHOD, network(), about)
    data = open_split(trained, small_set, "test")
    views = {"views": [0, 1]}
    exact = [m.phi_h for _, m in predictions(trained, data, **views)]
    lower = [m.phi_h for _, m in predictions(trained, data, precision="bfloat16", **views)]
    assert all(p.dtype == torch.float32 for p in trained.network.parameters())
    off = np.abs(np.angle(np.exp(1j * (np.array(lower) - np.array(exact)))))
    assert 0 < off.mean() < 0.02


@pytest.mark.parametrize("wild", [math.nan, math.inf])
def test_photographs_that_are_not_finite_are_named(small_set, about, wild):
    trained = Trained(METHOD, network(), about)
    data = open_split(trained, small_set, "test")
    frames = data[0]["frames"][None].clone()
    frames[0, 1, 5, 5] = wild
    with pytest.raises(ValueError, match="NaN or infinite pixels"):
        predict_batch(trained, frames, Geometry.of(data.store.system, data.pitches))


@pytest.mark.slow
def test_loading_processes_change_nothing(small_set, about):
    trained = Trained(METHOD, network(), about)
    data = open_split(trained, small_set, "test", Augmentation(noise=(3.0, 3.0)), seed=4)
    alone, helped = (evaluate(trained, data, workers=n)[0].summary() for n in (0, 1))
    assert alone == helped
    other = open_split(trained, small_set, "test", Augmentation(noise=(3.0, 3.0)), seed=5)
    assert evaluate(trained, other)[0].summary() != alone


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"camera": [240, 320]}, r"camera \[120, 160\], the network was trained for \[240, 320\]"),
        ({"pitches": {"high": 18, "mid": 114, "zmin": 304, "unit": 912}}, "pitches .*'high': 24"),
        ({"extremes": [9.0, 3.0]}, "extremes 9.0, 3.0"),
    ],
)
def test_another_rig_is_named(small_set, about, changes, said):
    with pytest.raises(ValueError, match=said):
        open_split(Trained(METHOD, None, {**about, **changes}), small_set, "test")


@pytest.mark.parametrize("name", ["pitches", "camera", "extremes"])
def test_weights_that_do_not_say_for_what_they_are(small_set, about, name):
    lacking = {k: v for k, v in about.items() if k != name}
    with pytest.raises(ValueError, match=name):
        open_split(Trained(METHOD, None, lacking), small_set, "test")


def test_a_split_sees_with_the_extremes_of_the_network(small_set, about):
    own = open_split(Trained(METHOD, None, about), small_set, "test")
    other = open_split(
        Trained(METHOD, None, {**about, "extremes": [10.0, 110.0]}), small_set, "test"
    )
    low, high = about["extremes"]
    grey = own[0]["frames"] * (high - low) + low
    torch.testing.assert_close(other[0]["frames"], (grey - 10) / 100, rtol=0, atol=1e-5)


def test_points_of_a_view(small_set, about, tmp_path):
    """The points of the truth lie where the renderer saw the surface."""
    trained, data = oracle(small_set, about, "test")
    item, found = next(predictions(trained, data))
    path = tmp_path / "view.ply"
    number = save_points(path, item, found, data)
    cloud = trimesh.load(path, process=False)
    points = np.asarray(cloud.vertices)
    assert len(points) == number == item["mask"].sum()
    z = item["depth"][item["mask"]]
    bright = item["modulation"][item["mask"]] > 20
    left = np.argwhere(item["mask"])[:, 1] < 110  # further right a column hardly says a depth
    assert np.median(np.abs(points[:, 2] - z)[bright & left]) < 0.05
    rays = data.store.system.camera.rays()[item["mask"]]
    np.testing.assert_allclose(points / points[:, 2:], rays / rays[:, 2:], atol=1e-5)
    grey = (255 * item["frames"][0][item["mask"]].clip(0, 1)).astype(np.uint8)
    np.testing.assert_array_equal(np.asarray(cloud.visual.vertex_colors)[:, 0], grey)


def test_pixels_without_a_depth_are_no_points(small_set, about, tmp_path):
    trained, data = oracle(small_set, about, "test")
    item, found = next(predictions(trained, data))
    found.Phi[:60] = np.nan
    number = save_points(tmp_path / "view.ply", item, found, data)
    assert number == item["mask"][60:].sum()
    found.Phi[:] = np.nan
    with pytest.raises(ValueError, match="no point found in view"):
        save_points(tmp_path / "none.ply", item, found, data)
    assert not (tmp_path / "none.ply").exists()


@pytest.mark.parametrize("dtype", [torch.float16, torch.float32])
def test_what_was_measured_is_kept_with_the_weights(tmp_path, about, dtype):
    path = tmp_path / "net.safetensors"
    save_weights(path, Trained(METHOD, network(), about), dtype)
    before = load_file(path)
    write_metrics(path, load_weights(path), "test", {"mae_rad": [1.0, 0.5, 2.0]})
    write_metrics(path, load_weights(path), "held-out", {"mae_rad": [3.0, 2.5, 4.0]})
    after = load_file(path)
    assert all(torch.equal(before[k], after[k]) and after[k].dtype == dtype for k in before)
    metrics = {"test": {"mae_rad": [1.0, 0.5, 2.0]}, "held-out": {"mae_rad": [3.0, 2.5, 4.0]}}
    back = load_weights(path)
    assert read_metrics(path) == metrics and back.metadata == about and back.method == METHOD
    beside = json.loads((tmp_path / "net.json").read_text())
    assert beside["metrics"] == metrics and beside["method"] == settings_of(METHOD)
