"""The phase of one photograph against closed forms and the geometry."""

from dataclasses import replace

import numpy as np
import pytest

from fpputil.decoding.fourier import carrier, fourier_phase
from fpputil.decoding.unwrap import wrap
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import System

V, U = np.mgrid[:120, :160].astype(float)
INSIDE = (slice(20, -20), slice(20, -20))
BUMP = 3 * np.exp(-((U - 90) ** 2 + (V - 50) ** 2) / (2 * 25**2))  # radians, at most 0.07 a pixel


def photograph(Phi, shade=100.0, contrast=1.0):
    return shade * (1 + contrast * np.cos(Phi))


def upside_down(system):
    turn, p = np.diag([-1.0, -1, 1]), system.projector
    return replace(system, projector=replace(p, R=turn @ p.R, t=turn @ p.t))


@pytest.mark.parametrize("right, down", [(1.5, 0), (-1.5, 0), (1.2, 0.6), (-0.5, -1.3), (0, 1.2)])
@pytest.mark.parametrize("contrast", [1.0, 0.3])
def test_smooth_phase_on_a_straight_carrier(right, down, contrast):
    Phi_carrier = right * U + down * V + 0.4
    Phi = Phi_carrier + BUMP
    phi = fourier_phase(photograph(Phi, contrast=contrast), Phi_carrier)
    error = wrap(phi - Phi)
    assert np.abs(error[INSIDE]).max() < 0.02
    assert np.abs(error).max() < 0.4  # at the border half of the window is dark
    assert (np.abs(phi) <= np.pi).all()


@pytest.mark.parametrize("step", range(5))
def test_shift_is_taken_off(step):
    Phi_carrier, delta = 1.5 * U, 2 * np.pi * step / 5
    phi = fourier_phase(photograph(Phi_carrier + BUMP + delta), Phi_carrier, shift=delta)
    assert np.abs(wrap(phi - Phi_carrier - BUMP)[INSIDE]).max() < 0.02


@pytest.mark.parametrize("tilt", [-0.1, 0.1])
def test_a_tilt_is_damped_in_length_not_in_angle(tilt):
    """The window passes one frequency off the carrier with no error of phase."""
    Phi = (1.5 + tilt) * U
    assert np.abs(wrap(fourier_phase(photograph(Phi), 1.5 * U) - Phi)[INSIDE]).max() < 5e-3


@pytest.mark.parametrize(
    "pose, along_row, with_depth",
    [(lambda system: system, 1, 1), (System.mirrored, 1, -1), (upside_down, -1, -1)],
)
def test_signs_are_those_of_the_geometry(tiny, pose, along_row, with_depth):
    system = pose(tiny.system)
    Phi_carrier = carrier(system, 24)
    assert (np.sign(np.diff(Phi_carrier, axis=1)) == along_row).all()
    deeper = carrier(system, 24, 700.0) - Phi_carrier
    assert (np.sign(deeper)[:, 20:140] == with_depth).all()
    z = 660 + 30 * np.cos((U - 80) / 25) * np.cos((V - 60) / 30)
    Phi = Fringe(24).phase(system.columns_at(z))
    phi = fourier_phase(photograph(Phi), Phi_carrier)
    assert np.abs(wrap(phi - Phi)[INSIDE]).max() < 0.03


def test_the_carrier_is_the_phase_of_the_middle_plane(tiny):
    system = tiny.system
    expected = Fringe(24).phase(system.columns_at(650.0))
    np.testing.assert_allclose(carrier(system, 24), expected, rtol=1e-12)
    np.testing.assert_allclose(carrier(system, 24, 650.0), expected, rtol=1e-12)


@pytest.mark.parametrize("outside", [0.0, 1e6, np.nan, -np.inf])
def test_outside_the_mask_nothing_matters(outside):
    Phi_carrier = 1.5 * U
    I = photograph(Phi_carrier + BUMP)
    mask = np.hypot(U - 80, V - 60) < 40
    phi = fourier_phase(np.where(mask, I, outside), Phi_carrier, mask)
    np.testing.assert_array_equal(np.isnan(phi), ~mask)
    np.testing.assert_array_equal(phi, fourier_phase(I, Phi_carrier, mask))
    assert np.abs(wrap(phi - Phi_carrier - BUMP)[mask]).max() < 0.4


