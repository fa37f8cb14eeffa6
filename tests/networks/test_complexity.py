"""Cost against counts by hand; the figure of the book against a forward pass."""

import re
import runpy
from pathlib import Path

import pytest
import torch

from fpputil.networks import SFNet, SFNetMethod, cost
from fpputil.networks.sfnet import MIXING

BOOK = Path(__file__).parents[2] / "book"


def small(mixing="deepest", **options):
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
    spent = cost(small(mixing), (8, 8))
    assert spent.parameters == 2 * sum(weights + biases for weights, biases, _ in layers)
    assert spent.multiply_adds == 2 * sum(weights * pixels for weights, _, pixels in layers)


def test_padding_costs_too_and_the_network_stays_as_it_was():
    network = small().train()
    assert cost(network, (7, 5)) == cost(network, (8, 6)) != cost(network, (8, 8))
    assert network.training and all(p.grad is None for p in network.parameters())


def test_the_figure_of_the_book_is_what_its_script_writes(tmp_path):
    """But for the names of clips; and its labels are the shapes that hooks of a pass see."""
    runpy.run_path(BOOK / "figures/architecture.py")["write"](tmp_path / "sfnet.svg")
    pictures = [(folder / "sfnet.svg").read_text() for folder in (tmp_path, BOOK / "assets")]
    again, written = (re.sub("p[0-9a-f]{10}", "p", picture) for picture in pictures)
    assert again == written
    network, shapes = SFNetMethod().network().eval(), set()
    for level in (*network.encoders[0].levels, *network.decoders[1].levels):
        level.register_forward_hook(lambda _, x, y: shapes.add(tuple(y.shape[1:])))
    network.decoders[0].register_forward_pre_hook(lambda _, x: shapes.add(tuple(x[0].shape[1:])))
    with torch.no_grad():
        network(torch.zeros(1, 2, 120, 160))
    labels = re.findall(r"(\d+) × (\d+) × (\d+)", written)
    labels = {tuple(map(int, label)) for label in labels}
    assert shapes <= labels <= shapes | {(1, 128, 160), (2, 128, 160)}
