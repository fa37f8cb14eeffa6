"""The network: shapes, sizes by a formula of one's own, and who sees which photograph."""

import math

import pytest
import torch
from torch import nn

from fpputil.learning.devices import forward
from fpputil.networks.sfnet import MIXING, SFNet
from fpputil.networks.unet import Encoder, UNet, lowered, padded


def sfnet(seed=0, **options):
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return SFNet(**{"base": 3, "levels": 3, **options}).eval()


def photographs(*shape, seed=0):
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed))


def convolutions(part):
    return [layer for layer in part.modules() if isinstance(layer, nn.Conv2d)]


@pytest.mark.parametrize(
    "size, levels",
    [((13, 17), 3), ((120, 160), 6), ((1, 1), 2), ((8, 9), 4), ((31, 32), 6)],
)
@pytest.mark.parametrize("frames, outputs", [((1, 1), 2), ((2, 3), 1)])
def test_any_size_goes_in_and_comes_out(size, levels, frames, outputs):
    network = sfnet(levels=levels, base=1, frames=frames, outputs=outputs)
    assert network(photographs(2, sum(frames), *size)).shape == (2, 2, outputs, *size)


def test_an_encoder_has_twelve_convolutions_and_doubling_channels():
    network = sfnet(base=8, levels=6, frames=(1, 3))
    for encoder, frames in zip(network.encoders, (1, 3), strict=True):
        layers = convolutions(encoder)
        assert len(layers) == 12
        assert {(c.kernel_size, c.stride, c.padding) for c in layers} == {((3, 3), (1, 1), (1, 1))}
        assert [c.out_channels for c in layers] == [8 * 2 ** (k // 2) for k in range(12)]
        assert layers[0].in_channels == frames


def parameters(base, levels, mixing, frames=(1, 1), outputs=2):
    """Weights and biases, layer by layer."""

    def pair(before, after):
        return 9 * before * after + after + 9 * after * after + after

    total = 0
    for n in frames:
        for k in range(levels):
            total += pair(n if k == 0 else base * 2 ** (k - 1), base * 2**k)
        below = base * 2 ** (levels - 1) * (1 if mixing == "none" else 2)
        for k in reversed(range(levels - 1)):
            width = base * 2**k
            total += 4 * below * width + width
            total += pair(width + width * (2 if mixing == "every level" else 1), width)
            below = width
        total += base * outputs + outputs
    return total


@pytest.mark.parametrize("mixing", MIXING)
@pytest.mark.parametrize("base, levels, outputs", [(8, 6, 2), (3, 2, 1), (4, 4, 2)])
def test_number_of_parameters(mixing, base, levels, outputs):
    network = sfnet(base=base, levels=levels, mixing=mixing, outputs=outputs)
    found = sum(p.numel() for p in network.parameters())
    assert found == parameters(base, levels, mixing, outputs=outputs)


def test_the_networks_of_the_book():
    """Six levels: 4.15 million at base 8, four times as many at base 16."""
    assert parameters(8, 6, "deepest") == 4_151_652
    assert sum(p.numel() for p in SFNet().parameters()) == 4_151_652
    assert sum(p.numel() for p in SFNet(base=16).parameters()) == parameters(16, 6, "deepest")


def test_padding_is_zeros_right_and_below_and_cropped_again():
    network, frames = sfnet(levels=4), photographs(2, 2, 13, 17)
    room = torch.zeros(2, 2, 16, 24)
    room[..., :13, :17] = frames
    assert torch.equal(padded(frames, 8), room)
    assert torch.equal(network(frames), network(room)[..., :13, :17])
    assert torch.equal(padded(room, 8), room)
    unet = UNet(2, (3,), base=3, levels=4, dropout=0.0).eval()
    assert torch.equal(unet(frames)[0], unet(room)[0][..., :13, :17])


@pytest.mark.parametrize("mixing", MIXING)
def test_who_sees_which_photograph(mixing):
    """Without mixing each output hangs on its own photographs alone, with it on both."""
    network, frames = sfnet(mixing=mixing, frames=(2, 1)), photographs(1, 3, 16, 16)
    other_low, other_high = frames.clone(), frames.clone()
    other_low[:, 2] = 1 - other_low[:, 2]
    other_high[:, 1] = 1 - other_high[:, 1]
    before = network(frames)
    same = [torch.equal(before[:, 0], network(other_low)[:, 0]),
            torch.equal(before[:, 1], network(other_high)[:, 1])]  # fmt: skip
    assert same == [mixing == "none"] * 2
    assert not torch.equal(before[:, 1], network(other_low)[:, 1])
    assert not torch.equal(before[:, 0], network(other_high)[:, 0])


def test_every_level_mixes_finer_than_the_deepest():
    """With the deepest features taken away, only "every level" still sees the other photograph."""
    frames = photographs(1, 2, 16, 16)
    other = frames.clone()
    other[:, 1] = 1 - other[:, 1]
    for mixing, sees in (("deepest", False), ("every level", True)):
        network = sfnet(mixing=mixing)
        network.dropout = nn.Module()
        network.dropout.forward = torch.zeros_like
        assert torch.equal(network(frames)[:, 0], network(other)[:, 0]) is not sees


def test_dropout_in_training_alone():
    frames = photographs(1, 2, 16, 16)
    network = sfnet(dropout=0.5)
    calm = network(frames)
    assert torch.equal(calm, network(frames))
    torch.manual_seed(0)
    network.train()
    first, second = network(frames), network(frames)
    assert not torch.equal(first, second)
    torch.manual_seed(0)
    assert torch.equal(first, network(frames))
    without = sfnet(dropout=0.0).train()
    assert torch.equal(without(frames), calm)


def test_outputs_are_float32_under_bfloat16_and_near_those_of_float32():
    network, frames = sfnet(base=4), photographs(1, 2, 16, 16)
    seen = []
    network.decoders[0].out.register_forward_hook(
        lambda _, given, out: seen.append((given[0], out))
    )
    with torch.autocast("cpu", torch.bfloat16):
        lower = network(frames)
    assert lower.dtype == torch.float32
    assert seen[0][0].dtype == seen[0][1].dtype == torch.float32
    exact = network(frames)
    assert 0 < (lower - exact).abs().max() < 0.05 * exact.abs().max()


def test_a_lowered_network_measures_like_autocast_and_leaves_the_first_as_it_was():
    network, frames = sfnet(base=4), photographs(1, 2, 16, 16)
    lower = lowered(network, torch.bfloat16)
    kept = {k for k, v in lower.state_dict().items() if v.dtype == torch.float32}
    ends = ("weight", "bias")
    assert kept == {f"decoders.{k}.out.{end}" for k in range(2) for end in ends}
    assert all(p.dtype == torch.float32 for p in network.parameters())
    with torch.no_grad():
        cast, own = forward(network, frames, "bfloat16"), forward(lower, frames, "float32")
        exact = forward(network, frames, "float32")
        assert torch.equal(forward(lower, frames, "bfloat16"), own)
    assert own.dtype == torch.float32
    assert 0 < (own - exact).abs().max() < 0.05 * exact.abs().max()
    assert (own - cast).abs().max() < 0.02 * exact.abs().max()


def test_every_parameter_gets_a_gradient():
    network = sfnet(mixing="every level", frames=(2, 2)).train()
    network(photographs(2, 4, 16, 16)).square().sum().backward()
    assert all(p.grad.abs().max() > 0 for p in network.parameters())


def test_first_weights_are_the_seeds_and_as_wide_as_he_says():
    a, b, c = sfnet(1, base=16), sfnet(1, base=16), sfnet(2, base=16)
    assert all(torch.equal(p, q) for p, q in zip(a.parameters(), b.parameters(), strict=True))
    assert not torch.equal(a.encoders[0].levels[0][0].weight, c.encoders[0].levels[0][0].weight)
    for layer in convolutions(a):
        fan_in = layer.in_channels * layer.kernel_size[0] ** 2
        if layer.weight.numel() > 2000:
            assert layer.weight.std().item() == pytest.approx(math.sqrt(2 / fan_in), rel=0.07)
        assert (layer.bias == 0).all()


def test_an_encoder_halves_by_the_greatest_of_four():
    """Max-pooling, not averages: with convolutions that copy, the greatest come out."""
    encoder = Encoder(1, [1, 1])
    with torch.no_grad():
        for layer in convolutions(encoder):
            layer.weight.zero_()[0, 0, 1, 1] = 1
            layer.bias.zero_()
    x = photographs(1, 1, 6, 8)
    fine, coarse = encoder(x)
    assert torch.equal(fine, x)
    assert torch.equal(coarse, x.reshape(1, 1, 3, 2, 4, 2).amax((3, 5)))