def test_a_dark_background_may_count(sphere_view, tiny):
    """Black pixels have no phase to be right about; those of the sphere still have."""
    fringe, Phi_carrier = Fringe(24), carrier(tiny.system, 24)
    I = sphere_view.frames(fringe)[0]
    phi = fourier_phase(I, Phi_carrier)
    np.testing.assert_allclose(phi, fourier_phase(I / 3, Phi_carrier), atol=1e-6)
    error = np.abs(wrap(phi - fringe.phase(sphere_view.column)))[sphere_view.mask]
    assert np.median(error) < 0.02


@pytest.mark.parametrize("outside", [np.nan, np.inf])
def test_a_carrier_that_ends_outside_the_mask(outside):
    mask = np.hypot(U - 80, V - 60) < 40
    Phi_carrier = np.where(np.hypot(U - 80, V - 60) < 41, 1.5 * U, outside)
    phi = fourier_phase(photograph(1.5 * U + BUMP), Phi_carrier, mask)
    np.testing.assert_array_equal(phi, fourier_phase(photograph(1.5 * U + BUMP), 1.5 * U, mask))


def test_opposite_borders_do_not_mix():
    """A photograph dark on the left: its right border sees the same as it does without that."""
    Phi_carrier = 1.5 * U
    I = photograph(Phi_carrier + BUMP)
    changed = np.where(U < 20, photograph(Phi_carrier + 2.0), I)
    phi, other = (fourier_phase(x, Phi_carrier)[:, 140:] for x in (I, changed))
    assert np.abs(wrap(phi - other)).max() < 1e-3


@pytest.mark.parametrize(
    "scene, name, median, mean",
    [("sphere_view", "tiny", 0.02, 0.06), ("paper_sphere_view", "paper", 0.01, 0.06)],
)
def test_sphere_against_its_columns(request, scene, name, median, mean):
    view, preset = request.getfixturevalue(scene), request.getfixturevalue(name)
    fringe = Fringe(preset.pitches.high)
    I = view.frames(fringe)[0]
    phi = fourier_phase(I, carrier(preset.system, preset.pitches.high), view.mask)
    error = np.abs(wrap(phi - fringe.phase(view.column)))[view.mask]
    assert np.median(error) < median and error.mean() < mean


def test_shade_does_not_pass_for_a_fringe():
    """Less the mean of the whole picture, not divided by the local one, it would be 0.03."""
    Phi_carrier = 1.5 * U
    shade = 100 * (1 + 0.8 * np.cos(U / 12))
    error = wrap(fourier_phase(photograph(Phi_carrier, shade), Phi_carrier) - Phi_carrier)
    assert np.abs(error[INSIDE]).max() < 0.01


def test_a_bright_half_leaves_the_dim_half_readable():
    """The window's ripples, a hundred times brighter than the dim half, must not invert it."""
    Phi_carrier = 1.5 * U
    I = photograph(Phi_carrier, np.where(U < 80, 100.0, 1.0))
    error = np.abs(wrap(fourier_phase(I, Phi_carrier) - Phi_carrier))
    assert error[:, :76].max() < 0.04 and error[:, 84:].mean() < 0.06


def test_a_pitch_of_few_periods_is_beyond_the_method(sphere_view, tiny):
    """At pitch 304 a sphere's phase comes out hardly better than that of the plane behind it."""
    coarse, fine = Fringe(304), Fringe(24)
    mask = sphere_view.mask

    def error(fringe):
        Phi_carrier, Phi = carrier(tiny.system, fringe.pitch), fringe.phase(sphere_view.column)
        phi = fourier_phase(sphere_view.frames(fringe)[0], Phi_carrier, mask)
        return [np.median(np.abs(wrap(p - Phi))[mask]) for p in (phi, Phi_carrier)]

    found, plane = error(fine)
    assert found < plane / 20
    found, plane = error(coarse)
    assert found > plane / 2
