"""Cost against counts by hand; the figure against the settings, and its labels against overlap."""

import itertools

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from matplotlib.path import Path

from fpputil.networks.complexity import cost, trace
from fpputil.networks.drawing import draw
from fpputil.networks.sfnet import MIXING, SFNet


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    plt.close("all")


def small(mixing="deepest", **options):
    torch.manual_seed(0)
    return SFNet(**{"base": 2, "levels": 2, "mixing": mixing, **options})


@pytest.mark.parametrize("mixing", MIXING)
def test_parameters_and_multiply_adds_by_hand(mixing):
    """Two levels of 2 and 4 channels on 8 x 8 and 4 x 4 pixels, both halves alike."""
    bottom = 4 if mixing == "none" else 8
    skip = 4 if mixing == "every level" else 2
    encoder = [(9 * 1 * 2, 2, 64), (9 * 2 * 2, 2, 64), (9 * 2 * 4, 4, 16), (9 * 4 * 4, 4, 16)]
    up = (4 * bottom * 2, 2, 16)  # 2 x 2 weights at every pixel that comes in
    decoder = [(9 * (2 + skip) * 2, 2, 64), (9 * 2 * 2, 2, 64), (2 * 2, 2, 64)]
    layers = [*encoder, up, *decoder]  # weights, biases, pixels
    found = cost(small(mixing), (8, 8))
    assert found.parameters == 2 * sum(weights + biases for weights, biases, _ in layers)
    assert found.multiply_adds == 2 * sum(weights * pixels for weights, _, pixels in layers)


@pytest.mark.parametrize("options", [{"base": 3, "levels": 3}, {"frames": (3, 2), "outputs": 1}])
def test_parameters_are_those_of_the_network(options):
    network = small(**options)
    assert cost(network, (8, 8)).parameters == sum(p.numel() for p in network.parameters())


def test_padding_costs_too():
    assert cost(small(), (7, 5)) == cost(small(), (8, 6)) != cost(small(), (8, 8))


def test_maps_of_one_pass():
    high, low = trace(small("every level", frames=(1, 3), levels=3), (8, 12))
    assert (high.input, low.input) == ((1, 8, 12), (3, 8, 12))
    for half in (high, low):
        assert half.encoder == [(2, 8, 12), (4, 4, 6), (8, 2, 3)]
        assert half.deepest == (16, 2, 3)
        assert half.skips == [(4, 8, 12), (8, 4, 6)]
        assert half.up == half.decoder == [(2, 8, 12), (4, 4, 6)]
        assert half.output == (2, 8, 12)


def drawn(ax, gid):
    return [a for a in ax.get_children() if a.get_gid() == gid]


@pytest.mark.parametrize("mixing", MIXING)
@pytest.mark.parametrize("levels", [2, 4, 6])
def test_numbers_of_what_is_drawn(mixing, levels):
    ax = draw(small(mixing, levels=levels), (32, 64))
    joined = mixing != "none"
    skips = 2 * (levels - 1)
    assert len(drawn(ax, "map")) == 2 * (1 + levels + 2 * (levels - 1) + 1) + joined
    assert len(drawn(ax, "skip")) == skips
    assert len(drawn(ax, "crossing")) == (skips if mixing == "every level" else 0)
    middle = 4 if joined else 2
    assert len(drawn(ax, "way")) == 2 * (levels + 2 * (levels - 1)) + middle


def test_blocks_and_labels_follow_the_maps():
    ax = draw(small(levels=3, base=8), (16, 24))
    labels = " ".join(t.get_text() for t in drawn(ax, "label"))
    for shape in ("1 × 16 × 24", "8 × 16 × 24", "16 × 8 × 12", "32 × 4 × 6", "64 × 4 × 6"):
        assert shape in labels
    blocks = {(round(b.get_width(), 3), round(b.get_height(), 3)) for b in drawn(ax, "map")}
    widths, heights = (sorted(set(side)) for side in zip(*blocks, strict=True))
    np.testing.assert_allclose(np.divide(widths[3:], widths[2:-1]), 2**0.5, rtol=0.02)
    np.testing.assert_allclose(np.divide(heights[1:], heights[:-1]), 2**0.4, rtol=0.02)


SIZES = [
    ({"base": 8, "levels": 6}, (120, 160)),
    ({"base": 12, "levels": 5, "frames": (3, 3)}, (48, 64)),
    ({"base": 32, "levels": 4, "outputs": 1}, (24, 32)),
    ({"base": 2, "levels": 2}, (8, 8)),
]


@pytest.mark.parametrize("mixing", MIXING)
@pytest.mark.parametrize("options, size", SIZES)
def test_labels_lie_on_the_page_and_on_nothing_else(mixing, options, size):
    ax = draw(small(mixing, **options), size)
    figure = ax.figure
    figure.canvas.draw()
    assert figure.get_figwidth() == 8
    texts = [t.get_window_extent() for t in drawn(ax, "label")] + [
        ax.get_legend().get_window_extent()
    ]
    blocks = [b.get_window_extent() for b in drawn(ax, "map")]
    for box in texts + blocks:
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
    for arrow in drawn(ax, "way") + drawn(ax, "skip") + drawn(ax, "crossing"):
        path = arrow.get_transform().transform_path(arrow.get_path())
        drawn_on = path.codes != Path.CLOSEPOLY  # of the heads; its own vertex is a filler
        line = Path(path.vertices[drawn_on], path.codes[drawn_on])
        assert not any(line.intersects_bbox(box, filled=False) for box in texts)
    for a, b in itertools.combinations(texts, 2):
        assert not a.overlaps(b)
    for a, b in itertools.product(texts, blocks):
        assert not a.overlaps(b)
    for a, b in itertools.combinations(blocks, 2):
        assert not a.overlaps(b)


def test_a_given_axes_is_drawn_on():
    _, ax = plt.subplots(figsize=(8, 6))
    assert draw(small(), (8, 8), ax) is ax
    assert len(drawn(ax, "map")) == 2 * 6 + 1


def test_the_network_is_left_as_it_was():
    network = small(levels=3)
    network.train()
    network.encoders[1].eval()
    before = {k: v.clone() for k, v in network.state_dict().items()}
    draw(network, (8, 8))
    assert not any(m._forward_hooks or m._forward_pre_hooks for m in network.modules())
    assert network.training and network.decoders[0].training and not network.encoders[1].training
    for name, value in network.state_dict().items():
        torch.testing.assert_close(value, before[name], rtol=0, atol=0)
    assert all(p.grad is None for p in network.parameters())


@pytest.mark.parametrize("size, says", [((0, 8), "height 0"), ((8, 2.5), "width 2.5")])
@pytest.mark.parametrize("measure", [cost, trace, draw])
def test_bad_sizes(measure, size, says):
    with pytest.raises(ValueError, match=says):
        measure(small(), size)
