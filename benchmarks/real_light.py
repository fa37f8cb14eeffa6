"""The fine phase of one photograph on real light: a network beside Fourier transform profilometry.

A U-Net learns numerator and denominator of one photograph from simulated scenes, whose projector,
camera, surface and ground are drawn at random, and is tried on photographs that nobody simulated,
against the phase of all steps. The scenes are those of tests/capture/test_captures.py, at
``../shared/captures`` or where FPP_CAPTURES says; they are not part of the project, what was
measured on them is: ``python -m benchmarks.real_light`` writes data/results/real-light.json.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
import trimesh
from scipy.ndimage import gaussian_filter

from fpputil.capture import Patterns, open_capture
from fpputil.decoding import fourier_phase, mw_tpu, wrap
from fpputil.decoding.phase import THRESHOLD, modulation, numerator_denominator, wrapped_phase
from fpputil.files import write_whole
from fpputil.learning.devices import forward, hardware, precision_of
from fpputil.networks.unet import UNet
from fpputil.optics import fringe_set, preset, raycast, shapes
from fpputil.optics.parts import part

ROOT = Path(__file__).parents[1]
CAPTURES = Path(os.environ.get("FPP_CAPTURES", ROOT.parent / "shared" / "captures"))
SCENES, PITCHES, STEPS = ("david", "bottle"), (14, 15, 16), 12
PATTERNS = Patterns(
    (1000, 1000), fringe_set(PITCHES, STEPS), "mw", files="period{pitch}_step{step:02}.png"
)
CLASSES = (10, 30, 60, 90, 256)  # limits of modulation, grey levels
CROP, BATCH, RATE = 160, 8, 2e-3
WIDTHS = (0.7, 1.0, 1.3)  # windows of the Fourier transform; the best one counts


class Scene(NamedTuple):
    """Projector column and shade (H, W) of a body in front of a wall; NaN and 0 where unlit."""

    column: np.ndarray
    shade: np.ndarray


def scene(seed: int) -> Scene:
    """A machine part of any size and pose before a wall at any angle, seen at 640 x 480."""
    rng = np.random.default_rng((seed, 0))
    turn = shapes.rotation(*rng.uniform(0, 360, 2))
    centre = (*rng.uniform(-60, 60, 2), rng.uniform(560, 680))
    body = shapes.place(part(seed), rng.uniform(80, 400), centre, turn)
    z = rng.uniform(750, 1000)
    wall = shapes.plane(z, 1500.0)
    tilt = shapes.rotation(rng.uniform(-30, 30), 0) @ shapes.rotation(0, rng.uniform(-40, 40))
    wall.vertices = (wall.vertices - (0, 0, z)) @ tilt.T + (0, 0, z)
    albedo = np.repeat(rng.uniform(0.3, 1, 2), (len(body.faces), len(wall.faces)))
    both = trimesh.util.concatenate([body, wall])
    view = raycast(both, preset("paper").system, albedo=albedo, white_at=rng.uniform(450, 900))
    return Scene(view.column, view.shade)


def photograph(scene: Scene, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """A photograph (H, W), 0 to 1, its phase, and where it has a modulation to speak of.

    Drawn: pitch and shift; the projector's power and focus; exposure, ambient and stray light;
    blotches on the surfaces; blur and noise of the camera.
    """
    column, shade = np.nan_to_num(scene.column), scene.shade
    pitch = np.exp(rng.uniform(np.log(14), np.log(60)))  # 9 to 39 camera pixels
    phi = 2 * np.pi * (column / pitch + rng.uniform())
    contrast, gamma = rng.uniform(0.5, 1), np.exp(rng.uniform(np.log(0.6), np.log(2)))
    light = (1 - contrast) / 2 + contrast * (0.5 + 0.5 * np.cos(phi)) ** gamma
    if rng.uniform() < 0.7:
        blotches = gaussian_filter(rng.standard_normal(shade.shape), rng.uniform(1, 12))
        dark = blotches > rng.uniform(0, 2) * blotches.std()
        shade = shade * (1 - rng.uniform(0.1, 0.8) * gaussian_filter(dark.astype(float), 0.7))
    gain = rng.uniform(0.4, 1.1) / np.quantile(shade, 0.98)
    image = 255 * gain * shade * light
    image += rng.uniform(0, 0.15) * gaussian_filter(image, 30) + rng.uniform(0, 30)
    image = gaussian_filter(image, rng.uniform(0.01, 1.2))
    image += rng.uniform(0.3, 3) * rng.standard_normal(image.shape)
    seen = 255 / 2 * gain * shade * contrast > THRESHOLD
    return np.rint(image.clip(0, 255)).astype(np.float32) / 255, phi.astype(np.float32), seen


def crops(scenes: list[Scene], number: int, seed: int):
    """Batches of photographs (B, 1, CROP, CROP), cos and -sin of their phases, and masks."""
    for first in range(0, number, BATCH):
        items = []
        for k in range(first, first + BATCH):
            rng = np.random.default_rng((seed, 1, k))
            column, shade = scenes[rng.integers(len(scenes))]
            v, u = (rng.integers(side - CROP + 1) for side in shade.shape)
            at = np.s_[v : v + CROP, u : u + CROP]
            if shade[at].max() == 0:
                at = np.s_[-CROP:, :CROP]
            items.append(photograph(Scene(column[at], shade[at] + 1e-6), rng))
        images, phis, masks = (torch.as_tensor(np.stack(a)) for a in zip(*items, strict=True))
        yield images[:, None], torch.stack([-phis.sin(), phis.cos()], 1), masks


def train(scenes: list[Scene], images: int, base: int, seed: int) -> UNet:
    """A U-Net of one photograph to numerator and denominator, by their mean squared error."""
    torch.manual_seed(seed)
    network = UNet(1, (2,), base, 5, 0.0).to(memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(network.parameters(), RATE)
    cycle = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, images // BATCH, pct_start=0.15)
    precision = precision_of("auto", torch.device("cpu"))
    for step, (frames, targets, masks) in enumerate(crops(scenes, images // BATCH * BATCH, seed)):
        error = (forward(network, frames, precision)[0] - targets) ** 2
        loss = (error.mean(1) * masks).sum() / masks.sum().clamp(min=1)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        cycle.step()
        if step % 100 == 0:
            print(f"{step * BATCH:6d} images, loss {loss.item():.4f}", flush=True)
    return network.eval()


@torch.no_grad()
def phase_by(network: UNet, image: np.ndarray) -> np.ndarray:
    """Wrapped phase (H, W) of a photograph, 0 to 255."""
    M, D = network(torch.as_tensor(image, dtype=torch.float32)[None, None] / 255)[0][0].numpy()
    return wrapped_phase(M, D)


def smooth(Phi: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The polynomial of second degree next to a phase (H, W): a carrier to start from."""
    v, u = (a / max(Phi.shape) for a in np.indices(Phi.shape))
    terms = np.stack([u**i * v**j for i in range(3) for j in range(3 - i)], -1)
    return terms @ np.linalg.lstsq(terms[mask], Phi[mask], rcond=None)[0]


