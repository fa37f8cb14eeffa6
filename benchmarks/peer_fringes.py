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

seconds = []
decoded = peer.decode(stack, verbose=False)  # compiles
for _ in range(REPEATS):
    start = time.perf_counter()
    decoded = peer.decode(stack, verbose=False)
    seconds.append(time.perf_counter() - start)
column = np.asarray(decoded[2]).reshape(frames.shape[1:])
json.dump(
    {"seconds": float(np.median(seconds)), "median_column": float(np.median(column))}, sys.stdout
)
