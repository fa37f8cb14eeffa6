"""How fast a dataset feeds training: images a second of the loader, and of a training step."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

import torch
from torch import nn
from torch.utils.data import DataLoader

from fpputil.learning.generate import generate
from fpputil.learning.plan import seeded_models
from fpputil.learning.synthfringe import Augmentation, SynthFringe

BATCH, LEVELS, BASE = 8, 6, 8


def convolutions(before: int, after: int) -> nn.Sequential:
    """Two 3 x 3 convolutions with ReLU."""
    pairs = [(before, after), (after, after)]
    return nn.Sequential(*(m for i, o in pairs for m in (nn.Conv2d(i, o, 3, padding=1), nn.ReLU())))


class TwoEncoders(nn.Module):
    """A stand-in of the size of the paper's network: what matters here is its cost."""

    def __init__(self):
        super().__init__()
        widths = [BASE * 2**k for k in range(LEVELS)]
        pairs = list(zip([1, *widths], widths, strict=False))
        self.down = nn.ModuleList(nn.ModuleList(convolutions(*p) for p in pairs) for _ in range(2))
        back = widths[::-1]
        ups = list(zip([2 * back[0], *back[1:]], back[1:], strict=False))
        self.up = nn.ModuleList(
            nn.ModuleList(nn.ConvTranspose2d(i, o, 2, stride=2) for i, o in ups) for _ in range(2)
        )
        self.mix = nn.ModuleList(
            nn.ModuleList(convolutions(2 * o, o) for _, o in ups) for _ in range(2)
        )
        self.out = nn.ModuleList(nn.Conv2d(BASE, 2, 1) for _ in range(2))

    def forward(self, frames):
        skips, ends = [], []
        for k, levels in enumerate(self.down):
            x, kept = frames[:, k : k + 1], []
            for n, level in enumerate(levels):
                x = level(nn.functional.max_pool2d(x, 2) if n else x)
                kept.append(x)
            skips.append(kept)
            ends.append(x)
        outputs = []
        for k in range(2):
            x = torch.cat(ends, 1)
            for up, mix, skip in zip(self.up[k], self.mix[k], skips[k][-2::-1], strict=True):
                x = mix(torch.cat([up(x), skip], 1))
            outputs.append(self.out[k](x))
        return torch.cat(outputs, 1)


def bfloat16_unit() -> bool:
    """Whether the processor multiplies bfloat16 matrices (AMX)."""
    info = Path("/proc/cpuinfo")
    return info.exists() and "amx_bf16" in info.read_text()


def training_images_a_second(batch: dict, repeats: int) -> float:
    """Images a second of forward, loss, backward and update, two threads."""
    torch.manual_seed(0)
    net = TwoEncoders().to(memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(net.parameters())
    height, width = (-n % 2 ** (LEVELS - 1) for n in batch["frames"].shape[-2:])
    frames = nn.functional.pad(batch["frames"], (0, width, 0, height))
    frames = frames.to(memory_format=torch.channels_last)
    target = torch.stack([batch["M"][:, 0], batch["D"][:, 0], batch["M_r"], batch["D_r"]], 1)
    h, w = target.shape[-2:]
    for n in range(repeats + 1):
        if n <= 1:  # the first step is a warm-up
            start = time.perf_counter()
        with torch.autocast("cpu", torch.bfloat16, enabled=bfloat16_unit()):
            output = net(frames)[..., :h, :w]
        loss = ((output.float() - target) ** 2).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return repeats * len(frames) / (time.perf_counter() - start)


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
    training = training_images_a_second(batch, repeats)
    return {
        "loader_images_a_second": loading,
        "training_images_a_second": training,
        "loader_over_training": loading / training,
        "bfloat16": bfloat16_unit(),
        "parameters": sum(p.numel() for p in TwoEncoders().parameters()),
        "load_average": os.getloadavg()[0],
    }
