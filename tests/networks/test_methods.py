"""SFNet and its rivals: each has inputs, targets, losses and a way to the phase of its own."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from fpputil.dataset.synthfringe import SynthFringe
from fpputil.learning.config import TrainingConfig
from fpputil.learning.evaluation import evaluate, open_split
from fpputil.learning.training import fit
from fpputil.learning.weights import load_weights, plain
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Weights
from fpputil.networks.methods import (
    DLALNetMethod,
    PSNetMethod,
    SFNetMethod,
    SIDOMethod,
    method_of,
    settings_of,
)
from fpputil.networks.targets import noiseless, placed, true_reference

TWO_PI = 2 * math.pi
SMALL = {"base": 2, "levels": 2}
ALL = {
    "sfnet": SFNetMethod(**SMALL),
    "sfnet, zmin": SFNetMethod(reference="zmin", **SMALL),
    "sfnet, mid": SFNetMethod(reference="mid", **SMALL),
    "sfnet, unit": SFNetMethod(reference="unit", **SMALL),
    "sfnet, 3 frames": SFNetMethod(frames=3, **SMALL),
    "sido": SIDOMethod(**SMALL),
    "sido, no plane": SIDOMethod(plane=False, **SMALL),
    "psnet": PSNetMethod(**SMALL),
    "psnet, fringe": PSNetMethod(errors="fringe", unit_step=4, **SMALL),
    "sido, fringe": SIDOMethod(errors="fringe", phase_weight=4.0, **SMALL),
    "dlalnet": DLALNetMethod(**SMALL),
    "dlalnet, losses of sfnet": DLALNetMethod(weights=Weights(order=False), **SMALL),
}
each = pytest.mark.parametrize("method", ALL.values(), ids=ALL)


def batch_of(small_set, method, number=4):
    geometry, batch = loaded(small_set, tuple(method.photographs), number)
    return geometry, dict(batch)


@functools.cache
def loaded(small_set, photographs, number):
    data = SynthFringe(small_set, "training", photographs)
    items = [data[k] for k in range(number)]
    stacked = {k: torch.stack([item[k] for item in items]) for k in items[0]}
    return Geometry.of(data.store.system, data.pitches, data.extremes), stacked


def network(method, seed=0):
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return method.network().eval()


def ideal(method, batch, geometry):
    """The outputs that fit the targets, from the wrapped phases and the grey levels alone."""
    phi = -torch.atan2(batch["M"], batch["D"])
    phis = dict(zip(("high", "mid", "zmin", "unit"), phi.unbind(1), strict=True))
    phis["refined"] = batch["phi_r"]

    def steps(name, number):
        delta = TWO_PI * torch.arange(number)[:, None, None] / number
        fringe = (phis[name][:, None] + delta).cos()
        if method.errors == "fringe":  # the same at every pixel, dim or bright
            return fringe
        grey = batch["modulation"][:, None] * (1 + fringe)
        return (grey - geometry.extremes[0]) / (geometry.extremes[1] - geometry.extremes[0])

    if isinstance(method, SIDOMethod):
        return torch.cat([steps("high", 5), (batch["Phi"] * 24 / 912)[:, None]], 1)
    if isinstance(method, PSNetMethod):
        return torch.stack([steps("high", 15), steps("unit", 15)], 1)
    names = (
        ("high", "mid", "unit") if isinstance(method, DLALNetMethod) else ("high", method.reference)
    )
    pairs = [torch.stack([-phis[n].sin(), phis[n].cos()], 1) for n in names]
    return torch.stack(pairs, 1)


@each
def test_ideal_outputs_are_the_absolute_phase_and_cost_nothing(small_set, method):
    geometry, batch = batch_of(small_set, method)
    outputs, mask = ideal(method, batch, geometry), batch["mask"]
    assert outputs.shape == network(method)(method.inputs(batch["frames"], geometry)).shape
    off = ((method.absolute_phase(outputs, geometry) - batch["Phi"])[mask]).abs()
    assert off.max() < 2e-3
    phi_h, phi = method.phases(outputs)
    for found, true in ((phi_h, batch["Phi"]), (phi, true_reference(method, batch))):
        if true is not None:
            assert (found - true)[mask].cos().min() > 1 - 1e-6
    losses = method.losses(outputs, batch, geometry)
    assert losses["total"].shape == (4,)
    assert all(v.max() < 1e-5 for k, v in losses.items() if k not in ("geometric", "total"))


@each
def test_nothing_outside_the_mask_reaches_a_loss(small_set, method):
    geometry, batch = batch_of(small_set, method)
    outputs = network(method)(method.inputs(batch["frames"], geometry)).detach().requires_grad_()
    wild = {k: v.clone() for k, v in batch.items()}
    outside = ~batch["mask"]
    for name in ("M", "D"):
        wild[name].movedim(1, -1)[outside] = math.nan
    for name in ("M_r", "D_r", "phi_r", "Phi", "modulation"):
        wild[name][outside] = math.nan
    losses = method.losses(outputs, wild, geometry)
    for name, value in method.losses(outputs, batch, geometry).items():
        torch.testing.assert_close(losses[name], value)
    losses["total"].sum().backward()
    assert outputs.grad.isfinite().all()
    images = outputs.grad.movedim((-2, -1), (1, 2))
    assert (images[outside] == 0).all() and (images[batch["mask"]] != 0).any()


@each
def test_the_range_mends_every_order_that_lies_outside_it(small_set, method):
    """And no right one is lost: ideal outputs stay as they are, wild ones end in the range."""
    geometry, batch = batch_of(small_set, method)
    outputs, mask = ideal(method, batch, geometry), batch["mask"]
    off = (method.phase_in_range(outputs, geometry) - batch["Phi"])[mask].abs()
    assert off.max() < 2e-3
    wild = outputs.clone()
    wild[:, 1:] = wild[:, 1:].flip(-1)  # the second phases are those of other places
    Phi, phi_h = method.phase_in_range(wild, geometry), method.phases(wild)[0]
    low, high = (end.expand(mask.shape)[mask] for end in geometry.Phi_range)
    assert (Phi[mask] > low - 1.001 * math.pi).all() and (Phi[mask] < high + 1.001 * math.pi).all()
    assert (Phi - phi_h)[mask].cos().min() > 1 - 1e-6  # moved by whole orders alone
    outside = (method.absolute_phase(wild, geometry)[mask] < low - math.pi).any()
    assert outside or method.reference in ("refined", "zmin", "mid")


@pytest.mark.parametrize("name", ["sfnet", "sido", "psnet", "dlalnet"])
@pytest.mark.parametrize("option", ["normalised", "coordinates"])
def test_what_every_method_may_have_besides(small_set, name, option):
    plain_one = ALL[name]
    method = replace(plain_one, **{option: True})
    geometry, batch = batch_of(small_set, method)
    seen, before = (one.inputs(batch["frames"], geometry) for one in (method, plain_one))
    outputs = network(method)(seen)
    assert outputs.shape == network(plain_one)(before).shape
    assert method_of(plain(settings_of(method))) == method
    if option == "normalised":  # a brighter image of a batch changes no other
        other = seen.clone()
        other[1] *= 2
        torch.testing.assert_close(network(method)(other)[0], outputs[0])
        return
    encoders = 2 if name in ("sfnet", "psnet") else 1
    added = seen.shape[1] - before.shape[1]
    assert added == 2 * encoders
    corners = seen[0, :, [0, 0, -1], [0, -1, 0]].tolist()
    assert corners.count([-1, 1, -1]) == corners.count([-1, -1, 1]) == encoders  # column, row


def changed(batch, name, channel=None):
    """The batch with one of its images turned a little."""
    other = {k: v.clone() for k, v in batch.items()}
    part = other[name] if channel is None else other[name][:, channel]
    part *= 0.9
    return other


HIGH, MID, ZMIN, UNIT = range(4)


@pytest.fixture(scope="module")
def answered(small_set):
    """Of each method the total losses of what its network answers: a function, a batch, values."""

    def answer(method):
        geometry, batch = batch_of(small_set, method)
        with torch.no_grad():
            outputs = network(method)(method.inputs(batch["frames"], geometry))

        def losses(targets):
            return method.losses(outputs, targets, geometry)["total"]

        return losses, batch, losses(batch)

    return {label: answer(method) for label, method in ALL.items()}


@pytest.mark.parametrize(
    "name, channel, learnt_by",
    [
        ("M", HIGH, ALL.keys()),
        ("M", MID, {"sfnet, mid", "dlalnet", "dlalnet, losses of sfnet"}),
        ("M", ZMIN, {"sfnet, zmin"}),
        ("M", UNIT, {k for k in ALL if k.startswith(("psnet", "dlalnet"))} | {"sfnet, unit"}),
        ("M_r", None, {"sfnet", "sfnet, 3 frames"}),
        ("modulation", None, {"sido", "sido, no plane", "psnet"}),
        ("Phi", None, {k for k in ALL if "sf" in k or "sido" in k}),
        ("phi_r", None, set()),
        ("depth", None, set()),
    ],
)
def test_each_method_learns_from_targets_of_its_own(answered, name, channel, learnt_by):
    for label, (losses, batch, before) in answered.items():
        after = losses(changed(batch, name, channel))
        assert (not torch.equal(before, after)) == (label in learnt_by), label


def test_each_method_sees_photographs_of_its_own():
    high, mid, zmin, unit = ((name, 15, 0) for name in ("high", "mid", "zmin", "unit"))
    seen = {label: method.photographs for label, method in ALL.items()}
    assert seen["sfnet"] == seen["sfnet, zmin"] == (high, zmin)
    assert seen["sfnet, mid"] == (high, mid) and seen["sfnet, unit"] == (high, unit)
    assert seen["sido"] == seen["sido, no plane"] == (high,)
    assert seen["psnet"] == (high, unit) and seen["dlalnet"] == (high, mid, unit)
    assert seen["psnet, fringe"] == (high, ("unit", 15, 4))


def outputs_differ(method, batch, geometry, photograph):
    """Whether each second part of the outputs changes with one of the photographs."""
    net = network(method)
    other = batch["frames"].clone()
    other[:, photograph] *= 0.7
    with torch.no_grad():
        a, b = (net(method.inputs(f, geometry)) for f in (batch["frames"], other))
    return [not torch.equal(x, y) for x, y in zip(a.unbind(1), b.unbind(1), strict=True)]


@pytest.mark.parametrize(
    "method, photograph, parts",
    [
        (ALL["psnet"], 0, [True, False]),
        (ALL["psnet"], 1, [False, True]),
        (SFNetMethod(mixing="none", **SMALL), 0, [True, False]),
        (SFNetMethod(mixing="none", **SMALL), 1, [False, True]),
        (ALL["sfnet"], 1, [True, True]),
        (ALL["dlalnet"], 2, [True, True, True]),
        (ALL["sido"], 0, [True] * 6),
    ],
)
def test_a_photograph_changes_only_what_it_should(small_set, method, photograph, parts):
    geometry, batch = batch_of(small_set, method)
    assert outputs_differ(method, batch, geometry, photograph) == parts


def test_a_network_of_one_pitch_learns_from_that_pitch_alone(small_set):
    method = ALL["psnet"]
    geometry, batch = batch_of(small_set, method)
    grads = []
    for target in (batch, changed(batch, "M", UNIT)):
        net = network(method)
        method.losses(net(batch["frames"]), target, geometry)["total"].sum().backward()
        grads.append([[p.grad for p in part.parameters()] for part in net.nets])
    (high, unit), (high_after, unit_after) = grads
    assert all(map(torch.equal, high, high_after))
    assert not any(map(torch.equal, unit, unit_after))


def test_the_plane_is_what_the_camera_sees_of_z_max(small_set):
    method = ALL["sido"]
    geometry, batch = batch_of(small_set, method)
    _, plane = method.inputs(batch["frames"], geometry).unbind(1)
    assert torch.equal(plane[0], plane[3])
    columns = geometry.system.columns_at(geometry.system.z_max)
    lit = (columns > -0.5) & (columns < 911.5)
    assert 0 < (~lit).sum() < 0.1 * lit.size
    dark = (0 - geometry.extremes[0]) / (geometry.extremes[1] - geometry.extremes[0])
    assert (plane[0].numpy()[~lit] == np.float32(dark)).all()
    low, high = geometry.extremes
    light = 255 / 2 * (1 + np.cos(TWO_PI * columns / 24))
    np.testing.assert_allclose(
        plane[0].numpy()[lit], ((light - low) / (high - low))[lit], atol=2e-4
    )
    without = ALL["sido, no plane"]
    assert torch.equal(without.inputs(batch["frames"], geometry), batch["frames"])


@pytest.mark.parametrize("name", ["high", "mid", "unit"])
def test_photographs_as_targets_are_those_of_the_renderer(small_set, name):
    """Within the rounding to whole grey levels, where nothing saturates."""
    data = SynthFringe(small_set, "training", [(name, 5, k) for k in range(5)])
    batch = {k: v[None] for k, v in data[3].items()}
    geometry = Geometry.of(data.store.system, data.pitches, data.extremes)
    found, mask = noiseless(batch, name, 5, geometry), batch["mask"]
    grey = (found - batch["frames"]).movedim(1, -1)[mask] * (
        geometry.extremes[1] - geometry.extremes[0]
    )
    assert grey.abs().max() < 1.2 and grey.abs().mean() < 0.4


def test_losses_of_photographs_against_loops(small_set):
    for method in (ALL["sido"], ALL["psnet"]):
        geometry, batch = batch_of(small_set, method, number=2)
        outputs = network(method)(method.inputs(batch["frames"], geometry)).detach().double()
        batch = {k: v.double() if v.is_floating_point() else v for k, v in batch.items()}
        found = method.losses(outputs, batch, geometry)
        low, high = geometry.extremes
        for k, (out, mask) in enumerate(zip(outputs.numpy(), batch["mask"].numpy(), strict=True)):
            frames, steps, coarse = [], [], []
            for v, u in np.argwhere(mask):
                for part, at in ((0, HIGH), (1, UNIT)):
                    if method is ALL["sido"] and part:
                        coarse.append((out[5, v, u] - batch["Phi"][k, v, u] * 24 / 912) ** 2)
                        continue
                    number = 5 if method is ALL["sido"] else 15
                    got = out[:5, v, u] if number == 5 else out[part, :, v, u]
                    M, D = (batch[x][k, at, v, u] for x in "MD")
                    phi, B = -math.atan2(M, D), float(batch["modulation"][k, v, u])
                    light = B * (1 + np.cos(phi + TWO_PI * np.arange(number) / number))
                    e = got - (np.asarray(light) - low) / (high - low)
                    frames.append(np.mean((e if number == 5 else e[1:]) ** 2))
                    e[0] = 0 if number == 15 else e[0]  # the photograph is no prediction
                    steps.append(np.mean((e - np.roll(e, -1)) ** 2))
            assert found["frames"][k].item() == pytest.approx(np.mean(frames), rel=1e-5)
            second = ("phase", coarse) if method is ALL["sido"] else ("steps", steps)
            assert found[second[0]][k].item() == pytest.approx(np.mean(second[1]), rel=1e-5)
            assert found["total"][k] == found["frames"][k] + found[second[0]][k]


@pytest.mark.parametrize("method", ["psnet, fringe", "sido, fringe"])
def test_losses_of_fringes_against_loops(small_set, method):
    method = ALL[method]
    geometry, batch = batch_of(small_set, method, number=2)
    outputs = network(method)(method.inputs(batch["frames"], geometry)).detach().double()
    found = method.losses(outputs, {k: v.double() for k, v in batch.items()} | batch, geometry)
    pitches = ((HIGH,), (HIGH, UNIT))[isinstance(method, PSNetMethod)]
    number = 5 if len(pitches) == 1 else 15
    for k, mask in enumerate(batch["mask"].numpy()):
        frames, steps = [], []
        for v, u in np.argwhere(mask):
            for part, at in enumerate(pitches):
                got = outputs[k, :5, v, u] if number == 5 else outputs[k, part, :, v, u]
                phi = -math.atan2(*(batch[x][k, at, v, u] for x in "MD"))
                e = got.numpy() - np.cos(phi + TWO_PI * np.arange(number) / number)
                frames.append(np.mean(e**2))
                steps.append(np.mean([(e[n] - e[n - 1]) ** 2 for n in range(number)]))
        assert found["frames"][k].item() == pytest.approx(np.mean(frames), rel=1e-5)
        if number == 15:
            assert found["steps"][k].item() == pytest.approx(np.mean(steps), rel=1e-5)


def test_the_scale_of_the_inputs_is_that_of_the_targets(small_set):
    """Grey levels are the same, whichever of them is 0 and which 1."""
    geometry, batch = batch_of(small_set, ALL["psnet"], number=1)
    greys = []
    for low, high in (geometry.extremes, (20.0, 220.0)):
        made = noiseless(batch, "high", 5, replace(geometry, extremes=(low, high)))
        greys.append(low + (high - low) * made)
    torch.testing.assert_close(*greys)


def test_coordinates_are_columns_then_rows_from_edge_to_edge():
    frames = torch.zeros(1, 1, 3, 5)
    _, column, row = placed(frames)[0]
    torch.testing.assert_close(column, torch.linspace(-1, 1, 5).expand(3, 5))
    torch.testing.assert_close(row, torch.linspace(-1, 1, 3)[:, None].expand(3, 5))


def test_a_pitch_is_named_by_a_range_that_its_period_covers(tiny):
    """By the lit columns between both ends of a pixel's ray, and the pitch, both in pixels."""
    geometry, system = Geometry.of(tiny.system, tiny.pitches), tiny.system
    for name in ("mid", "zmin", "unit"):
        ends = [system.columns_at(z) for z in (system.z_min, system.z_max)]
        span = np.abs(np.subtract(*np.clip(ends, -0.5, system.projector.width - 0.5)))
        expected = span < getattr(tiny.pitches, name)
        clear = np.isfinite(span) & (np.abs(span - getattr(tiny.pitches, name)) > 0.1)
        assert (geometry.named_by_range(name).numpy() == expected)[clear].all()
    assert not geometry.named_by_range("mid").all() and geometry.named_by_range("zmin").any()


@each
def test_settings_there_and_back(method):
    assert method_of(plain(settings_of(method))) == method


@pytest.mark.parametrize("name", ["sfnet, unit", "sido", "psnet", "dlalnet"])
def test_it_learns_and_is_measured_as_it_was_saved(undrawn, small_set, tmp_path, name):
    """A few steps lower the loss; the file has the method, the split its photographs."""
    method = ALL[name]
    settings = TrainingConfig(
        epochs=3, learning_rate=5e-3, schedule="one-cycle", validation_views=2, precision="float32"
    )
    _, history = fit(method, small_set, settings, tmp_path)
    assert history[-1]["total"] < history[0]["total"]
    trained = load_weights(tmp_path / "weights.safetensors")
    assert trained.method == method
    both, told, alone = evaluate(trained, open_split(trained, small_set, "test"))
    measures = both.summary()
    assert ("mae_low" in measures) == (method.reference is not None)
    assert 0 < measures["mae_high"][0] < math.pi
    assert alone.summary()["order_errors"][0] > 0.5
