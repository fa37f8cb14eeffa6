"""Losses and absolute phase of a method against loops over pixels, written from the equations."""

import math

import numpy as np
import pytest
import torch

from fpputil.dataset.synthfringe import SynthFringe
from fpputil.decoding.geometric_constraint import two_phase_absolute
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Pixels, Weights
from fpputil.networks.methods import SFNetMethod
from fpputil.optics.system import Pitches

TWO_PI = 2 * math.pi
PITCHES = Pitches(24, 114, 304, 912)
RATIO = 304 / 24
SIZE = (5, 7)


def rig_of(Phi_min):
    lowest = {"zmin": torch.as_tensor(Phi_min, dtype=torch.float32)}
    return Geometry(None, PITCHES, lowest, None, (0.0, 255.0), None)


GEOMETRY = rig_of(np.random.default_rng(9).uniform(-1, 3, SIZE))


def ideal(number=3, size=SIZE, seed=0, geometry=GEOMETRY):
    """Truth of random surfaces, float64, and the outputs that fit it."""
    rng = np.random.default_rng(seed)
    shape = (number, *size)
    Phi_r = geometry.Phi_min["zmin"].numpy().astype(float) + rng.uniform(0.5, TWO_PI - 0.5, shape)
    Phi = RATIO * Phi_r
    M, D = (rng.standard_normal((number, 4, *size)) for _ in "MD")
    M[:, 0], D[:, 0] = -np.sin(Phi), np.cos(Phi)
    phi_r = Phi_r - TWO_PI * np.ceil((Phi_r - math.pi) / TWO_PI)
    truth = {"M": M, "D": D, "M_r": -np.sin(phi_r), "D_r": np.cos(phi_r)}
    truth |= {"phi_r": phi_r, "Phi": Phi, "mask": rng.random(shape) < 0.7}
    truth = {k: torch.as_tensor(v) for k, v in truth.items()}
    high = torch.stack([truth["M"][:, 0], truth["D"][:, 0]], 1)
    low = torch.stack([truth["M_r"], truth["D_r"]], 1)
    return truth, torch.stack([high, low], 1)


def guess(outputs, seed=1, spread=0.8):
    """Outputs of a network that has not learnt much."""
    noise = np.random.default_rng(seed).normal(0, spread, tuple(outputs.shape))
    return outputs + torch.as_tensor(noise)


def wrapped(x):
    return x - TWO_PI * math.ceil((x - math.pi) / TWO_PI)


def by_loops(outputs, truth, geometry, method):
    """Eq. 12-15 of one image, pixel after pixel."""
    w = method.weights
    mask, Phi = truth["mask"].numpy(), truth["Phi"].numpy()
    inside = [tuple(p) for p in np.argwhere(mask)]
    phi_h, Phi_found, errors = {}, {}, []
    for p in inside:
        if method.target == "components":
            a, b, c, d = (float(outputs[k][p]) for k in ((0, 0), (0, 1), (1, 0), (1, 1)))
            wanted = truth["M"][0][p], truth["D"][0][p], truth["M_r"][p], truth["D_r"][p]
            high, low, given = -math.atan2(a, b), -math.atan2(c, d), (a, b, c, d)
        else:
            given = high, low = tuple(float(outputs[k, 0][p]) for k in (0, 1))
            wanted = wrapped(float(Phi[p])), truth["phi_r"][p]
        size = abs if w.l1 else lambda e: e**2
        errors.append([size(float(x) - float(y)) for x, y in zip(given, wanted, strict=True)])
        K_r = math.ceil((float(geometry.Phi_min["zmin"][p]) - low) / TWO_PI)
        K_h = round((RATIO * (low + TWO_PI * K_r) - high) / TWO_PI)
        phi_h[p], Phi_found[p] = high, high + TWO_PI * K_h
        residual = Phi_found[p] - float(Phi[p])
        errors[-1].append(size(residual if w.order else wrapped(residual)))
    steps = []
    for v, u in inside:
        steps += [("across", (v, u), q) for q in ((v, u + 1),) if q in phi_h]
        steps += [("down", (v, u), q) for q in ((v + 1, u),) if q in phi_h]
    eq13, eq14 = {"across": [], "down": []}, {"across": [], "down": []}
    for way, p, q in steps:
        eq13[way].append(wrapped(phi_h[q] - phi_h[p] - float(Phi[q] - Phi[p])) ** 2)
        eq14[way].append((Phi_found[q] - Phi_found[p]) ** 2)
    together = np.mean if w.mean else np.sum
    scale = 1 if w.mean else 640 * 480 / mask.size
    found = {
        "phase": np.mean(errors, axis=0).sum() if errors else 0.0,
        "consistency": sum(np.mean(x) for x in eq13.values() if x),
        "geometric": scale * sum(together(x) for x in eq14.values() if x),
    }
    found["total"] = sum(getattr(w, k) * v for k, v in found.items())
    return found


