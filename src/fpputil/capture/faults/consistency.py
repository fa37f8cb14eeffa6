"""Photographs of a fringe against one another: exchanged, doubled, late, or of unlike brightness.

All steps of a pixel lie on one curve: the fringe, and the harmonics of the capture's response in
step with it. Whether a photograph is on that curve is told by some hundred pixels (chapter 12).
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

ALONE = 4.0  # times what the curve leaves of the other photographs of its fringe
LOUD = 3.0  # grey levels, from which on what is left speaks of a fault
STEPS = (6, 24)  # with fewer, what is left does not tell which photograph is to blame
FLICKERS = (5, 64)  # steps from which, and up to which, brightness can be told from the fringe
ORDERS = 9  # harmonics of a response that are looked for
ROUNDS = 3  # to the curve
SUSPECTS = 6  # steps off the curve, of which pairs are tried
PAIRS = 150  # pixels by which pairs of photographs are tried
MOST = 0.3  # of brightness that may flicker; more is another fault
STEADIER = 0.65  # of what is left, if the brightness is free, at most; else it does not flicker
STEADIER_OF_FEW = 0.8  # likewise of three and four steps
DETERMINED = 5.0  # times what noise does that a false brightness must do, or it is not told
LIKELY = 0.05  # of brightness: a usual flicker
SAME = 0.3  # of the difference that two steps should have
TOLD = 6.0  # grey levels: one picture taken twice differs by less, two that tell should by more


def curve_of(frames, keep=None, flicker: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """What the curve of a fringe leaves of its photographs, and how bright each is.

    Parameters
    ----------
    frames : (N, S) array
        All steps at S pixels, well lit and not saturated, grey levels.
    keep : list of K int, optional
        Steps that are used; by default all.
    flicker : bool
        Whether the brightness of the photographs is free.

    Returns
    -------
    left : (K, S) array
        Grey levels.
    gains : (K,) array
        Brightness of each over the mean; ones without `flicker`.
    """
    number = len(frames)
    keep = list(range(number)) if keep is None else keep
    delta, terms = _sinusoid(np.array(keep), number)
    solve = np.linalg.pinv(terms)
    across = np.eye(len(keep)) - terms @ solve  # takes the sinusoid away
    orders = np.arange(2, min((number - 1) // 2, ORDERS) + 1)
    grey, gains, waves = np.asarray(frames, float)[keep], np.ones(len(keep)), 0.0
    for _ in range(ROUNDS):
        straight = grey / gains[:, None]
        average, cosine, sine = solve @ (straight - waves)
        turn = np.arctan2(-sine, cosine) + delta[:, None]
        shapes = np.hypot(cosine, sine) * np.cos(orders[:, None, None] * turn)
        unknown = [across @ shape for shape in shapes]
        if flicker:
            curve = terms @ np.stack([average, cosine, sine]) + waves
            bright = across[:, :, None] * curve  # what a photograph that is brighter does
            unknown += list(np.moveaxis(bright, 1, 0) - bright.mean(axis=1))
        if not unknown:
            break
        columns = np.reshape(unknown, (len(unknown), -1))
        factors = np.linalg.lstsq(
            columns @ columns.T, columns @ (across @ straight).ravel(), rcond=1e-9
        )[0]
        waves = np.tensordot(factors[: len(orders)], shapes, 1) if len(orders) else 0.0
        if flicker:
            change = factors[len(orders) :]
            gains = gains * np.clip(1 + change - change.mean(), 0.5, 2)
    return across @ (grey / gains[:, None] - waves), gains


def left_of(frames, keep=None, of=np.median) -> np.ndarray:
    """What `curve_of` leaves of each kept step, RMS by the median over the pixels, or their mean.

    With flicker, where that explains most of it.
    """
    left, _ = curve_of(frames, keep)
    steady, gains = curve_of(frames, keep, flicker=True)
    return np.sqrt(of((steady if _flickers(left, steady, gains) else left) ** 2, axis=1))


def _flickers(left, steady, gains) -> bool:
    before, after = (np.median(np.median(np.abs(one), axis=1)) for one in (left, steady))
    return after < STEADIER * before and np.abs(gains - 1).max() < MOST


def flicker_of(frames) -> np.ndarray:
    """Brightness of each photograph (N,) of a fringe, (N, S); ones where it does not flicker.

    It is told from what it does to the curve, not from the mean alone, which changes with the
    fringe where a picture holds no whole periods.

    >>> rng = np.random.default_rng(0)
    >>> turn = rng.uniform(-3, 3, 400) + 2 * np.pi * np.arange(8)[:, None] / 8
    >>> frames = 100 + 80 * np.cos(turn) + rng.standard_normal(turn.shape)
    >>> frames[2] *= 0.9
    >>> flicker_of(frames)[1:4].round(2).tolist()
    [1.01, 0.91, 1.01]
    """
    ones = np.ones(len(frames))
    if not FLICKERS[0] <= len(frames) <= FLICKERS[1] or frames.shape[1] < 20:
        return ones
    left, _ = curve_of(frames)
    steady, gains = curve_of(frames, flicker=True)
    return gains if _flickers(left, steady, gains) else ones


def misfits(frames) -> list[int]:
    """Steps of (N, S) without which the curve leaves much less of the others, worst first."""
    bad: list[int] = []
    while len(bad) < len(frames) // 4:
        keep = [n for n in range(len(frames)) if n not in bad]
        left = left_of(frames, keep)
        if left.max() < LOUD:
            break
        likely = np.argsort(left)[-3:]  # the curve is bent towards the one to blame
        rest = {n: [k for k in keep if k != keep[n]] for n in likely}
        after = {n: np.median(left_of(frames, rest[n])) for n in likely}
        worst = min(after, key=after.get)
        if left[worst] < max(ALONE * after[worst], LOUD) or after[worst] > 0.6 * np.median(left):
            break
        bad.append(keep[worst])
    return bad


def exchanged(frames) -> tuple[int, int] | None:
    """The two steps of (N, S) that, exchanged, put them on a curve; None if there are none.

    Neighbours of many steps differ little, or, if the fringes are square, at few pixels: then the
    mean over the pixels tells, not their median.
    """
    few = frames[:, :: max(1, frames.shape[1] // PAIRS)]
    steps = list(range(len(frames)))
    for of, alone in ((np.median, ALONE), (np.mean, ALONE / 2)):
        left, after = left_of(few, of=of), {}
        if (before := left.max()) <= LOUD:
            continue
        for a, b in combinations(np.sort(np.argsort(left)[-SUSPECTS:]).tolist(), 2):
            order = [{a: b, b: a}.get(n, n) for n in steps]
            after[a, b] = left_of(few[order], of=of).max()
        best = min(after, key=after.get)
        if after[best] < before / alone:
            return best
    return None


def doubled(frames) -> tuple[int, int] | None:
    """Two steps of (N, S) that are one picture, but for its brightness; None if there are none.

    The first is the one without which a curve leaves less.
    """
    grey = np.asarray(frames, float)
    pairs = list(combinations(range(len(grey)), 2))
    same = [p for p in pairs if np.array_equal(*grey[[*p]]) and np.ptp(grey[p[0]]) > TOLD]
    if len(grey) < 4:  # so few have no curve: one file is told, and not which of both is wrong
        return same[0] if same else None
    if not same:
        curve, found = grey - curve_of(grey)[0], {}
        for a, b in pairs:
            apart, should = (np.sqrt(np.mean(without(p[b], p[a]) ** 2)) for p in (grey, curve))
            if apart < TOLD < should and apart < SAME * should:  # in the dark many are nearly alike
                found[a, b] = apart / should
        same = sorted(found, key=found.get)
    if not same:
        return None
    left = {n: left_of(frames, [k for k in range(len(grey)) if k != n]) for n in same[0]}
    return tuple(sorted(same[0], key=lambda n: np.mean(left[n])))


def _sinusoid(steps, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Shifts of some of so many steps, radians, (K,), and the terms of a sinusoid there, (K, 3)."""
    delta = 2 * np.pi * steps / number
    return delta, np.stack([np.ones_like(delta), np.cos(delta), np.sin(delta)], 1)


