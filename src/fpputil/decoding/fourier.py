"""Fourier transform profilometry: a wrapped phase from one photograph (chapter 8).

The method is Takeda and Mutoh's of 1983: the fringes are a carrier, which the object bends. Freed
of the carrier, the phase varies slowly, and a window keeps it apart from the background.
"""

import numpy as np
from scipy import fft

from fpputil.checks import positive
from fpputil.decoding.unwrap import TWO_PI
from fpputil.optics.system import System

ACROSS = 2.0  # width of the window across the carrier over that along it: no background lies there
DARKEST = 0.01  # of the mean grey level; a background below it does not become a contrast


def carrier(system: System, pitch: float, z: float | None = None) -> np.ndarray:
    """Absolute phase of the fringes on a plane of the camera, which `fourier_phase` starts from.

    Its gradient is the frequency of the fringes in the photograph, with the sign that the pose
    of the projector gives it: an upside-down projector makes the columns grow leftward. Chapter 8.

    (H, W), radians, of a pitch in projector pixels at the depth z, mm, by default the middle of the
    measuring range. Beyond the borders of the projector it goes on as if there were columns.

    >>> from fpputil.optics import preset
    >>> carrier(preset("tiny").system, 24)[60, [0, 40, 80]].round(1)
    array([ -5.9,  55.6, 119.2])
    """
    positive("pitch", pitch, "projector pixels")
    z = (system.z_min + system.z_max) / 2 if z is None else positive("z", z, "millimetres")
    return TWO_PI * system.columns_at(z) / pitch


def fourier_phase(photograph, Phi_carrier, mask=None, width: float = 1.0, shift: float = 0.0):
    """Wrapped phase of one photograph, by demodulation and a window. Chapter 8.

    The photograph is divided by its local mean, so that neither shade nor the edge of the mask
    passes for a fringe, and multiplied by ``exp(-i (Phi_carrier + shift))``. What the window
    keeps of that has the angle ``Phi - Phi_carrier``.

    Parameters
    ----------
    photograph : (H, W) array
        Grey levels of ``I = A + B cos(Phi + shift)``.
    Phi_carrier : (H, W) array
        Phase of the fringes on a plane near the object, radians, as of `carrier`; its period is
        longer than 2 pixels.
    mask : (H, W) bool array, optional
        Pixels that count; by default all. What lies outside does not matter.
    width : float
        Half-width of the window (Hann) along the carrier, as a share of the carrier's
        frequency. At 1, the default, the window reaches zero where the background lies. A
        narrower one blurs edges and steep surfaces more, and lets less noise through.
    shift : float
        Phase shift of the photograph, radians: ``2 pi n / N`` of step n.

    Returns
    -------
    (H, W) float64 array
        phi, radians, in (-pi, pi]; NaN outside the mask.

    Notes
    -----
    Only fringes whose frequency stays within the window count: the surface may bend them by
    less than `width` times the carrier. A pitch with few periods across the object has no such
    room, and the phase returned is little more than the carrier's.

    Examples
    --------
    >>> Phi = 2 * np.pi / 8 * np.arange(64) * np.ones((64, 1))  # 8 pixels a period
    >>> phi = fourier_phase(100 + 50 * np.cos(Phi + 0.3), Phi)
    >>> float(phi[32, 32].round(3))
    0.3
    """
    image, Phi, mask = _checked(photograph, Phi_carrier, mask)
    lowpass = _window(Phi, mask, positive("width", width))
    contrast = image / _background(image, mask, lowpass) - 1
    turn = np.where(mask, np.exp(1j * Phi), 0)
    slow = lowpass(contrast * turn.conj()) * np.exp(-1j * shift)
    return np.where(mask, np.angle(slow * turn), np.nan)


def _background(image, mask, lowpass):
    """Mean grey level around each pixel, over the mask alone, (H, W)."""
    counted = lowpass(mask).real.clip(DARKEST)  # the window's ripples may go below zero
    return (lowpass(image).real / counted).clip(DARKEST * image[mask].mean())


def _window(Phi, mask, width):
    """A function that keeps the low frequencies of a picture (H, W): an elliptic Hann window."""
    f = _frequency(Phi, mask)
    reach = width * np.hypot(*f)
    # As many dark pixels more as the window is long, or opposite borders would mix.
    shape = [fft.next_fast_len(side + int(np.ceil(2 / reach))) for side in Phi.shape]
    fy, fx = np.meshgrid(*map(fft.fftfreq, shape), indexing="ij")
    y, x = f / np.hypot(*f)
    r = np.hypot(fx * x + fy * y, (fx * y - fy * x) / ACROSS) / reach
    window = np.where(r < 1, (1 + np.cos(np.pi * r)) / 2, 0)

    def lowpass(picture):
        kept = fft.ifft2(fft.fft2(picture, shape) * window)
        return kept[: Phi.shape[0], : Phi.shape[1]]

    return lowpass


def _frequency(Phi, mask):
    """Median frequency of the carrier within the mask, (2,): periods a pixel down and right."""
    slopes = np.stack(np.gradient(Phi))
    known = mask & np.isfinite(slopes).all(axis=0)
    f = np.median(slopes[:, known], axis=1) / TWO_PI if known.any() else np.zeros(2)
    if not 0 < np.hypot(*f) < 0.5:
        raise ValueError(
            f"carrier of {np.hypot(*f):.3g} periods a pixel given; more than 0 and less than "
            "0.5 are needed"
        )
    return f


def _checked(photograph, Phi_carrier, mask):
    image, Phi = (np.asarray(a, np.float64) for a in (photograph, Phi_carrier))
    mask = np.ones(image.shape, bool) if mask is None else np.asarray(mask, bool)
    if not (image.shape == Phi.shape == mask.shape and image.ndim == 2 and min(image.shape) > 1):
        raise ValueError(
            f"photograph {image.shape}, carrier {Phi.shape} and mask {mask.shape} given; all "
            "need one shape (H, W) of 2 x 2 pixels or more"
        )
    if not mask.any():
        raise ValueError("an empty mask given; at least one pixel must count")
    for name, a in (("photograph", image), ("carrier", Phi)):
        if not np.isfinite(a[mask]).all():
            raise ValueError(f"a {name} with NaN or infinite pixels in the mask given")
    if image[mask].mean() <= 0:
        raise ValueError("a photograph that is black in the mask given; a lit one is needed")
    return np.where(mask, image, 0), np.where(np.isfinite(Phi), Phi, np.nan), mask