METHODS = [
    SFNetMethod(),
    SFNetMethod(weights=Weights(order=False)),
    SFNetMethod(weights=Weights(0.5, 0.3, 1e-3, mean=True)),
    SFNetMethod(weights=Weights(l1=True)),
    SFNetMethod(weights=Weights(order=False, l1=True)),
    SFNetMethod(target="phase"),
    SFNetMethod(target="phase", weights=Weights(2, 3, 4, order=False)),
]


def given_to(method, outputs):
    return outputs if method.target == "components" else outputs[:, :, :1] * 2


@pytest.mark.parametrize("method", METHODS)
def test_losses_are_those_of_the_equations(method):
    truth, outputs = ideal()
    outputs = given_to(method, guess(outputs))
    truth["mask"][1, :, 3] = False  # two parts that no difference may cross
    truth["mask"][2] = False
    truth["mask"][2, 2, 2] = True  # a pixel without neighbours
    found = method.losses(outputs, truth, GEOMETRY)
    assert list(found) == ["phase", "consistency", "geometric", "total"]
    for k in range(len(outputs)):
        expected = by_loops(
            outputs[k].numpy(), {n: v[k] for n, v in truth.items()}, GEOMETRY, method
        )
        for name, value in expected.items():
            assert found[name][k].item() == pytest.approx(value, rel=1e-6, abs=1e-9), name


def test_float32_is_near_enough_to_float64():
    truth, outputs = ideal()
    outputs = guess(outputs, spread=0.2)
    exact = SFNetMethod().losses(outputs, truth, GEOMETRY)
    single = {k: v if v.dtype == torch.bool else v.float() for k, v in truth.items()}
    for name, value in SFNetMethod().losses(outputs.float(), single, GEOMETRY).items():
        assert value.dtype == torch.float32
        torch.testing.assert_close(value.double(), exact[name], rtol=1e-4, atol=1e-5)


def test_ideal_outputs_cost_nothing_but_smoothness():
    truth, outputs = ideal()
    found = SFNetMethod().losses(outputs, truth, GEOMETRY)
    for name in ("phase", "consistency"):
        assert found[name].max() < 1e-9
    assert found["geometric"].min() > 1


@pytest.mark.parametrize("start", [0.0, 1.0, 3.0])
def test_a_jump_of_a_wrapped_phase_costs_nothing(start):
    """Eq. 13 across jumps of 2 pi: rows of pixels on a ramp of 0.7 rad a pixel."""
    Phi = start + 0.7 * torch.arange(24, dtype=torch.float64)
    phi = torch.remainder(Phi + math.pi, TWO_PI) - math.pi
    assert (phi.diff() < 0).sum() >= 2
    across = Weights().losses(
        Pixels.of(torch.ones(1, 1, 24, dtype=torch.bool)), (), (), phi, Phi, Phi
    )
    assert across["consistency"].item() < 1e-12
    down = Weights().losses(
        Pixels.of(torch.ones(1, 24, 1, dtype=torch.bool)), (), (), phi + 0.1 * Phi, Phi, Phi
    )
    assert down["consistency"].item() == pytest.approx(0.07**2, rel=1e-9)


def ramp(height, width, slope):
    """A ramp seen through blocks of 2 x 2 pixels, one in every 4 x 4: pairs go as the area."""
    u = torch.arange(width, dtype=torch.float64).expand(1, height, width)
    v = torch.arange(height).reshape(1, height, 1)
    return slope * u, (u.remainder(4) < 2) & (v.remainder(4) < 2)


@pytest.mark.parametrize("size", [(480, 640), (120, 160), (24, 32), (60, 12)])
def test_one_weight_of_eq_14_serves_every_size(size):
    Phi, mask = ramp(*size, 0.3)
    pixels = Pixels.of(mask)
    seen = Phi[mask]
    found = Weights().losses(pixels, (), (), seen, seen, seen)
    assert found["geometric"].item() == pytest.approx(640 * 480 / 16 * 2 * 0.3**2, rel=1e-9)
    averaged = Weights(mean=True).losses(pixels, (), (), seen, seen, seen)
    assert averaged["geometric"].item() == pytest.approx(0.3**2, rel=1e-9)  # across; down is flat


