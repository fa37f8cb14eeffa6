"""Unwrapping: wrapped to absolute phase (paper, Eq. 4-7; chapter 4).

Functions of several frequencies take lists of phases (H, W) in radians and of pitches in
projector pixels. All but `nt_tpu` and `spatial` work on NumPy arrays and torch tensors alike.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from array_api_compat import array_namespace

from fpputil.checks import not_negative, positive

TWO_PI = 2 * math.pi
ROUNDING = 1e-9  # of the projector's width, by which a pitch that was computed may miss it
ROUNDED = 0.01  # likewise a beat, of pitches that were rounded; then the borders are ambiguous


def wrap(phase):
    """Phase modulo 2 pi, in (-pi, pi].

    >>> wrap(np.array([0.5, 7.0])).round(3)
    array([0.5  , 0.717])
    """
    return phase - TWO_PI * array_namespace(phase).ceil((phase - math.pi) / TWO_PI)


def absolute_phase(phi, K):
    """Phi = phi + 2 pi K (paper, Eq. 4).

    >>> absolute_phase(np.array([0.5]), 3).round(3)
    array([19.35])
    """
    return phi + TWO_PI * K


def fringe_order(phi, Phi_ref, ratio: float):
    """K = round((ratio Phi_ref - phi) / 2 pi) (paper, Eq. 6, 7). Chapter 4.

    Of the wrapped phase of the shorter pitch and the absolute one of the longer, (...), radians;
    `ratio` is the longer over the shorter pitch (paper, Eq. 5).

    >>> Phi_ref = 2 * np.pi * np.array([10.0, 400.0]) / 912  # columns 10 and 400 at pitch 912
    >>> phi = wrap(2 * np.pi * np.array([10.0, 400.0]) / 15)  # and at pitch 15
    >>> fringe_order(phi, Phi_ref, 912 / 15)
    array([ 1., 27.])
    """
    return array_namespace(phi, Phi_ref).round((ratio * Phi_ref - phi) / TWO_PI)


def unit_phase(phi, pitch: float, width: float, short: float = ROUNDING):
    """Absolute phase of a fringe whose one period covers the projector. Chapter 4.

    Pixel centres are at integers, so the projector spans columns -0.5 to width - 0.5. The phase
    is taken into the period centred on that span: [-pi/width, 2 pi - pi/width) if the pitch
    equals the width. A pitch that is shorter, by more than a share of the width, is refused: its
    phase would be ambiguous.

    >>> unit_phase(np.array([-3.0, -0.5, 3.0]), 912, 912).round(3)
    array([3.283, 5.783, 3.   ])
    """
    start = unit_start(pitch, width, short)
    return phi - TWO_PI * array_namespace(phi).floor((phi - start) / TWO_PI)


def unit_start(pitch: float, width: float, short: float = ROUNDING) -> float:
    """Phase, radians, at which the period of `unit_phase` begins."""
    positive("width", width, "projector columns")
    positive("pitch", pitch, "projector pixels")
    if pitch < width * (1 - short):
        raise ValueError(
            f"pitch {pitch} on {width} columns given; the first pitch must cover the whole "
            "projector, or its phase is ambiguous"
        )
    return -math.pi * (1 + pitch - width) / pitch


def guard_columns(sigma_phi: float, width: float) -> float:
    """Columns at either border that noise may throw to the other: 5 sigma_phi W / 2 pi. Chapter 4.

    Of the phase noise of the unit frequency, radians, and the number of projector columns.

    >>> round(guard_columns(0.02, 912), 1)
    14.5
    """
    return 5 * not_negative("sigma_phi", sigma_phi, "radians") * width / TWO_PI


def mf_tpu(phis, pitches, width: float):
    """Multi-frequency temporal unwrapping over two or more frequencies (paper, Eq. 4-7). Chapter 4.

    Parameters
    ----------
    phis : sequence of P (...) arrays
        Wrapped phases, radians.
    pitches : sequence of P floats
        Descending; the first covers the projector.
    width : float
        Projector columns.

    Returns
    -------
    list of P (...) arrays
        Absolute phases, radians; the last is the finest.

    Examples
    --------
    >>> pitches = (912, 114, 15)
    >>> phis = [wrap(2 * np.pi * np.array([10.0, 400.0]) / p) for p in pitches]
    >>> (mf_tpu(phis, pitches, 912)[-1] * 15 / TWO_PI).round(6)
    array([ 10., 400.])
    """
    check_pitches(phis, pitches)
    Phi = [unit_phase(phis[0], pitches[0], width)]
    for phi, longer, pitch in zip(phis[1:], pitches[:-1], pitches[1:], strict=True):
        Phi.append(absolute_phase(phi, fringe_order(phi, Phi[-1], longer / pitch)))
    return Phi


def beat(a: float, b: float) -> float:
    """Pitch of the beat of two pitches a < b: a b / (b - a), projector pixels. Chapter 4.

    >>> beat(14, 15)
    210.0
    """
    return a * b / (b - a)


def mw_tpu(phis, pitches, width: float):
    """Multi-wavelength (heterodyne) temporal unwrapping. Chapter 4.

    The difference of two wrapped phases is the phase of their beat. Beats of beats are formed
    until one covers the projector: it unwraps the others, from the longest to the shortest (so do
    100, 99 and 90 periods, whose beats are 1 and 9), and they their parents. A beat may be short
    of the projector by a hundredth, as of pitches that were rounded; the columns that are then
    ambiguous, half of them at either border, may be a whole beat off. Pitches that do not ascend,
    or whose last beat is too short, are refused.

    Arguments and result as of `mf_tpu`, in ascending order of the pitches.

    >>> pitches = (14, 15, 16)
    >>> phis = [wrap(2 * np.pi * np.array([10.0, 400.0]) / p) for p in pitches]
    >>> (mw_tpu(phis, pitches, 912)[0] * 14 / TWO_PI).round(6)
    array([ 10., 400.])
    """
    check_pitches(phis, pitches, "ascend")
    return _by_beats(phis, pitches, width)


def covers(pitch: float, width: float) -> bool:
    """Whether a beat is as long as the projector is wide, but for the rounding of its pitches."""
    return pitch >= width * (1 - ROUNDED)


def beats_of(pitches) -> tuple[list[float], list[int]]:
    """Beats of neighbours among ascending pitches, ascending, and which neighbours those are.

    >>> beats_of([14, 15, 16])
    ([210.0, 240.0], [0, 1])
    """
    beats = [beat(a, b) for a, b in pairwise(pitches)]
    order = np.argsort(beats, kind="stable").tolist()
    return [beats[j] for j in order], order


def _by_beats(phis, pitches, width):
    """`mw_tpu` of pitches that ascend, or of beats, some of which may be equal."""
    if len(phis) == 1 or covers(pitches[-1], width):
        Phi = [unit_phase(phis[-1], pitches[-1], width, ROUNDED)]
        for k in range(len(phis) - 2, -1, -1):
            K = fringe_order(phis[k], Phi[-1], pitches[k + 1] / pitches[k])
            Phi.append(absolute_phase(phis[k], K))
        return Phi[::-1]
    try:
        check_pitches(phis, pitches, "ascend")
        beats, pairs = beats_of(pitches)
        # Of the beats the shortest carries the least noise.
        Phi_ref = _by_beats([wrap(phis[j] - phis[j + 1]) for j in pairs], beats, width)[0]
    except ValueError as error:
        raise ValueError(f"pitches {list(pitches)} given; of their beats: {error}") from error
    each = zip(phis, pitches, strict=True)
    return [absolute_phase(phi, fringe_order(phi, Phi_ref, beats[0] / p)) for phi, p in each]


def nt_tpu(phis, pitches, width: int):
    """Number-theoretical temporal unwrapping of two integer pitches. Book: exact laws.

    ``(pitch_1 phi_1 - pitch_2 phi_2) / 2 pi = K_2 pitch_2 - K_1 pitch_1`` is a whole number
    that names the pair of orders, as long as the projector is no wider than the least common
    multiple of the pitches.

    Arguments and result as of `mf_tpu`, but for the two pitches, whole numbers in any order; NaN
    where no pair of orders gives the number.

    >>> phis = [wrap(2 * np.pi * np.array([10.0, 400.0]) / p) for p in (28, 45)]
    >>> (nt_tpu(phis, (28, 45), 912)[0] * 28 / TWO_PI).round(6)
    array([ 10., 400.])
    """
    if len(phis) != 2 or len(pitches) != 2 or any(int(p) != p or p < 1 for p in pitches):
        raise ValueError(
            f"{len(phis)} phases and pitches {pitches} given; the number-theoretical method "
            "takes two phases of whole pitches"
        )
    p, q = (int(x) for x in pitches)
    period, unit = math.lcm(p, q), math.gcd(p, q)
    if period < width:
        raise ValueError(
            f"pitches {p} and {q} on {width} columns given; their least common multiple, "
            f"{period}, must cover the projector"
        )
    a, b = (np.mod(x, TWO_PI) for x in phis)
    number = np.rint((p * a - q * b) / (TWO_PI * unit))
    table = _order_table(p, q)
    known = np.isfinite(number)
    orders = np.full((2, *number.shape), np.nan)
    index = np.where(known, number, 0).astype(int) + table.shape[1] // 2
    orders[:, known] = table[:, index[known]]
    Phi = absolute_phase(a, orders[0])
    joint = Phi * (p / period)  # phase of the common period, which the projector fills in part
    turn = unit_phase(joint, period, width) - joint
    return [Phi + turn * (period / p), absolute_phase(b, orders[1]) + turn * (period / q)]


def _order_table(p, q):
    """Orders K_1, K_2 of each whole number, (2, size), NaN where the number cannot occur.

    Where one period ends, noise may leave either order one too low or one too high.
    """
    unit = math.gcd(p, q)
    table = np.full((2, 2 * ((p + q) // unit) + 1), np.nan)
    columns = np.arange(2 * math.lcm(p, q)) / 2  # the half pixels before and after each centre
    for shift_p, shift_q in ((0.25, -0.25), (-0.25, 0.25), (0, 0)):  # the last, noiseless, wins
        K = np.floor((columns + shift_p) / p), np.floor((columns + shift_q) / q)
        table[:, ((K[1] * q - K[0] * p) / unit).astype(int) + table.shape[1] // 2] = K
    return table


def spatial(phi, mask):
    """Spatial unwrapping by reliability sorting, through scikit-image. Chapter 4.

    Of a wrapped phase (H, W), radians, at the pixels of a bool mask (H, W) where it is not NaN;
    NaN elsewhere. Each connected part keeps an unknown multiple of 2 pi.

    >>> Phi = np.linspace(0, 8, 12).reshape(3, 4)
    >>> bool((spatial(wrap(Phi), np.ones((3, 4))) - Phi).std() < 1e-6)
    True
    """
    from skimage.restoration import unwrap_phase

    valid = np.asarray(mask, bool) & np.isfinite(phi)
    if not valid.any():
        raise ValueError("empty mask given; spatial unwrapping needs at least one finite pixel")
    hidden = np.ma.array(np.where(valid, phi, 0), mask=~valid)
    return np.ma.filled(unwrap_phase(hidden, rng=0).astype(np.float64), np.nan)


TEMPORAL = {"mf": mf_tpu, "mw": mw_tpu, "nt": nt_tpu}  # by the names of pattern files


def unwraps(method: str, pitches: Sequence[float], width: float) -> bool:
    """Whether pitches, in any order, name each of so many projector columns.

    >>> unwraps("mf", (114, 912), 912), unwraps("mw", (42, 45, 48), 1920)
    (True, True)
    """
    pitches = sorted(pitches, reverse=method != "mw")
    try:
        TEMPORAL[method](list(np.zeros((len(pitches), 1, 1))), pitches, width)
    except ValueError:
        return False
    return True


def suggestion(method: str, pitches: Sequence[float], width: float) -> str:
    """What would do where pitches do not unwrap by a method; "" if nothing is known.

    >>> suggestion("mf", (42, 45, 48), 1920)
    '; unwrapped by their beats they would do (unwrap mw)'
    >>> suggestion("mf", (1, 8, 48), 1920)
    '; these look like periods: 1 8 48 of them over 1920 pixels would do (periods, not pitches)'
    >>> suggestion("mf", (19,), 912)
    '; one pitch alone is unwrapped in space (unwrap spatial), to whole turns'
    >>> suggestion("mf", (800, 100, 20), 912)
    '; on a projector 800 pixels wide they would do (name its size)'
    """
    if all(float(p).is_integer() and p <= width / 2 for p in pitches):
        periods = [width / p for p in pitches]
        for other in dict.fromkeys((method, "mf", "mw")):
            if unwraps(other, periods, width) and not (
                other != method and unwraps("mw", pitches, width)
            ):
                by = "" if other == method else f", and unwrap {other}"
                numbers = " ".join(f"{p:g}" for p in pitches)
                return (
                    f"; these look like periods: {numbers} of them over {width:g} pixels would do "
                    f"(periods, not pitches{by})"
                )
    if method != "mw" and unwraps("mw", pitches, width):
        return "; unwrapped by their beats they would do (unwrap mw)"
    if method == "mw" and unwraps("mf", pitches, width):
        return "; unwrapped one by one they would do (unwrap mf)"
    if len(pitches) == 1:
        return "; one pitch alone is unwrapped in space (unwrap spatial), to whole turns"
    if (longest := max(pitches)) > width / 2 and unwraps(method, pitches, longest):
        return f"; on a projector {longest:g} pixels wide they would do (name its size)"
    return ""


def reach(method: str, pitches: Sequence[float]) -> float:
    """Projector pixels that pitches tell apart, all in all.

    >>> reach("mf", (19, 1824, 114)), reach("mw", (14, 15, 16)), reach("nt", (28, 45))
    (1824, 1680.0, 1260)
    """
    if method == "nt" and all(float(p).is_integer() for p in pitches):
        return math.lcm(*map(int, pitches))
    pitches = sorted(pitches)
    while method == "mw" and len(pitches) > 1 and len(set(pitches)) == len(pitches):
        pitches = beats_of(pitches)[0]
    return max(pitches)


def check_pitches(phis, pitches, order: str = "descend") -> None:
    """ValueError unless there are as many positive pitches as phases, in strict order."""
    if len(phis) != len(pitches) or not len(phis):
        raise ValueError(f"{len(phis)} phases and {len(pitches)} pitches given; pair them")
    for pitch in pitches:
        positive("pitch", pitch, "projector pixels")
    down = pitches if order == "descend" else pitches[::-1]
    if any(b >= a for a, b in zip(down, down[1:], strict=False)):
        beats = "; for unwrapping by beats (mw) they ascend" if order == "descend" else ""
        raise ValueError(f"pitches {list(pitches)} given; they must {order} strictly{beats}")
