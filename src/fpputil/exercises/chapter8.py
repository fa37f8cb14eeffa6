"""Exercises of chapter 8: SFNet."""

from __future__ import annotations

import numpy as np
import torch

from fpputil.decoding.unwrap import wrap
from fpputil.exercises import exercise
from fpputil.networks.unet import Encoder


@exercise(
    "8.1",
    "a 3 x 3 convolution from a to b channels has 9 a b + b; the channels are 8, 16, ..., 256.",
    "two convolutions a level, from the channels of the level above to its own, then within it.",
)
def weights_of_an_encoder():
    encoder = Encoder(1, [8 * 2**k for k in range(6)])
    return sum(p.numel() for p in encoder.parameters())


@exercise(
    "8.2",
    "choose first, compute afterwards.",
    "values[mask].mean(): the gradient outside the mask is then 0.",
)
def mean_inside(answer):
    """masked_mean(values, mask)"""
    values = torch.tensor([[1.0, torch.nan, 4.0], [3.0, torch.inf, -2.0]], requires_grad=True)
    mask = torch.tensor([[True, False, True], [True, False, False]])
    mean = answer(values, mask)
    mean.backward()
    yield mean.item(), 8 / 3
    yield values.grad, mask.numpy() / 3


@exercise(
    "8.3",
    "the reference is scaled by the ratio of the pitches, and rounding forgives half a period.",
    "pi * 15 / 304 and pi * 24 / 304.",
    unit="rad",
)
def room_of_the_reference():
    return np.pi * np.array([15, 24]) / 304


@exercise(
    "8.4",
    "wrap the difference of the differences, not each of them.",
    "mean(wrap(diff(phi) - diff(Phi))^2).",
)
def difference_of_gradients(answer):
    """consistency(phi, Phi)"""
    rng = np.random.default_rng(0)
    Phi = np.cumsum(rng.uniform(-4, 6, 50))
    error = 0.3 * rng.standard_normal(50)
    yield answer(wrap(Phi + error), Phi), np.mean(np.diff(error) ** 2)
