"""What SFNet costs: a step of training, a measurement, each in 32 and in 16 bit."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import DataLoader

from benchmarks.timing import median_seconds
from fpputil.dataset.generation import generate
from fpputil.dataset.models import seeded_models
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.decoding.decoder import decode
from fpputil.learning.devices import PRECISIONS, bfloat16_unit, forward
from fpputil.learning.evaluation import predict_batch
from fpputil.learning.weights import Trained
from fpputil.networks.geometry import Geometry
from fpputil.networks.methods import SFNetMethod
from fpputil.networks.unet import lowered
from fpputil.optics.fringes import fringe_set
from fpputil.optics.system import preset

FRAMES_A_SECOND = 100  # of the camera
CPU = torch.device("cpu")


def training_seconds(data: SynthFringe, batch: dict, precisions, repeats: int) -> list[float]:
    """Median seconds of forward, losses, backward and update; the precisions take turns."""
    method, geometry = SFNetMethod(), Geometry.of(data.store.system, data.pitches)
    torch.manual_seed(0)
    network = method.network().to(memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(network.parameters(), 1e-4)

    def step(precision):
        outputs = forward(network, batch["frames"], precision)
        optimiser.zero_grad()
        method.losses(outputs, batch, geometry)["total"].mean().backward()
        optimiser.step()

    return median_seconds(*(lambda p=p: step(p) for p in precisions), repeats=repeats)


def bench_training(repeats: int = 15) -> dict:
    """A step at `tiny`, batch 8, base 8, in 32 and 16 bit."""
    with tempfile.TemporaryDirectory() as folder:
        generate(Path(folder) / "set", "tiny", seeded_models(3, 0)[0], views=8)
        data = SynthFringe(Path(folder) / "set", "training")
        batch = next(iter(DataLoader(data, 8)))
        single, half = training_seconds(data, batch, PRECISIONS, repeats)
    return {
        "float32_seconds": single,
        "bfloat16_seconds": half,
        "faster": single / half,
        "bfloat16_unit": bfloat16_unit(CPU),
        "threads": torch.get_num_threads(),
    }


def bench_measuring(base: int = 16, repeats: int = 7) -> dict:
    """Two photographs of 640 x 480 to an absolute phase, against forty-five."""
    p = preset("paper")
    geometry = Geometry.of(p.system, p.pitches)
    method = SFNetMethod(base=base)
    network = method.network().to(memory_format=torch.channels_last).eval()
    trained = [Trained(method, lowered(network, dtype)) for dtype in PRECISIONS.values()]
    two = np.random.default_rng(0).random((1, 2, 480, 640), np.float32)
    many = np.random.default_rng(0).integers(0, 255, (45, 480, 640), np.uint8)
    fringes = fringe_set(p.pitches.descending)
    ways = [lambda t=t: predict_batch(t, two, geometry) for t in trained]
    single, half, classical = median_seconds(
        *ways, lambda: decode(many, fringes, 912), repeats=repeats
    )
    shots_two, shots_many = (n / FRAMES_A_SECOND for n in (2, 45))
    return {
        "float32_seconds": single,
        "bfloat16_seconds": half,
        "faster": single / half,
        "decoder_seconds": classical,
        "two_photographs_seconds": shots_two + min(single, half),
        "forty_five_photographs_seconds": shots_many + classical,
        "forty_five_over_two": (shots_many + classical) / (shots_two + min(single, half)),
        "bfloat16_unit": bfloat16_unit(CPU),
        "threads": torch.get_num_threads(),
    }
