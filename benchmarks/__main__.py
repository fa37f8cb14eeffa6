"""Speed side by side: ratios of medians measured in one run, as a table and as JSON.

``make bench`` runs this. A peer package is timed in an environment of its own; give its
interpreter by ``--peer PYTHON``. Absolute times are of this machine; ratios carry over better.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

import numba
import numpy as np
import trimesh

from benchmarks import captures, cycles, loading, networks, rivals
from benchmarks.timing import median_seconds
from fpputil.decoding.decoder import decode
from fpputil.decoding.kernel import BLOCK
from fpputil.files import write_whole
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import preset
from fpputil.probe import blender_works

HERE = Path(__file__).parent
PITCHES, STEPS, WIDTH = (912, 114, 15), 15, 912


def frames_of(height: int, width: int) -> np.ndarray:
    """45 noisy uint8 frames of a tilted plane, (45, H, W)."""
    rng = np.random.default_rng(0)
    column = np.linspace(20, 890, width)[None] + np.linspace(0, 10, height)[:, None]
    frames = np.empty((len(PITCHES) * STEPS, height, width), np.uint8)
    for k, fringe in enumerate(fringe_set(PITCHES, STEPS)):
        for n in range(STEPS):
            noise = rng.integers(-2, 3, column.shape)
            frames[k * STEPS + n] = np.rint(20 + 0.7 * fringe.intensity(column, n) + noise)
    return frames


@numba.njit(parallel=True)
def read_all_write_all(frames, wrapped, modulation, Phi, mask):
    """The floor: touch every input and every output once, with no arithmetic to speak of."""
    pixels = frames.shape[1]
    for block in numba.prange((pixels + BLOCK - 1) // BLOCK):
        low = block * BLOCK
        high = min(low + BLOCK, pixels)
        seen = np.zeros(BLOCK, np.uint8)
        for n in range(frames.shape[0]):
            frame = frames[n, low:high]
            for i in range(high - low):
                seen[i] ^= frame[i]
        for p in range(wrapped.shape[0]):
            for i in range(high - low):
                wrapped[p, low + i] = seen[i]
                modulation[p, low + i] = seen[i]
        for i in range(high - low):
            Phi[low + i] = seen[i]
            mask[low + i] = seen[i] > 8


def floor(frames):
    flat = frames.reshape(len(frames), -1)
    wrapped = np.empty((len(PITCHES), flat.shape[1]), np.float32)
    outputs = (
        wrapped,
        np.empty_like(wrapped),
        np.empty_like(wrapped[0]),
        np.empty(flat.shape[1], bool),
    )
    read_all_write_all(flat, *outputs)


def bench_decoder(height, width) -> dict:
    frames, fringes = frames_of(height, width), fringe_set(PITCHES, STEPS)
    ours, least = median_seconds(lambda: decode(frames, fringes, WIDTH), lambda: floor(frames))
    return {"seconds": ours, "floor_seconds": least, "over_floor": ours / least}


def bench_peer(height, width, python) -> dict:
    frames, fringes = frames_of(height, width), fringe_set(PITCHES, STEPS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frames.npy"
        np.save(path, frames)
        command = [python, HERE / "peer_fringes.py", path, WIDTH, STEPS, *PITCHES]
        result = decode(frames, fringes, WIDTH)
        ways = (
            lambda: decode(frames, fringes, WIDTH),
            lambda: decode(frames, fringes, WIDTH, out=result),
        )
        before = median_seconds(*ways)
        out = subprocess.run([str(c) for c in command], check=True, stdout=subprocess.PIPE)
        after = median_seconds(*ways)
    peer = json.loads(out.stdout.splitlines()[-1])
    ours, refilling = np.mean([before, after], axis=0).tolist()
    column = decode(frames, fringes, WIDTH).Phi * PITCHES[-1] / (2 * np.pi)
    agreement = abs(float(np.median(column)) - peer["median_column"])
    return {
        "seconds": ours,
        "seconds_refilling": refilling,
        "fringes_fast_seconds": peer["seconds"],
        "fringes_fast_phases_seconds": peer["seconds_with_phases"],
        "faster": peer["seconds"] / ours,
        "faster_with_phases": peer["seconds_with_phases"] / ours,
        "faster_with_phases_refilling": peer["seconds_with_phases"] / refilling,
        "median_column_difference": agreement,
    }


def bench_view() -> dict:
    """One `paper` view of a mesh of 200 000 faces, the tree included; 60 frames from it."""
    mesh = trimesh.creation.uv_sphere(100.0, count=[224, 224])
    mesh.apply_translation((0, 0, 680))
    p = preset("paper")
    fringes = fringe_set((p.pitches.unit, p.pitches.zmin, p.pitches.mid, p.pitches.high), 15)
    view = raycast(mesh, p.system)
    cast, frames, noisy = median_seconds(
        lambda: raycast(mesh, p.system),
        lambda: view.frames(fringes),
        lambda: view.frames(fringes, 1.0, 0),
        repeats=7,
    )
    return {
        "faces": len(mesh.faces),
        "view_seconds": cast,
        "frames_60_seconds": frames,
        "frames_60_noisy_seconds": noisy,
        "view_over_frames": cast / frames,
    }


def machine() -> dict:
    return {
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
    }


def comparisons(peer: str | None) -> dict:
    """What is compared, by title."""
    found = {
        "machine": machine,
        "decoder 640x480": lambda: bench_decoder(480, 640),
        "decoder 1920x1200": lambda: bench_decoder(1200, 1920),
        "view and frames": bench_view,
    }
    if peer:
        found["against fringes 1920x1200"] = lambda: bench_peer(1200, 1920, peer)
    else:
        print("no --peer given: the comparison with `fringes` is left out", file=sys.stderr)
    found |= {
        "loading tiny": lambda: loading.bench_loading("tiny", 1000, 12),
        "loading paper": lambda: loading.bench_loading("paper", 150, 2),
        "training step tiny": networks.bench_training,
        "measuring 640x480": networks.bench_measuring,
        "methods 640x480": rivals.bench_rivals,
        "capture of 60 files, 1920x1200": captures.bench_captures,
        "lenses of a capture, 1920x1200": captures.bench_lens,
    }
    if blender_works():
        found[cycles.TITLE] = cycles.bench_cycles
    else:
        print("Blender does not run here: its comparison is left out", file=sys.stderr)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--peer", help="Python interpreter that has `fringes` installed")
    parser.add_argument("--out", type=Path, default=HERE / "results.json")
    parser.add_argument("--only", nargs="+", metavar="TITLE", help="the others stay as they are")
    options = parser.parse_args()
    known, results = comparisons(options.peer), {}
    if options.only:
        if wrong := [title for title in options.only if title not in known]:
            parser.error(f"{wrong[0]!r} given; the titles are {', '.join(known)}")
        known = {"machine": machine} | {title: known[title] for title in options.only}
        results = json.loads(options.out.read_text()) if options.out.is_file() else {}
        if results.get("machine", machine()) != machine():
            parser.error(f"{options.out} is of another machine; run all")
    for title, bench in known.items():
        results[title] = bench()
        print(title)
        for name, value in results[title].items():
            print(
                f"  {name:28s} {value:.4g}" if isinstance(value, float) else f"  {name:28s} {value}"
            )
    write_whole(options.out, (json.dumps(results, indent=2) + "\n").encode())


if __name__ == "__main__":
    main()
