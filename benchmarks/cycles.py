"""The paper's way to a dataset against ours: 60 photographs by Cycles, or one ray cast.

``python -m benchmarks.cycles`` runs this alone and puts its part into the results.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np

from fpputil.files import write_whole
from fpputil.optics import blender
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import sphere
from fpputil.optics.system import preset

TITLE = "60 frames against Cycles 640x480"


def bench_cycles(repeats: int = 7) -> dict:
    """60 frames of one scene: tree, view and frames by us; one picture a frame by Cycles.

    Both start from the mesh. Ours is timed before and after Cycles, so that a drift shows.
    """
    mesh, p = sphere(), preset("paper")
    fringes = fringe_set((p.pitches.unit, p.pitches.zmin, p.pitches.mid, p.pitches.high), 15)

    def ours():
        return raycast(mesh, p.system).frames(fringes)

    def cycles(samples):
        return blender.photograph(mesh, p.system, fringes, samples=samples)

    def coordinates():
        return blender.see(mesh, p.system).frames(fringes)

    agree = np.abs(ours().astype(int) - cycles(1)).max(axis=0) <= 1
    before = [_seconds(ours) for _ in range(repeats)]
    one = float(np.median([_seconds(cycles, 1) for _ in range(3)]))
    once = float(np.median([_seconds(coordinates) for _ in range(3)]))
    many = _seconds(cycles, 16)
    after = [_seconds(ours) for _ in range(repeats)]
    least = float(np.median(before + after))
    return {
        "faces": len(mesh.faces),
        "seconds": least,
        "seconds_before": float(np.median(before)),
        "seconds_after": float(np.median(after)),
        "see_seconds": once,
        "cycles_1_sample_seconds": one,
        "cycles_16_samples_seconds": many,
        "faster_than_1_sample": one / least,
        "faster_than_16_samples": many / least,
        "pixels_within_1_grey_level": float(agree.mean()),
    }


def _seconds(action, *arguments) -> float:
    start = time.perf_counter()
    action(*arguments)
    return time.perf_counter() - start


if __name__ == "__main__":
    path = Path(__file__).parent / "results.json"
    results = json.loads(path.read_text()) if path.exists() else {}
    results[TITLE] = bench_cycles()
    print(json.dumps(results[TITLE], indent=2))
    write_whole(path, (json.dumps(results, indent=2) + "\n").encode())