def measures(errors: list[np.ndarray], strength: np.ndarray) -> dict:
    """RMS and median of |errors| (P,) of several photographs, radians, in all and by modulation."""
    e = np.abs(np.stack(errors))
    classes = np.digitize(strength, CLASSES) - 1
    return {
        "rms_rad": float(np.sqrt((e**2).mean())),
        "median_rad": float(np.median(e)),
        "rms_by_modulation": [
            float(np.sqrt((e[:, classes == k] ** 2).mean())) for k in range(len(CLASSES) - 1)
        ],
    }


def compare(network: UNet, folder: Path) -> dict:
    """Both on every photograph of the first pitch of a capture, against the phase of all steps."""
    capture = open_capture(folder, PATTERNS)
    sets = [capture.frames(k).astype(np.float64) for k in range(len(PITCHES))]
    phis = [wrapped_phase(*numerator_denominator(frames)) for frames in sets]
    strength = modulation(*numerator_denominator(sets[0]), STEPS)
    mask = (strength > CLASSES[0]) & (sets[0].max(0) < 255)
    carrier = smooth(mw_tpu(phis, PITCHES, PATTERNS.projector[0])[0], mask)
    shifts = 2 * np.pi * np.arange(STEPS) / STEPS
    ways = {"network": lambda image, shift: phase_by(network, image) - shift}
    for width in WIDTHS:
        ways[f"fourier {width:g}"] = lambda image, shift, width=width: fourier_phase(
            image, carrier, mask, width, shift
        )
    found = {
        name: measures(
            [wrap(way(*pair) - phis[0])[mask] for pair in zip(sets[0], shifts, strict=True)],
            strength[mask],
        )
        for name, way in ways.items()
    }
    found["pixels by modulation"] = np.histogram(strength[mask], CLASSES)[0].tolist()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=300, help="simulated scenes")
    parser.add_argument("--images", type=int, default=24_000, help="crops to train on")
    parser.add_argument("--base", type=int, default=16, help="channels of the finest level")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=ROOT / "data/results/real-light.json")
    given = parser.parse_args()
    if not CAPTURES.is_dir():
        parser.error(f"no captures at {CAPTURES}; set FPP_CAPTURES to their folder")
    began = time.perf_counter()
    scenes = [scene(1000 * given.seed + k) for k in range(given.scenes)]
    network = train(scenes, given.images, given.base, given.seed)
    record = {
        "command": "python -m benchmarks.real_light",
        "settings": {k: v for k, v in vars(given).items() if k != "out"} | {"crop": CROP},
        "classes": CLASSES,
        "scenes": {name: compare(network, CAPTURES / name) for name in SCENES},
        "seconds": time.perf_counter() - began,
        "hardware": hardware(torch.device("cpu")),
    }
    write_whole(given.out, f"{json.dumps(record, indent=1)}\n".encode())
    print(json.dumps(record["scenes"], indent=1))


if __name__ == "__main__":
    main()
