"""Time the package `fringes`, mode "fast", on one stack of frames. Runs in its own environment.

Usage: python peer_fringes.py FRAMES.npy WIDTH STEPS PITCH [PITCH ...] ; prints JSON.
"""

import json
import sys
import time

import numpy as np
from fringes import Fringes

REPEATS = 5

path, width, steps, *pitches = sys.argv[1:]
frames = np.load(path)
peer = Fringes()
peer.X, peer.Y, peer.D = int(width), frames.shape[1], 1
peer.l = np.array([[float(p) for p in pitches]])
peer.N = np.full((1, len(pitches)), int(steps))
peer.p0, peer.reverse = 0, True  # I = A + B cos(2 pi i / pitch + 2 pi n / N), as ours
peer.mode = "fast"
assert peer.T == len(frames), f"the peer expects {peer.T} frames, {len(frames)} given"
stack = frames[..., None]


def median_seconds(verbose: bool) -> float:
    """Decode to brightness, modulation and position; if verbose, to local phases too, as ours."""
    peer.decode(stack, verbose=verbose)  # compiles
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        peer.decode(stack, verbose=verbose)
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds))


column = np.asarray(peer.decode(stack)[2]).reshape(frames.shape[1:])
result = {
    "seconds": median_seconds(False),
    "seconds_with_phases": median_seconds(True),
    "median_column": float(np.median(column)),
}
json.dump(result, sys.stdout)
