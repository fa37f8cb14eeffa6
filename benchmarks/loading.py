"""How fast a dataset feeds training: images a second of the loader, and of a training step."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

import torch
from torch.utils.data import DataLoader

from benchmarks.networks import training_seconds
from fpputil.dataset.augmentation import Augmentation
from fpputil.dataset.generation import generate
from fpputil.dataset.models import seeded_models
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.learning.devices import bfloat16_unit
from fpputil.networks.methods import SFNetMethod

BATCH = 8


def loading_images_a_second(data: SynthFringe, images: int) -> float:
    """Images a second of a loader with two workers, augmentation included."""
    loader = DataLoader(data, BATCH, shuffle=True, num_workers=2, persistent_workers=True)
    seen, start = -len(data), 0.0
    while seen < images:
        for batch in loader:
            seen += len(batch["index"])
        start = start or time.perf_counter()  # the first epoch starts the workers
    return seen / (time.perf_counter() - start)


def bench_loading(preset_name: str, images: int, repeats: int) -> dict:
    """Loader against training step at a preset."""
    how = Augmentation(gain=(0.7, 1.2), noise=(0.5, 2.0))
    with tempfile.TemporaryDirectory() as folder:
        models, _ = seeded_models(6, 0)
        generate(Path(folder) / "set", preset_name, models, views=12)
        data = SynthFringe(Path(folder) / "set", "training", augmentation=how)
        loading = loading_images_a_second(data, images)
        batch = next(iter(DataLoader(data, BATCH)))
        unit = bfloat16_unit(torch.device("cpu"))
        precision = "bfloat16" if unit else "float32"
        (seconds,) = training_seconds(data, batch, [precision], repeats)
    training = BATCH / seconds
    return {
        "loader_images_a_second": loading,
        "training_images_a_second": training,
        "loader_over_training": loading / training,
        "bfloat16": unit,
        "parameters": sum(p.numel() for p in SFNetMethod().network().parameters()),
        "load_average": os.getloadavg()[0],
    }
