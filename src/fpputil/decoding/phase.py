"""Phase shifting: frames to wrapped phase, modulation and mask (paper, Eq. 2, 3, 16; chapter 3).

Every function takes NumPy arrays or torch tensors and returns the same kind.
"""

import math

import numpy as np
from array_api_compat import array_namespace, is_array_api_obj

THRESHOLD = 8.0  # grey levels of modulation, the paper's choice below Eq. 16


def numerator_denominator(frames):
    """M = sum I_n sin(delta_n) and D = sum I_n cos(delta_n) (paper, Eq. 3). Chapter 3.

    Of frames (N, ...) of one fringe, N at least 3, equally shifted over a period: M and D, (...),
    float32 for float32 frames, float64 for all others.

    >>> frames = [128 + 50 * np.cos(0.5 + 2 * np.pi * n / 4) * np.ones((2, 3)) for n in range(4)]
    >>> M, D = numerator_denominator(frames)
    >>> float(wrapped_phase(M, D)[0, 0].round(6)), float(modulation(M, D, 4)[0, 0].round(6))
    (0.5, 50.0)
    """
    frames = _floats(check_frames(frames))
    xp = array_namespace(frames)
    steps = frames.shape[0]
    delta = 2 * math.pi * xp.arange(steps, dtype=frames.dtype) / steps
    return xp.tensordot(xp.sin(delta), frames, axes=1), xp.tensordot(xp.cos(delta), frames, axes=1)


def wrapped_phase(M, D):
    """phi = -atan2(M, D) in radians, between -pi and pi (paper, Eq. 3). Chapter 3.

    >>> wrapped_phase(np.array([-1.0, 0.0]), np.array([0.0, -1.0])).round(3)
    array([ 1.571, -3.142])
    """
    return -array_namespace(M, D).atan2(M, D)


def modulation(M, D, steps: int):
    """I'' = 2/N sqrt(M^2 + D^2), grey levels (paper, Eq. 16). Chapter 3.

    >>> modulation(np.array([30.0]), np.array([40.0]), steps=4)
    array([25.])
    """
    return 2 / steps * array_namespace(M, D).sqrt(M**2 + D**2)


def average(frames):
    """I', the mean of the frames over the steps: the picture without fringes (paper, Eq. 2).

    >>> average(np.array([[10, 20], [30, 40], [50, 60]], np.uint8))
    array([30., 40.])
    """
    frames = _floats(check_frames(frames))
    return array_namespace(frames).mean(frames, axis=0)


def mask(modulation_high, threshold: float = THRESHOLD):
    """True where the modulation of the high frequency exceeds the threshold (paper, Eq. 16)."""
    return modulation_high > threshold


def check_frames(frames, steps: int | None = None):
    """A stack, or a list of frames, as one (N, ...) array; ValueError if it cannot be."""
    parts = frames if isinstance(frames, list | tuple) else [frames]
    if strange := [type(f).__name__ for f in parts if not is_array_api_obj(f)]:
        raise ValueError(
            f"frames of type {strange[0]} given; they are NumPy arrays or torch tensors"
        )
    if parts is frames:
        shapes = {tuple(f.shape) for f in frames}
        dtypes = {str(f.dtype) for f in frames}
        if len(shapes) > 1 or len(dtypes) > 1:
            raise ValueError(
                f"frames of sizes {sorted(shapes)} and dtypes {sorted(dtypes)} given; "
                "all frames need one size and one dtype"
            )
        frames = array_namespace(*frames).stack(frames) if frames else np.empty((0, 0, 0))
    xp = array_namespace(frames)
    if not xp.isdtype(frames.dtype, ("integral", "real floating")):
        raise ValueError(f"frames of dtype {frames.dtype} given; they are integers or real floats")
    number = frames.shape[0] if frames.ndim else 0
    if steps is not None and number != steps:
        raise ValueError(f"{number} frames given; the fringes have {steps} steps in all")
    if number < 3:
        raise ValueError(f"{number} frames given; phase shifting needs at least 3 steps")
    if 0 in frames.shape:
        raise ValueError(f"frames of shape {tuple(frames.shape)} given; they hold no pixel")
    if xp.isdtype(frames.dtype, "real floating") and not all(xp.isfinite(f).all() for f in frames):
        raise ValueError("frames with NaN or infinite pixels given; mask them or photograph again")
    return frames


def _floats(frames):
    """Frames of another dtype than float32 and float64 as float64."""
    xp = array_namespace(frames)
    exact = frames.dtype in (xp.float32, xp.float64)
    return frames if exact else xp.astype(frames, xp.float64)