def gradient(method, outputs, truth, name="total"):
    outputs = outputs.clone().requires_grad_()
    method.losses(outputs, truth, GEOMETRY)[name].sum().backward()
    return outputs.grad


@pytest.mark.parametrize("wild", [math.nan, math.inf, 1e30])
@pytest.mark.parametrize("method", METHODS)
def test_what_lies_outside_the_mask_reaches_nothing(method, wild):
    truth, outputs = ideal()
    outputs = given_to(method, guess(outputs))
    outside = ~truth["mask"]
    clean, slopes = method.losses(outputs, truth, GEOMETRY), gradient(method, outputs, truth)
    assert (slopes.movedim(0, 2)[..., outside] == 0).all()
    dirty = {k: v.clone() for k, v in truth.items()}
    for name in ("M_r", "D_r", "phi_r", "Phi"):
        dirty[name][outside] = wild
    for name in "MD":
        dirty[name].movedim(0, 1)[:, outside] = wild
    spoilt = outputs.clone()
    spoilt.movedim(0, 2)[..., outside] = -wild
    for name, value in method.losses(spoilt, dirty, GEOMETRY).items():
        assert torch.equal(value, clean[name]), name
    assert torch.equal(gradient(method, spoilt, dirty), slopes)
    assert torch.isfinite(slopes).all()


@pytest.mark.parametrize("which", [0, 1])
def test_outputs_of_zero_have_finite_gradients(which):
    """A dead unit puts out M = D = 0, where the phase has no direction to turn to."""
    truth, outputs = ideal()
    outputs = guess(outputs)
    outputs[:, which] = 0
    assert torch.isfinite(gradient(SFNetMethod(), outputs, truth)).all()


def test_a_batch_is_its_images_one_by_one():
    truth, outputs = ideal(4)
    outputs = guess(outputs)
    together = SFNetMethod().losses(outputs, truth, GEOMETRY)
    for k in range(4):
        one = {n: v[k : k + 1] for n, v in truth.items()}
        for name, value in SFNetMethod().losses(outputs[k : k + 1], one, GEOMETRY).items():
            assert value.shape == (1,) and together[name].shape == (4,)
            torch.testing.assert_close(value[0], together[name][k], rtol=1e-12, atol=0)


def test_an_empty_mask_costs_nothing():
    truth, outputs = ideal(2)
    truth["mask"][0] = False
    outputs = guess(outputs)
    for value in SFNetMethod().losses(outputs, truth, GEOMETRY).values():
        assert value[0] == 0 and value[1] > 0
    truth["mask"][1] = False
    for value in SFNetMethod().losses(outputs, truth, GEOMETRY).values():
        assert (value == 0).all()
    assert (gradient(SFNetMethod(), outputs, truth) == 0).all()


def shares(outputs, truth, order):
    """Gradient of the last term of Eq. 12 in phi_h, times P: the other terms taken away."""
    method = SFNetMethod(weights=Weights(order=order))
    seen, number = truth["mask"], truth["mask"].sum()
    slopes = gradient(method, outputs, truth, "phase")
    targets = ideal(1)[1]
    rest = slopes - 2 * (outputs - targets) / number * seen
    low = rest[:, 1].movedim(1, 0)[:, seen]
    M, D = (outputs[:, 0, k][seen] for k in (0, 1))
    of_M, of_D = (number * rest[:, 0, k][seen] for k in (0, 1))
    return low, of_M * -D + of_D * M  # along the turn of phi_h, where M = -sin, D = cos