def without(values, along):
    """Values (S,) less what of them goes with others, (S,): of a photograph, but its brightness."""
    return values - along * ((along @ values) / max(along @ along, 1e-9))


def flickers_of(samples) -> list[np.ndarray]:
    """Brightness of each photograph of several fringes, (N, S) each, as `flicker_of` has them.

    Four steps tell it by ``I_0 - I_1 + I_2 - I_3``, which is 0 of a sinusoid; three by their mean,
    which is that of every other fringe. Directions that the pixels do not tell stay as they are.

    >>> rng = np.random.default_rng(0)
    >>> turns = rng.uniform(-3, 3, (2, 1, 400)) + 2 * np.pi * np.arange(3)[:, None] / 3
    >>> frames = 100 + 80 * np.cos(turns) + rng.standard_normal(turns.shape)
    >>> frames[0, 2] *= 0.9
    >>> [gains.round(2).tolist() for gains in flickers_of(frames)]
    [[1.03, 1.03, 0.93], [1.0, 1.0, 1.0]]
    """
    gains = [flicker_of(frames) for frames in samples]
    few = [len(frames) < FLICKERS[0] for frames in samples]
    if not any(few) or np.shape(samples[0])[1] < 20:
        return gains
    straight = [f / g[:, None] for f, g in zip(samples, gains, strict=True)]
    # One unknown factor of each photograph of few steps, and of the mean of each other fringe.
    parts = [f if free else f.mean(axis=0)[None] for f, free in zip(straight, few, strict=True)]
    ends = np.cumsum([len(part) for part in parts])
    own = np.repeat(np.eye(len(parts), dtype=bool), [len(part) for part in parts], axis=1)
    grey = np.concatenate(parts).T.astype(float)
    means = own / own.sum(axis=1, keepdims=True)
    rows = [*np.diff(means, axis=0)]
    for end, part in zip(ends, parts, strict=True):
        if len(part) == 4:
            rows.append(np.zeros(ends[-1]))
            rows[-1][end - 4 : end] = np.array([1, -1, 1, -1]) / 4
    if not rows:
        return gains
    equations = (np.stack(rows)[:, None] * grey).reshape(-1, ends[-1])
    normal, each = equations.T @ equations, own.T.astype(float)
    values, vectors = np.linalg.eigh(normal)
    least = max(values[0], 1e-9 * values[-1])
    if values[1] < DETERMINED**2 * least:
        return gains
    # Ones, less what of them the equations exclude beyond the noise.
    weights = 1 / (np.maximum(values - least, 0) + least / len(equations) / LIKELY**2)
    factors = vectors @ (weights * (vectors.T @ np.ones(ends[-1])))
    alike = each @ np.linalg.eigh(each.T @ normal @ each)[1][:, 0]  # a factor of each fringe
    left, steady = (np.abs(equations @ (f / f.mean())) for f in (alike, factors))
    if np.median(steady) >= STEADIER_OF_FEW * np.median(left):
        return gains
    found = [1 / one for one in np.split(factors, ends[:-1])]
    found = [one / one.mean() for one in found]
    if max(np.abs(one - 1).max() for one in found) >= MOST:
        return gains
    return [one if free else gain for one, free, gain in zip(found, few, gains, strict=True)]
