"""Minimum phase, refined reference: order without a unit frequency (paper, Eq. 8-11; chapter 5).

The equations take NumPy arrays or torch tensors; the phases of the geometry are NumPy.
"""

import numpy as np
from array_api_compat import array_namespace

from fpputil.checks import positive
from fpputil.decoding.triangulation import depth_of, triangulate
from fpputil.decoding.unwrap import TWO_PI, absolute_phase, fringe_order
from fpputil.optics.system import System


def minimum_phase(
    system: System, pitch: float, *, centred: bool = True, ambiguous: bool = False
) -> np.ndarray:
    """Phi_min: the least absolute phase within the measuring range (paper, Eq. 8). Chapter 5.

    It is the smaller of the phases on the planes z_min and z_max; which one that is depends
    on the side on which the projector stands.

    Parameters
    ----------
    system : System
    pitch : float
        Low pitch, projector pixels.
    centred : bool
        Lower Phi_min by half of the period that the range leaves free, so that noise has
        equal room at either end.
    ambiguous : bool
        Accept a range longer than one period, which is refused otherwise: the order is then right
        in a part of it only.

    Returns
    -------
    (H, W) float64 array
        Radians. Points outside the measuring range may get a wrong order without a sign of it.

    Examples
    --------
    >>> from fpputil.optics import preset
    >>> tiny = preset("tiny").system
    >>> Phi_min = minimum_phase(tiny, 304)
    >>> phi = 2 * np.pi * tiny.columns_at(650.0) / 304  # of a plane within the range
    >>> bool(0 < (phi - Phi_min)[60, 80] < 2 * np.pi)
    True
    """
    lower, upper = phase_range(system, pitch)
    span = upper - lower
    if not ambiguous and np.nanmax(span) >= TWO_PI:
        raise ValueError(
            f"measuring range {system.z_min} to {system.z_max} mm given; at pitch {pitch} it spans "
            f"{np.nanmax(span) / TWO_PI:.2f} periods, and the minimum phase needs less than one"
        )
    return lower - np.maximum(TWO_PI - span, 0) / 2 if centred else lower


def phase_range(system: System, pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest absolute phase within the measuring range. Chapter 5.

    (H, W) each, radians, of the part of the range that the projector can light; NaN where a ray
    of the camera is behind the projector at one end. ValueError if all are.

    >>> from fpputil.optics import preset
    >>> low, high = phase_range(preset("tiny").system, 24)
    >>> float(((high - low) / (2 * np.pi))[60, 80].round(2))  # orders that a point may have
    3.62
    """
    positive("pitch", pitch, "projector pixels")
    columns = [system.columns_at(z) for z in (system.z_min, system.z_max)]
    lit = np.clip(columns, -0.5, system.projector.width - 0.5)
    low, high = np.sort(TWO_PI * lit / pitch, axis=0)
    if np.isnan(high - low).all():
        raise ValueError(
            f"measuring range {system.z_min} to {system.z_max} mm given; no ray of the camera is "
            "in front of the projector at both ends"
        )
    return low, high


def depth_range(system: System, pitch: float, z: float) -> np.ndarray:
    """Depth, in mm from the plane z on, within which one period names the order. Chapter 5.

    (H, W), infinite where the column never moves by a whole pitch. Whether the projector lights the
    pixel at all is not asked.

    >>> from fpputil.optics import preset
    >>> float(depth_range(preset("tiny").system, 114, 480.0)[60, 40].round(1))
    279.5
    """
    start = system.columns_at(z)
    way = np.sign(system.columns_at(z + 1) - start)
    reach = depth_of(triangulate(start + way * pitch, system), system) - z
    return np.where(np.isfinite(reach) & (reach > 0), reach, np.inf)


def zmin_order(phi_z, Phi_min):
    """K_z = ceil((Phi_min - phi_z) / 2 pi) (paper, Eq. 9). Chapter 5.

    Of the wrapped and the minimum phase of the low pitch, (...), radians.

    >>> zmin_order(np.array([-1.0, 1.0]), np.array([5.0, 5.0]))
    array([1., 1.])
    """
    return array_namespace(phi_z, Phi_min).ceil((Phi_min - phi_z) / TWO_PI)


def refined_reference(Phi_t, K_z, pitch_t: float, pitch_z: float):
    """Refined wrapped reference and its components (paper, Eq. 10, 11). Chapter 5.

    Parameters
    ----------
    Phi_t : (...) array
        Absolute phase of the mid pitch from multi-frequency unwrapping (paper, Eq. 10), radians.
    K_z : (...) array
        Fringe order of the low pitch from the minimum phase.
    pitch_t, pitch_z : float
        Mid and low pitch, projector pixels.

    Returns
    -------
    phi_r, M_r, D_r : (...) arrays
        ``phi_r = Phi_t pitch_t / pitch_z - 2 pi K_z``, ``M_r = -sin(phi_r)``,
        ``D_r = cos(phi_r)``. K_z is whole, so it does not affect M_r and D_r.

    Examples
    --------
    >>> phi_r, M_r, D_r = refined_reference(np.array([8.0]), np.array([0.0]), 114, 304)
    >>> phi_r, float((M_r**2 + D_r**2)[0].round(6))
    (array([3.]), 1.0)
    """
    xp = array_namespace(Phi_t, K_z)
    phi_r = absolute_phase(Phi_t * (pitch_t / pitch_z), -K_z)
    return phi_r, -xp.sin(phi_r), xp.cos(phi_r)


def two_phase_absolute(phi_h, phi_z, Phi_min, pitch_h: float, pitch_z: float):
    """High pitch's Phi by two wrapped phases and the minimum phase (paper, Eq. 9, 6). Chapter 5.

    Parameters
    ----------
    phi_h, phi_z : (...) arrays
        Wrapped phases of the high and the low pitch, radians; phi_r serves as phi_z.
    Phi_min : (...) array
        Minimum phase of the low pitch, radians.
    pitch_h, pitch_z : float
        Projector pixels.

    Examples
    --------
    >>> column, Phi_min = np.array([500.0]), np.array([8.0])
    >>> phi_h, phi_z = (np.angle(np.exp(2j * np.pi * column / p)) for p in (24, 304))
    >>> (two_phase_absolute(phi_h, phi_z, Phi_min, 24, 304) * 24 / TWO_PI).round(6)
    array([500.])
    """
    Phi_z = absolute_phase(phi_z, zmin_order(phi_z, Phi_min))
    return absolute_phase(phi_h, fringe_order(phi_h, Phi_z, pitch_z / pitch_h))