@pytest.mark.parametrize("order", [True, False])
def test_where_the_absolute_phase_pushes(order):
    """Not phi_r; phi_h by the whole error, wrong fringe orders included, or by its wrapped part."""
    truth, outputs = ideal(1)
    off = 0.2
    phi_h = truth["Phi"] + off
    phi_r = truth["Phi"] / RATIO
    phi_r[:, :2] += 1.2 * TWO_PI / RATIO  # the order is one too high in the upper rows
    outputs = torch.stack([torch.stack([-p.sin(), p.cos()], 1) for p in (phi_h, phi_r)], 1)
    found = SFNetMethod().absolute_phase(outputs, GEOMETRY) - truth["Phi"]
    k = ((found - off) / TWO_PI)[truth["mask"]]
    torch.testing.assert_close(k, k.round(), rtol=0, atol=1e-6)
    assert {0.0, 1.0} <= set(k.round().tolist())
    low, turned = shares(outputs, truth, order)
    assert low.abs().max() < 1e-15
    expected = 2 * (TWO_PI * k.round() + off) if order else torch.full_like(k, 2 * off)
    torch.testing.assert_close(turned, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("target", ["components", "phase"])
@pytest.mark.parametrize("order", [True, False])
def test_gradients_are_those_of_finite_differences(target, order):
    geometry = rig_of(GEOMETRY.Phi_min["zmin"][:3, :4])
    truth, outputs = ideal(2, (3, 4), geometry=geometry)
    method = SFNetMethod(target=target, weights=Weights(order=order, mean=True))
    outputs = given_to(method, guess(outputs, spread=0.3)).requires_grad_()

    def losses(given):
        return tuple(method.losses(given, truth, geometry).values())

    assert torch.autograd.gradcheck(losses, (outputs,), eps=1e-7, atol=1e-5, rtol=1e-5)


@pytest.fixture(scope="module")
def items(small_set):
    data = SynthFringe(small_set, "training")
    chosen = [data[k] for k in range(0, len(data), 5)]
    stacked = {k: torch.stack([item[k] for item in chosen]) for k in chosen[0]}
    return Geometry.of(data.store.system, data.pitches), stacked


def test_ideal_outputs_lead_to_the_decoders_phase(items):
    """M and D of the dataset through method, loss and decoder: one absolute phase."""
    geometry, batch = items
    high = torch.stack([batch["M"][:, 0], batch["D"][:, 0]], 1)
    outputs = torch.stack([high, torch.stack([batch["M_r"], batch["D_r"]], 1)], 1)
    Phi, mask = SFNetMethod().absolute_phase(outputs, geometry), batch["mask"]
    assert (Phi - batch["Phi"])[mask].abs().max() < 1e-3
    phi_h, phi_r = (-np.arctan2(x[:, 0], x[:, 1]) for x in outputs.double().numpy().swapaxes(0, 1))
    Phi_min = geometry.Phi_min["zmin"].double().numpy()
    decoded = two_phase_absolute(phi_h, phi_r, Phi_min, 24, 304)
    assert np.abs(Phi.numpy() - decoded)[mask].max() < 1e-4
    losses = SFNetMethod().losses(outputs, batch, geometry)
    assert losses["phase"].max() < 1e-6 and losses["consistency"].max() < 1e-6


def test_the_phase_itself_leads_there_too(items):
    geometry, batch = items
    high = -torch.atan2(batch["M"][:, 0], batch["D"][:, 0])
    outputs = torch.stack([high, batch["phi_r"]], 1)[:, :, None]
    method = SFNetMethod(target="phase")
    assert (method.absolute_phase(outputs, geometry) - batch["Phi"])[
        batch["mask"]
    ].abs().max() < 1e-3
    assert method.losses(outputs, batch, geometry)["phase"].max() < 1e-6


def test_one_photograph_is_not_enough(items):
    """The control: phi_h with the minimum phase at the high pitch has mostly wrong orders."""
    geometry, batch = items
    phi_h = -torch.atan2(batch["M"][:, 0], batch["D"][:, 0])
    e = (geometry.from_one_phase(phi_h) - batch["Phi"])[batch["mask"]]
    assert ((e / TWO_PI) - (e / TWO_PI).round()).abs().max() < 1e-4  # whole orders
    assert (e.abs() > math.pi).float().mean() > 0.5
    lowest = geometry.Phi_min["high"][batch["mask"].nonzero()[:, 1], batch["mask"].nonzero()[:, 2]]
    inside = geometry.from_one_phase(phi_h)[batch["mask"]] - lowest
    assert inside.min() > -1e-3 and inside.max() < TWO_PI + 1e-3


@pytest.mark.parametrize(
    "frames, shifts", [(1, [0]), (2, [0, math.pi / 2]), (3, [0, TWO_PI / 3, 2 * TWO_PI / 3])]
)
def test_photographs_of_a_method(frames, shifts, small_set):
    method = SFNetMethod(frames=frames, base=2, levels=2)
    names = [name for name, _, _ in method.photographs]
    assert names == ["high"] * frames + ["zmin"] * frames
    found = [TWO_PI * n / steps for _, steps, n in method.photographs]
    assert found == pytest.approx(shifts * 2)
    item = SynthFringe(small_set, "training", method.photographs)[0]
    assert method.network()(item["frames"][None]).shape == (1, 2, 2, 120, 160)
