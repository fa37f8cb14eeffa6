"""Times of actions that take turns."""

from __future__ import annotations

import time

import numpy as np


def median_seconds(*actions, repeats: int = 15) -> list[float]:
    """Median time of each action; the actions take turns, so that a drift hits all alike."""
    times = [[] for _ in actions]
    for _ in range(repeats + 1):
        for action, spent in zip(actions, times, strict=True):
            start = time.perf_counter()
            action()
            spent.append(time.perf_counter() - start)
    return [float(np.median(t[1:])) for t in times]
