"""What decoding refuses, and in which words: one case for each kind of error."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from fpputil.decoding import fourier, phase_height, pointcloud, triangulation, unwrap
from fpputil.decoding.decoder import decode
from fpputil.decoding.geometric_constraint import minimum_phase
from fpputil.decoding.noise import order_error_rate
from fpputil.decoding.phase import numerator_denominator
from fpputil.optics.fringes import Fringe, fringe_set
from fpputil.optics.system import preset

FRINGES = fringe_set((912, 114, 15), 4)
TWO = [np.zeros((3, 3))] * 2
POINTS = np.zeros((5, 3))
RANDOM = np.random.default_rng(0).random((9, 3))
RAMP = 1.5 * np.arange(20.0) * np.ones((20, 1))
IMAGE = 100 + 50 * np.cos(RAMP)
HOLE = np.where(RAMP == 15, np.nan, IMAGE)


def frames(*shape, dtype=np.uint8, fill=0):
    return np.full(shape, fill, dtype)


def system():
    return preset("tiny").system


PHASE = [
    (lambda: numerator_denominator(frames(2, 5, 6)), "2 frames given; phase shifting needs"),
    (lambda: numerator_denominator([*TWO, np.zeros((3, 4))]), "sizes"),
    (lambda: numerator_denominator([*TWO, frames(3, 3)]), "dtypes"),
    (lambda: numerator_denominator(frames(4, 5, 6, dtype=float, fill=np.nan)), "NaN"),
    (lambda: numerator_denominator(torch.full((4, 5, 6), np.inf)), "NaN or infinite"),
    (lambda: numerator_denominator(frames(4, 5, 6, dtype=complex)), "complex"),
    (lambda: numerator_denominator(frames(4, 0, 6)), "no pixel"),
    (lambda: numerator_denominator([]), "0 frames given"),
    (lambda: numerator_denominator([[1, 2], [3, 4]]), "frames of type list given"),
]
UNWRAP = [
    (lambda: unwrap.mf_tpu(TWO, (912, 912), 912), "must descend"),
    (lambda: unwrap.mf_tpu(TWO, (500, 15), 912), "pitch 500 on 912 columns"),
    (lambda: unwrap.mf_tpu(TWO, (912, 114, 15), 912), "2 phases and 3 pitches"),
    (lambda: unwrap.mf_tpu([], [], 912), "0 phases"),
    (lambda: unwrap.mf_tpu(TWO, (912, np.nan), 912), "pitch nan given"),
    (lambda: unwrap.mf_tpu(TWO, (912, 15), np.nan), "width nan given"),
    (lambda: unwrap.guard_columns(-1.0, 912), "sigma_phi -1.0 given"),
    (lambda: unwrap.mw_tpu(TWO, (16, 15), 912), "must ascend"),
    (lambda: unwrap.mw_tpu(TWO, (14, 15), 912), r"\[14, 15\] given; .* pitch 210.0 on 912"),
    (lambda: unwrap.mw_tpu([*TWO, TWO[0]], (10, 12, 15), 912), r"\[10, 12, 15\] given"),
    (lambda: unwrap.nt_tpu(TWO, (15.5, 64), 912), "whole pitches"),
    (lambda: unwrap.nt_tpu([*TWO, TWO[0]], (3, 5, 7), 912), "two phases"),
    (lambda: unwrap.spatial(TWO[0], np.zeros((3, 3), bool)), "empty mask"),
    (lambda: order_error_rate(8, 50, (15, 15), (912, 114, 15)), "2 phases and 3 pitches"),
    (lambda: order_error_rate(0, 50, 15, (912, 15)), "noise 0 given"),
]
DECODER = [
    (lambda: decode(frames(11, 4, 4), FRINGES, 912), "11 frames given; the fringes have 12"),
    (lambda: decode(frames(12, 4), FRINGES, 912), r"takes \(N, H, W\)"),
    (lambda: decode(frames(12, 4, 4, dtype=bool), FRINGES, 912), "dtype bool"),
    (lambda: decode(frames(12, 4, 4), FRINGES[::-1], 912), "must descend"),
    (lambda: decode(frames(8, 4, 4), FRINGES[1:], 912), "pitch 114 on 912 columns"),
    (lambda: decode(frames(12, 4, 4), FRINGES, 912), "no pixel with modulation above 8"),
    (lambda: decode(torch.zeros((12, 4, 4)), FRINGES, 912), "torch tensors given"),
    (lambda: decode(frames(8, 4, 4), (FRINGES[0], Fringe(15, 4, axis="row")), 912), "one axis"),
]
DEPTH = [
    (
        lambda: triangulation.triangulate(np.zeros((10, 10)), system()),
        r"shape \(10, 10\) given; the camera has \(120, 160\)",
    ),
    (lambda: phase_height.fit_phase_height(np.zeros((2, 4, 4)), (1, 2), 2), "a fit needs"),
    (lambda: phase_height.fit_phase_height(np.zeros((4, 4)), (1, 2)), "a fit needs"),
    (lambda: phase_height.fit_phase_height(np.zeros((2, 4, 4)), (1, np.nan)), "must be finite"),
    (lambda: pointcloud.fit_sphere(POINTS[:3]), "P >= 4"),
    (lambda: pointcloud.fit_sphere(RANDOM * (1, 1, 1e-11)), "points in a plane"),
    (lambda: pointcloud.fit_sphere(POINTS + np.nan), "NaN"),
    (lambda: pointcloud.fit_plane(np.arange(9.0)[:, None] * np.ones(3)), "on a line"),
    (lambda: pointcloud.fit_plane(POINTS[:, :2]), r"\(P, 3\) is needed"),
    (lambda: pointcloud.point_cloud(np.full((4, 4, 3), np.nan)), "no finite point"),
    (lambda: pointcloud.surface(np.full((4, 4, 3), np.nan)), "no triangle"),
    (lambda: pointcloud.save_ply("x.obj", POINTS), "ends in .ply"),
    (lambda: pointcloud.save_ply("x.ply", POINTS, np.zeros((3, 3), np.uint8)), "colours"),
    (lambda: pointcloud.save_ply("x.ply", POINTS, POINTS), "colours"),
    (lambda: pointcloud.save_ply("no/x.ply", POINTS), "does not exist"),
]
FOURIER = [
    (lambda: fourier.carrier(system(), 0), "pitch 0"),
    (lambda: fourier.carrier(system(), 24, -5), "z -5 given"),
    (lambda: fourier.fourier_phase(IMAGE, RAMP[:-1]), "one shape"),
    (lambda: fourier.fourier_phase(IMAGE[:1], RAMP[:1]), "2 x 2 pixels or more"),
    (lambda: fourier.fourier_phase(HOLE, RAMP), "photograph with NaN or infinite pixels"),
    (lambda: fourier.fourier_phase(IMAGE, RAMP + 0 * HOLE), "carrier with NaN or infinite pixels"),
    (lambda: fourier.fourier_phase(IMAGE, RAMP, RAMP < 0), "empty mask"),
    (lambda: fourier.fourier_phase(0 * RAMP, RAMP), "black in the mask"),
    (lambda: fourier.fourier_phase(IMAGE, 0 * RAMP), "carrier of 0 periods a pixel"),
    (lambda: fourier.fourier_phase(IMAGE, RAMP, None, -1), "width -1 given"),
]


def looking_away():
    """The projector turned round: nothing of what the camera sees is in front of it."""
    pair = system()
    return replace(pair, projector=replace(pair.projector, R=np.diag([-1.0, 1.0, -1.0])))


GEOMETRY = [
    (
        lambda: minimum_phase(looking_away(), 304),
        "820.0 mm given; no ray of the camera is in",
    ),
]


@pytest.mark.parametrize("call, words", [*PHASE, *UNWRAP, *DECODER, *DEPTH, *FOURIER, *GEOMETRY])
def test_refused(call, words):
    with pytest.raises((ValueError, FileNotFoundError), match=words):
        call()
