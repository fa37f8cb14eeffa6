"""Checkers of chapter 8: SFNet."""

from __future__ import annotations

import numpy as np
import torch

from fpputil.decoding.unwrap import wrap
from fpputil.exercises import close, exercise
from fpputil.networks.unet import Encoder


@exercise(
    "8.1", "Two convolutions a level; the first of each takes the channels of the level above."
)
def weights_of_an_encoder(answer) -> bool:
    encoder = Encoder(1, [8 * 2**k for k in range(6)])
    return answer == sum(p.numel() for p in encoder.parameters())


@exercise("8.2", "Index by the mask before any arithmetic; the gradient outside it is then 0.")
def mean_inside(answer) -> bool:
    values = torch.tensor([[1.0, torch.nan, 4.0], [3.0, torch.inf, -2.0]], requires_grad=True)
    mask = torch.tensor([[True, False, True], [True, False, False]])
    mean = answer(values, mask)
    mean.backward()
    return close(mean.item(), 8 / 3) and close(values.grad, mask.numpy() / 3)


@exercise("8.3", "Half a period of the high pitch, scaled back: pi times the ratio of the pitches.")
def room_of_the_reference(answer) -> bool:
    return close(answer, (np.pi * 15 / 304, np.pi * 24 / 304))


@exercise(
    "8.4", "Wrap the difference of the two gradients; a truth steeper than pi a pixel is fine."
)
def difference_of_gradients(answer) -> bool:
    rng = np.random.default_rng(0)
    Phi = np.cumsum(rng.uniform(-4, 6, 50))
    error = 0.3 * rng.standard_normal(50)
    return close(answer(wrap(Phi + error), Phi), np.mean(np.diff(error) ** 2))
