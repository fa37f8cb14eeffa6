"""What motion costs: a body that moves between one photograph and the next.

Parts that are in no dataset are photographed in the virtual rig of the preset "tiny", moved
sideways (across the fringes) or towards the camera by some millimetres from photograph to
photograph, and measured by networks and by phase shifting with three pitches of four steps, all
told the measuring range:
``python -m benchmarks.motion`` writes data/results/motion.json.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import torch

from fpputil.decoding import decode
from fpputil.decoding.phase import THRESHOLD
from fpputil.decoding.unwrap import TWO_PI
from fpputil.files import write_whole
from fpputil.learning import load_weights, predict_batch
from fpputil.networks import Geometry
from fpputil.optics import Fringe, fringe_set, preset, raycast, shapes
from fpputil.optics.parts import part

ROOT = Path(__file__).parents[1]
WEIGHTS = Path("data/weights/sfnet-tiny.safetensors")  # a module is run from the root
MOVED = (0.0, 0.1, 0.3, 1.0, 2.0, 5.0)  # mm from one photograph to the next
DIRECTIONS = {"sideways": (1.0, 0.0, 0.0), "towards": (0.0, 0.0, -1.0)}
FIRST, STEPS, NOISE = 8_000_000, 4, 1.0
RIG = preset("tiny")
FULL = fringe_set((RIG.pitches.unit, RIG.pitches.mid, RIG.pitches.high), STEPS)


class Body:
    """A part in a pose; `at` sees it moved by so many mm."""

    def __init__(self, number: int, direction):
        self.number = number
        rng = np.random.default_rng((FIRST, number))
        turn = shapes.rotation(*(60 * rng.integers(6, size=2)))
        self.mesh = shapes.place(part(FIRST + number), rotation=turn)
        self.direction, self.views = np.asarray(direction), {}

    def at(self, moved: float):
        if moved not in self.views:
            mesh = self.mesh.copy()
            mesh.apply_translation(moved * self.direction)
            self.views[moved] = raycast(mesh, RIG.system)
        return self.views[moved]

    def photographs(self, shots, moved: float) -> np.ndarray:
        """Photographs (N, H, W) of shots (fringe, step), moved by so much from one to the next."""
        seed = FIRST + 100 * self.number
        return np.concatenate(
            [
                self.at(k * moved).frames(fringe, NOISE, seed + k, steps=[step])
                for k, (fringe, step) in enumerate(shots)
            ]
        )


def by_network(trained, geometry, body: Body, moved: float):
    """Phi (H, W) of a network's photographs, one a shot, and where its fine photograph stands."""
    names = trained.method.photographs
    shots = [(Fringe(getattr(RIG.pitches, name), steps), step) for name, steps, step in names]
    low, high = trained.metadata["extremes"]
    frames = (body.photographs(shots, moved).astype(np.float32) - low) / (high - low)
    return predict_batch(trained, frames[None], geometry)[0].Phi_in_range, 0.0


def by_steps(geometry, body: Body, moved: float):
    """Phi (H, W) of twelve photographs, the fine ones last, and where those stand on average."""
    shots = [(fringe, step) for fringe in FULL for step in range(STEPS)]
    found = decode(body.photographs(shots, moved), FULL, RIG.system.projector.width)
    Phi = geometry.confined(torch.as_tensor(found.Phi, dtype=torch.float32)[None])[0].numpy()
    return Phi, moved * ((len(FULL) - 1) * STEPS + (STEPS - 1) / 2)


def errors(Phi, view, mask) -> np.ndarray:
    """|error| (P,) in radians where the body is, NaN where there is no phase."""
    return np.abs(Phi - TWO_PI * view.column / RIG.pitches.high)[mask & view.mask]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("weights", type=Path, nargs="*", default=[WEIGHTS], help="at tiny")
    parser.add_argument("--bodies", type=int, default=40)
    parser.add_argument("--out", type=Path, default=ROOT / "data/results/motion.json")
    given = parser.parse_args()
    networks = {path.stem: load_weights(path) for path in given.weights}
    geometry = Geometry.of(RIG.system, RIG.pitches)
    found = {}
    for direction, towards in DIRECTIONS.items():
        bodies = [Body(k, towards) for k in range(given.bodies)]
        for moved in MOVED:
            off = {name: [] for name in (*networks, "twelve")}
            for body in bodies:
                ways = {
                    name: by_network(trained, geometry, body, moved)
                    for name, trained in networks.items()
                }
                ways["twelve"] = by_steps(geometry, body, moved)
                bright = body.at(0.0).shade * 255 / 2 > THRESHOLD
                for name, (Phi, stands) in ways.items():
                    off[name].append(errors(Phi, body.at(stands), bright))
            for name, parts in off.items():
                e = np.concatenate(parts)
                known = e[np.isfinite(e)]
                found.setdefault(direction, {}).setdefault(name, []).append(
                    {
                        "moved_mm": moved,
                        "median_rad": float(np.median(known)),
                        "mae_rad": float(known.mean()),
                        "order_errors": float((known > np.pi).mean()),
                        "no_phase": float(1 - len(known) / len(e)),
                    }
                )
    command = " ".join(["python -m benchmarks.motion", *(f"{p}" for p in given.weights)])
    record = {"command": command, "bodies": given.bodies, "noise": NOISE, "directions": found}
    write_whole(given.out, f"{json.dumps(record, indent=1)}\n".encode())
    for direction, by_name in found.items():
        for name, rows in by_name.items():
            for r in rows:
                print(direction, name, *(f"{v:.4f}" for v in r.values()))


if __name__ == "__main__":
    main()
