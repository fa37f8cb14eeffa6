"""What noise does to a phase, and to the fringe order (chapters 3 and 4)."""

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.special import ndtr

from fpputil.checks import positive
from fpputil.decoding.unwrap import check_pitches


def phase_sigma(noise, modulation, steps: int):
    """sigma_phi = sqrt(2/N) sigma / B: the phase noise of N-step phase shifting. Chapter 3.

    In radians, of the noise sigma of a frame (standard deviation) and the modulation B of the
    fringe, grey levels, numbers or arrays. It holds to first order in sigma / B.

    >>> float(phase_sigma(noise=2, modulation=80, steps=15).round(5))
    0.00913
    """
    return np.sqrt(2 / steps) * np.asarray(noise) / np.asarray(modulation)


def phase_density(error, sigma: float):
    """Exact probability density of the phase error of a phasor in Gaussian noise. Book: exact laws.

    Per radian, of errors (...) in (-pi, pi]. `sigma` is the noise of either component over the
    phasor's length, as of `phase_sigma`; where it is small, the law is the normal one.

    >>> phase_density([0.0, 0.1], sigma=0.1).round(3)
    array([3.989, 2.412])
    """
    error = np.asarray(error, np.float64)
    along = np.cos(error) / sigma
    tail = np.exp(-(np.sin(error) ** 2) / (2 * sigma**2)) * ndtr(along)
    return (
        np.exp(-(sigma**-2) / 2) / (2 * np.pi) + np.cos(error) / (np.sqrt(2 * np.pi) * sigma) * tail
    )


def order_error_rate(noise: float, modulation: float, steps, pitches) -> float:
    """Predicted share of wrong fringe orders in multi-frequency unwrapping. Book: exact laws.

    Between two neighbours the order is right where ``|ratio e_long - e_short| < pi``, with
    both phase errors from `phase_density`. Columns within reach of the projector's border
    are taken to be outside the mask.

    Parameters
    ----------
    noise, modulation : float
        Grey levels, of each frame and of every pitch.
    steps : int or sequence of int
        Steps of all, or of each, pitch.
    pitches : sequence of float
        Descending.

    Examples
    --------
    >>> round(order_error_rate(noise=4, modulation=60, steps=15, pitches=(912, 15)), 4)
    0.0339
    """
    positive("noise", noise, "grey levels")
    positive("modulation", modulation, "grey levels")
    steps = (steps,) * len(pitches) if np.ndim(steps) == 0 else tuple(steps)
    check_pitches(steps, pitches)
    error = np.linspace(-np.pi, np.pi, 20001)
    laws = [phase_density(error, float(phase_sigma(noise, modulation, n))) for n in steps]
    right, wrong = laws[0], 0.0
    for law, longer, pitch in zip(laws[1:], pitches, pitches[1:], strict=False):
        cumulative = cumulative_trapezoid(right, error, initial=0)
        low, high = (error - np.pi) * pitch / longer, (error + np.pi) * pitch / longer
        below = np.interp(low, error, cumulative)
        above = cumulative[-1] - np.interp(high, error, cumulative)
        wrong += trapezoid(law * (below + above), error)
        right = law * (cumulative[-1] - below - above)
    return float(wrong)
