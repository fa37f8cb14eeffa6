"""Photographs of one fringe that do not belong where they stand (chapter 12).

All functions take photographs (N, S): N steps, equally shifted, at S pixels, grey levels of 255.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

ALONE = 4.0  # times what is left of the other photographs of its fringe
MANY, SOME = 24, 400  # steps up to which photographs are searched, pixels at which
LEAST = 6  # steps; with fewer, what is left does not tell which photograph is to blame


def strong(frames) -> np.ndarray:
    """Up to `SOME` pixels of (N, S) that see the fringes well and are not saturated."""
    turn = np.exp(-2j * np.pi * np.arange(len(frames)) / len(frames))
    strong = (2 / len(frames) * np.abs(turn @ frames) > 16) & (frames.max(axis=0) < 254)
    found = frames[:, strong]
    return found[:, :: max(1, found.shape[1] // SOME)]


def misfits(frames) -> list[int]:
    """Steps without which the rest of the others falls by much, the worst first."""
    bad: list[int] = []
    if not LEAST <= len(frames) <= MANY:
        return bad
    while len(bad) < len(frames) // 4:
        keep = [n for n in range(len(frames)) if n not in bad]
        rest = rests(frames, keep)
        worst = keep[int(np.argmax(rest))]
        without = np.median(rests(frames, [n for n in keep if n != worst]))
        if rest.max() < max(ALONE * without, 3.0) or without > 0.6 * np.median(rest):
            break
        bad.append(worst)
    return bad


def exchanged(frames) -> tuple[int, int] | None:
    """The two steps that, exchanged, leave a small part of the rest; None if there are none."""
    if not LEAST <= len(frames) <= MANY:
        return None
    every = list(range(len(frames)))
    before = np.median(rests(frames, every))
    left = {}
    for pair in combinations(every, 2):
        order = every.copy()
        order[pair[0]], order[pair[1]] = order[pair[1]], order[pair[0]]
        left[pair] = np.median(rests(frames[order], every))
    best = min(left, key=left.get)
    return best if before > 3.0 and left[best] < before / ALONE else None


def rests(frames, keep) -> np.ndarray:
    """RMS of what a sinusoid leaves of each kept step, by the median over the pixels."""
    delta = 2 * np.pi * np.array(keep) / len(frames)
    terms = np.stack([np.ones_like(delta), np.cos(delta), np.sin(delta)], 1)
    some = frames[keep]
    return np.sqrt(np.median((some - terms @ (np.linalg.pinv(terms) @ some)) ** 2, axis=1))
