"""How far off: errors in radians and millimetres, wrong fringe orders, spikes (section 6; ch. 8).

Errors are gathered a model, pooled over its pixels; intervals come from drawing models anew,
because the pixels and the views of one model are alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from fpputil.checks import seeded, whole
from fpputil.decoding.triangulation import column, depth_of, triangulate
from fpputil.decoding.unwrap import wrap
from fpputil.optics.system import System

LEAST_SENSITIVITY = 0.1  # projector columns a mm; below, a depth hardly moves a column
BINS = np.concatenate([[0], np.geomspace(1e-5, 1e3, 4001)])  # of |error| for medians: 0.46 % wide


def spikes(Phi: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Pixels of the mask whose phase is more than pi from the median of their 5 x 5 neighbours.

    Parameters
    ----------
    Phi : (H, W) array
        Absolute phase, radians.
    mask : (H, W) bool array
        Neighbours outside it do not count.

    Returns
    -------
    (P,) bool array
        Of the pixels of the mask, in row order.

    Examples
    --------
    >>> Phi = np.zeros((5, 5))
    >>> Phi[2, 2] = 6.3
    >>> np.flatnonzero(spikes(Phi, np.ones((5, 5), bool)))
    array([12])
    """
    padded = np.pad(np.where(mask, Phi, np.nan).astype(np.float32), 2, constant_values=np.nan)
    near = np.lib.stride_tricks.sliding_window_view(padded, (5, 5))[mask].reshape(-1, 25)
    near = np.sort(near, axis=1)  # NaN last
    count = np.isfinite(near).sum(axis=1)
    rows = np.arange(len(near))
    median = (near[rows, (count - 1) // 2] + near[rows, count // 2]) / 2
    return ~(np.abs(Phi[mask] - median) <= math.pi)


def errors(Phi, phi_h, phi_r, truth: dict, system: System, pitch: float) -> dict[str, np.ndarray]:
    """Errors of one view at the pixels of its mask.

    Parameters
    ----------
    Phi, phi_h, phi_r : (H, W) arrays or None
        Predicted absolute phase and, where there are such, wrapped phases, radians.
    truth : dict
        mask, Phi, phi_r, depth, (H, W) each, as an item of `SynthFringe` has them.
    system : System
    pitch : float
        High pitch, projector pixels.

    Returns
    -------
    dict
        rad (P,) errors of Phi; mm (Q,) errors of depth where a column moves by more than
        `LEAST_SENSITIVITY` a millimetre, NaN where ray and plane of light do not meet;
        insensitive (P,) bool, the others; order, spike, own_spike (P,) bool, wrong fringe orders,
        spikes, spikes of the truth; high, low (P,) errors of the wrapped phases.
    """
    if "sensitive" not in truth:
        truth = truth | limits(truth, system)
    mask, sensitive = truth["mask"], truth["sensitive"]
    rad = Phi[mask] - truth["Phi"][mask]
    depth = depth_of(triangulate(column(np.where(mask, Phi, np.nan), pitch), system), system)
    values = {
        "rad": rad,
        "mm": (depth - truth["depth"])[sensitive],
        "insensitive": ~sensitive[mask],
        "order": ~(np.abs(rad) <= math.pi),  # no phase is no right order
        "spike": spikes(Phi, mask),
        "own_spike": truth["own_spike"],
    }
    if phi_h is not None:
        values["high"] = wrap(phi_h - truth["Phi"])[mask]
    if phi_r is not None:
        values["low"] = wrap(phi_r - truth["phi_r"])[mask]
    return values


def limits(truth: dict, system: System) -> dict[str, np.ndarray]:
    """What `errors` asks of the truth alone, to be joined to it where it serves several times.

    sensitive (H, W) bool: pixels whose depths count; own_spike (P,) bool: spikes of the truth.
    """
    mask = truth["mask"]
    sensitive = mask & (system.columns_per_mm(truth["depth"]) > LEAST_SENSITIVITY)
    return {"sensitive": sensitive, "own_spike": spikes(truth["Phi"], mask)}


@dataclass(eq=False)
class Score:
    """Errors gathered by model, and what they come to.

    For each model, of each kind of error: number, number of the finite, sum of ``|e|``, sum of
    squares, and of rad and mm a histogram over `BINS`.

    Examples
    --------
    >>> no = np.zeros(2, bool)
    >>> marks = dict.fromkeys(("insensitive", "order", "spike", "own_spike"), no)
    >>> score = Score()
    >>> score.add(7, {"rad": np.array([0.1, -0.3]), "mm": np.array([0.0, 1.0]), **marks})
    >>> [round(value, 2) for value in score.summary(draws=10)["mae_rad"]]
    [0.2, 0.2, 0.2]
    """

    models: dict[int, dict[str, np.ndarray]] = field(default_factory=dict)

    def add(self, model: int, values: dict[str, np.ndarray]) -> None:
        """Add the errors of one view of a model."""
        pooled = self.models.setdefault(int(model), {})
        for kind, e in values.items():
            e = np.abs(np.asarray(e, np.float64))
            known = e[np.isfinite(e)]
            sums = [len(e), len(known), known.sum(), (known**2).sum()]
            if kind in ("rad", "mm"):
                sums += np.histogram(known.clip(max=BINS[-1]), BINS)[0].tolist()
            pooled[kind] = pooled.get(kind, 0) + np.array(sums, float)

    def summary(self, seed: int = 0, draws: int = 1000) -> dict[str, tuple[float, float, float]]:
        """Each measure with its 95 % bootstrap interval over models: (value, low, high).

        Models are drawn as in `draws_of_models`. The measures are mae_rad, rmse_rad, median_rad,
        mae_mm, rmse_mm, median_mm, and shares from 0 to 1: order_errors, spikes, spikes_of_truth,
        insensitive (left out of the mm), no_depth (of those in mm); mae_high and mae_low of
        wrapped phases.
        """
        models = list(self.models.values())
        if not sum(model["rad"][0] for model in models):
            raise ValueError("no pixel to score; the masks of these views are empty")
        counts = draws_of_models(len(models), draws, seed)
        pooled = {kind: counts @ np.stack([m[kind] for m in models]) for kind in models[0]}
        with np.errstate(invalid="ignore", divide="ignore"):
            measures = _measures(pooled)
        return {k: (float(v[0]), *_interval(v[1:])) for k, v in measures.items()}


def draws_of_models(number: int, draws: int, seed: int = 0) -> np.ndarray:
    """How often each model counts: once in the first row, then as drawn with replacement.

    Times sums over each model, (number, ...), the (draws + 1, number) floats are those of a draw.

    >>> draws_of_models(4, 2)
    array([[1., 1., 1., 1.],
           [1., 0., 0., 3.],
           [0., 2., 2., 0.]])
    """
    shares = np.full(number, 1 / number)
    drawn = seeded(seed).multinomial(number, shares, size=whole("draws", draws, 1))
    return np.vstack([np.ones(number), drawn])


def _interval(values: np.ndarray) -> tuple[float, float]:
    """Percentiles 2.5 and 97.5 of the finite values; NaN if there is none."""
    values = values[np.isfinite(values)]
    low, high = np.percentile(values, (2.5, 97.5)) if len(values) else (np.nan, np.nan)
    return float(low), float(high)


def _measures(pooled: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Measures, one a row of the pooled sums."""
    means = {kind: sums[:, 2] / sums[:, 1] for kind, sums in pooled.items()}
    out = {}
    for unit in ("rad", "mm"):
        out[f"mae_{unit}"] = means[unit]
        out[f"rmse_{unit}"] = np.sqrt(pooled[unit][:, 3] / pooled[unit][:, 1])
        out[f"median_{unit}"] = _median(pooled[unit][:, 4:])
    out |= {
        "order_errors": means["order"],
        "spikes": means["spike"],
        "spikes_of_truth": means["own_spike"],
        "insensitive": means["insensitive"],
        "no_depth": 1 - pooled["mm"][:, 1] / pooled["mm"][:, 0],
    }
    return out | {f"mae_{kind}": means[kind] for kind in ("high", "low") if kind in means}


def _median(counts: np.ndarray) -> np.ndarray:
    """Medians of histograms (R, bins) over `BINS`, straight inside a bin; NaN of empty ones."""
    below = np.cumsum(counts, axis=1)
    half = below[:, -1] / 2
    k = (below >= half[:, None]).argmax(axis=1)
    rows = np.arange(len(counts))
    inside = (half - (below[rows, k] - counts[rows, k])) / np.maximum(counts[rows, k], 1)
    medians = BINS[k] + inside * (BINS[k + 1] - BINS[k])
    return np.where(below[:, -1] > 0, medians, np.nan)
