"""Edges, waves and creases on pictures whose answer is known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from fpputil.dataset.synthfringe import SynthFringe
from fpputil.experiments.error_analysis import DISTANCES, ErrorAnalysis, edge_distance, edges_of

SIZE = (40, 60)


def view(Phi, modulation=None, mask=None):
    mask = np.ones(SIZE, bool) if mask is None else mask
    modulation = np.full(SIZE, 60.0) if modulation is None else modulation
    return {"mask": mask, "Phi": Phi, "modulation": np.where(mask, modulation, 0)}


def found(Phi, phi_h=None):
    return SimpleNamespace(Phi=Phi, phi_h=Phi if phi_h is None else phi_h)


def slanted():
    v, u = np.mgrid[: SIZE[0], : SIZE[1]].astype(float)
    return 0.9 * u + 0.1 * v


def test_edges_lie_where_the_photograph_steps():
    modulation = np.full(SIZE, 60.0)
    modulation[:, 30:] = 20
    edges = edges_of(modulation)
    assert edges[5:-5].any(axis=1).all()
    columns = np.argwhere(edges)[:, 1]
    assert set(columns) <= {29, 30}
    distance = edge_distance(modulation)
    np.testing.assert_allclose(distance[20, 40] - distance[20, 35], 5, atol=1e-3)
    assert np.isinf(edge_distance(np.full(SIZE, 60.0))).all()


def test_errors_are_sorted_by_distance():
    modulation = np.full(SIZE, 60.0)
    modulation[:, 30:] = 20
    Phi, distance = slanted(), edge_distance(modulation)
    off = np.where(distance < 2, 7.0, 0.5)
    inspection = ErrorAnalysis()
    inspection.add(view(Phi, modulation), found(Phi + off))
    summary = inspection.summary()
    assert summary["edge_mae"][:2] == [pytest.approx(7), pytest.approx(7)]
    assert summary["edge_mae"][2:] == pytest.approx([0.5] * (len(DISTANCES) - 3), abs=1e-9)
    assert summary["edge_orders"][:3] == [1, 1, 0]
    assert sum(summary["edge_pixels"]) == pytest.approx(1)


@pytest.mark.parametrize("harmonic", [1, 2, 4])
def test_waves_are_found_at_their_harmonic(harmonic):
    Phi = slanted()
    rng = np.random.default_rng(0)
    inspection = ErrorAnalysis()
    for turn in (0.0, 1.0):  # of another phase in every view
        e = 0.2 * np.cos(harmonic * Phi + turn)
        inspection.add(view(Phi), found(Phi, Phi + e + 0.05 * rng.standard_normal(SIZE)))
    summary = inspection.summary()
    amplitudes = np.array(summary["waves"])
    assert amplitudes[harmonic - 1] == pytest.approx(0.2, rel=0.05)
    assert np.delete(amplitudes, harmonic - 1).max() < 0.02
    assert max(summary["floor"]) < 0.02
    assert summary["rms"] == pytest.approx(math.sqrt(0.02 + 0.0025), rel=0.05)


def test_an_offset_and_a_smooth_error_are_no_waves():
    v, u = np.mgrid[: SIZE[0], : SIZE[1]].astype(float)
    inspection = ErrorAnalysis()
    inspection.add(view(slanted()), found(slanted(), slanted() + 0.05))
    assert max(inspection.summary()["waves"]) < 1e-6
    inspection = ErrorAnalysis()
    for turn in range(4):
        smooth = 0.1 * np.sin(u / 9 + v / 11 + turn)
        inspection.add(view(slanted()), found(slanted(), slanted() + smooth))
    summary = inspection.summary()
    assert max(summary["waves"][1:]) < 2 * max(summary["floor"]) < 0.02


@pytest.mark.parametrize("fringes", [0.1, 0.5, 1.5])
def test_a_view_of_few_fringes_does_not_invent_waves(fringes):
    """So few that the terms are much alike, and a noisy error would blow them up."""
    u = np.mgrid[: SIZE[0], : SIZE[1]][1]
    Phi = 40 + 2 * math.pi * fringes * u / SIZE[1]
    e = 0.05 * np.random.default_rng(0).standard_normal(SIZE)
    inspection = ErrorAnalysis()
    inspection.add(view(Phi), found(Phi, Phi + e))
    summary = inspection.summary()
    assert max(summary["waves"] + summary["floor"]) < 0.02


def test_a_few_wild_pixels_are_no_waves():
    e = np.zeros(SIZE)
    e[::7, ::5] = 3.0
    inspection = ErrorAnalysis()
    inspection.add(view(slanted()), found(slanted(), slanted() + e))
    assert max(inspection.summary()["waves"]) < 1e-6


def test_the_truth_is_sharp_in_real_views(small_set):
    data = SynthFringe(small_set, "training")
    inspection = ErrorAnalysis()
    for k in range(6):
        item = {name: value.numpy() for name, value in data[k].items()}
        inspection.add(item, found(item["Phi"], np.angle(np.exp(1j * item["Phi"]))))
    assert inspection.summary()["sharpness"] == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_sharpness_is_the_share_of_a_crease_that_is_left(share):
    Phi = slanted()
    bent = 0.4 * np.abs(np.mgrid[: SIZE[0], : SIZE[1]][1] - 30)
    inspection = ErrorAnalysis()
    guess = Phi + share * bent
    inspection.add(view(Phi + bent), found(guess, np.angle(np.exp(1j * guess))))
    assert inspection.summary()["sharpness"] == pytest.approx(share, abs=1e-6)


def test_wrapped_or_not_and_with_a_hole():
    Phi = slanted() + 0.3 * np.sin(np.mgrid[: SIZE[0], : SIZE[1]][0])
    mask = np.ones(SIZE, bool)
    mask[10:20, 10:20] = False
    one, two = ErrorAnalysis(), ErrorAnalysis()
    one.add(view(Phi, mask=mask), found(Phi))
    two.add(view(Phi, mask=mask), found(Phi, np.where(mask, np.angle(np.exp(1j * Phi)), 3.0)))
    assert one.summary()["sharpness"] == pytest.approx(two.summary()["sharpness"]) == 1


def test_nothing_to_measure_is_nan():
    summary = ErrorAnalysis().summary()
    assert math.isnan(summary["sharpness"]) and math.isnan(summary["rms"])


def test_texture_darkens_blotches_and_keeps_the_surface(small_set):
    plain, printed = (SynthFringe(small_set, "training", texture=t)[2] for t in (0.0, 0.5))
    seen = (plain["mask"] & printed["mask"]).numpy()
    ratio = (printed["modulation"] / plain["modulation"]).numpy()[seen]
    dark = np.abs(ratio - 0.5) < 0.03
    assert (dark | (np.abs(ratio - 1) < 0.03)).mean() > 0.97 and 0.2 < dark.mean() < 0.8
    assert np.abs((plain["Phi"] - printed["Phi"]).numpy()[seen]).max() < 0.3
    for wrong in (1.0, -0.1):
        with pytest.raises(ValueError, match=f"texture {wrong} given"):
            SynthFringe(small_set, "training", texture=wrong)


def test_edges_are_those_of_white_light_which_is_twice_as_bright():
    step = np.repeat([[60.0] * 6 + [45.0] * 6], 8, axis=0)  # 30 grey levels, four pixels' worth
    assert np.flatnonzero(edges_of(step)[4]).tolist() == [5]
    assert not edges_of(step / 2).any()
