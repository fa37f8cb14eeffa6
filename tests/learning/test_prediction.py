"""Prediction from photographs of one's own: depth against the geometry, and what is warned of."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from fpputil.dataset.store import open_store
from fpputil.learning.prediction import (
    check_photographs,
    expected_photographs,
    predict,
    warnings,
    wrong_photographs,
)
from fpputil.learning.weights import Trained, load_weights
from fpputil.networks.methods import DLALNetMethod, PSNetMethod, SFNetMethod, SIDOMethod
from fpputil.optics.fringes import Fringe
from fpputil.optics.pinhole import Pinhole, camera_matrix
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import sphere
from fpputil.optics.system import System, preset

DATA = Path(__file__).parents[2] / "data"
PITCHES = {"high": 24, "mid": 114, "zmin": 304, "unit": 912}
ABOUT = {"pitches": PITCHES, "camera": [120, 160], "extremes": [0.0, 251.0]}
SFNET = Trained(SFNetMethod(base=2, levels=2), None, ABOUT)


@pytest.fixture(scope="module")
def trained():
    return load_weights(DATA / "weights/sfnet-tiny.safetensors")


def shoot(view, *pitches, **camera):
    return [view.frames(Fringe(p, 15), steps=[0], **camera)[0] for p in pitches]


def told(photographs):
    return wrong_photographs(photographs) + warnings(photographs)


def warned(view, tiny, *pitches, about=SFNET, **camera):
    return told(check_photographs(about, shoot(view, *pitches, **camera), tiny.system))


def test_depth_of_a_sphere(trained, sphere_view, tiny):
    shown = check_photographs(trained, shoot(sphere_view, 24, 114), tiny.system)
    found = predict(trained, shown, precision="float32")
    depth = sphere_view.depth
    at = np.where(sphere_view.mask, depth, 650)
    counts = found.mask & sphere_view.mask & (tiny.system.columns_per_mm(at) > 0.1)
    assert np.median(np.abs(found.depth - depth)[counts]) < 0.3
    assert counts.sum() > 0.9 * sphere_view.mask.sum()
    for name in ("phi_h", "phi_r", "Phi", "column", "depth"):
        values = getattr(found, name)
        assert values.dtype == np.float32 and values.shape == (120, 160), name
        np.testing.assert_array_equal(np.isfinite(values), found.mask, err_msg=name)
    np.testing.assert_allclose(found.column, found.Phi * 24 / (2 * math.pi), rtol=1e-6)
    inside = np.isfinite(found.points).all(axis=-1)
    np.testing.assert_allclose(found.points[inside][:, 2], found.depth[inside], rtol=1e-6)


def test_16_bit_weights_measure_alike(trained, sphere_view, tiny):
    shown = check_photographs(trained, shoot(sphere_view, 24, 114), tiny.system)
    fine, coarse = (predict(trained, shown, "cpu", p) for p in ("float32", "bfloat16"))
    assert np.nanmedian(np.abs(fine.Phi - coarse.Phi)) < 0.05
    assert next(trained.network.parameters()).dtype is torch.float32


def test_the_mask_is_that_of_the_modulation_but_for_rims(sphere_view, tiny):
    shown = check_photographs(SFNET, shoot(sphere_view, 24, 304), tiny.system)
    found, true = shown.fringes_seen, sphere_view.mask & (sphere_view.shade > 16 / 255)
    assert (found & ~true).sum() < 0.01 * true.sum() and (true & ~found).sum() < 0.05 * true.sum()
    bright = check_photographs(SFNET, shoot(sphere_view, 24, 304, ambient=60), tiny.system)
    assert (bright.fringes_seen ^ found).sum() < 0.02 * true.sum()  # light alone is no fringe


def test_views_of_a_dataset_are_not_odd():
    """Those the network was made for: a warning there is one too many; exchanged, each is told."""
    data = open_store(DATA / "tiny")
    views = [data.view(i) for split in data.splits() for i in data.indices(split)[::8]]
    assert len(views) > 9
    for view in views:
        assert told(check_photographs(SFNET, shoot(view, 24, 304), data.system)) == []
        swapped = check_photographs(SFNET, shoot(view, 304, 24), data.system)
        assert wrong_photographs(swapped) == ["photographs swapped: pitch 304 comes before 24"]


@pytest.mark.parametrize(
    "pitches, camera, said",
    [
        ((304, 24), {}, ["photographs swapped: pitch 304 comes before 24"]),
        ((24, 24), {}, ["photographs 1 and 2 show the same fringes"]),
        ((24, 304), {"gain": 0.3}, ["under-exposed: crests reach"]),
        ((24, 304), {"gain": 3.0}, ["photograph 1: ", "photograph 2: "]),
        ((24, 304), {"ambient": 30}, ["photograph 1: dark is grey level 30, in training 0"]),
    ],
)
def test_what_is_unlike_the_training_is_named(pitches, camera, said, sphere_view, tiny):
    found = warned(sphere_view, tiny, *pitches, **camera)
    assert found and all(any(f.startswith(s) for f in found) for s in said)


def test_a_range_longer_than_a_period_is_named(sphere_view, tiny):
    about = Trained(SFNetMethod(base=2, levels=2, reference="mid"), None, ABOUT)
    (said,) = warned(sphere_view, tiny, 24, 114, about=about)
    assert "480 to 820 mm is longer than a period of pitch 114" in said
    shorter = replace(tiny, system=replace(tiny.system, z_min=560, z_max=760))
    assert warned(sphere_view, shorter, 24, 114, about=about) == []


def test_saturation_is_a_share(sphere_view, tiny):
    found = warned(sphere_view, tiny, 24, 304, gain=3.0)
    assert any("of the lit pixels are saturated at 255" in f for f in found)
    found = warned(sphere_view, tiny, 24, 304, saturation=120.0)
    assert any("saturated at 120" in f for f in found)


def test_over_exposure_where_training_was_dark(sphere_view, tiny):
    dark = replace(SFNET, metadata=ABOUT | {"extremes": [0.0, 100.0]})
    found = warned(sphere_view, tiny, 24, 304, about=dark)
    assert any(f.startswith("over-exposed: crests reach") for f in found)


def test_another_size_is_named():
    system = preset("small").system
    view = raycast(sphere(100, (0, 0, 680)), system)
    (found,) = warned(view, preset("small"), 24, 304)
    assert "320 x 240 pixels; the network was trained with 160 x 120" in found
    assert "has 7.8 pixels" in found and "it had 3.9" in found


def test_a_rig_that_lies_on_its_side(sphere_view, tiny):
    """Camera and projector turned by a quarter: rows become columns, the warnings stay."""
    system = tiny.system
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    K = camera_matrix(system.camera.K[0, 0], 120, 160)
    lying = System(Pinhole(120, 160, K, turn), system.projector, system.z_min, system.z_max)
    view = raycast(sphere(100, (0, 0, 680)), lying)
    about = replace(SFNET, metadata=ABOUT | {"camera": [160, 120]})

    def said(*pitches):
        return told(check_photographs(about, shoot(view, *pitches), lying))

    assert said(24, 304) == [] and "swapped" in said(304, 24)[0]
    upright = check_photographs(SFNET, shoot(sphere_view, 24, 304), system)
    lain = check_photographs(about, shoot(view, 24, 304), lying)
    assert lain.axis == 0 and upright.axis == 1
    assert lain.period == pytest.approx(upright.period, rel=0.01)
    np.testing.assert_array_equal(np.rot90(lain.fringes_seen), upright.fringes_seen)


@pytest.mark.parametrize(
    "method, pitches",
    [
        (SIDOMethod(base=2, levels=2), ["24"]),
        (PSNetMethod(base=2, levels=2), ["24", "912"]),
        (DLALNetMethod(base=2, levels=2), ["24", "114", "912"]),
        (SFNetMethod(frames=2, base=2, levels=2), ["24", "24", "304", "304"]),
    ],
)
def test_every_method_says_what_it_wants_and_gets_it(method, pitches, sphere_view, tiny):
    torch.manual_seed(0)
    trained = Trained(method, method.network().eval(), ABOUT)
    assert [text.split()[1] for text in expected_photographs(trained)] == pitches
    images = [
        sphere_view.frames(Fringe(PITCHES[name], steps), steps=[step])[0]
        for name, steps, step in method.photographs
    ]
    shown = check_photographs(trained, images, tiny.system)
    assert told(shown) == []
    try:
        found = predict(trained, shown)  # of random weights: anything, or nothing in the range
    except ValueError as error:
        assert "none of" in str(error)
    else:
        assert np.isfinite(found.phi_r).any() == (method.reference is not None)


def test_two_of_three_swapped(sphere_view, tiny):
    trained = Trained(DLALNetMethod(base=2, levels=2), None, ABOUT)
    said = warned(sphere_view, tiny, 24, 912, 114, about=trained)
    assert said == ["photographs swapped: pitch 912 comes before 114"]


class Far(nn.Module):
    """A network that answers the same everywhere."""

    def __init__(self):
        super().__init__()
        self.weight = nn.Parameter(torch.zeros(1))

    def forward(self, frames):
        return torch.full((len(frames), 2, 2, *frames.shape[2:]), -1.0)


def test_grey_levels_go_in_as_in_the_training(sphere_view, tiny):
    about = ABOUT | {"extremes": [10.0, 210.0]}
    images = shoot(sphere_view, 24, 304)
    seen = []
    network = Far()
    network.register_forward_pre_hook(lambda _, given: seen.append(given[0].numpy()))
    trained = Trained(SFNET.method, network, about)
    try:
        predict(trained, check_photographs(trained, images, tiny.system), precision="float32")
    except ValueError as error:  # of what it makes of them nothing need be in the range
        assert "none of" in str(error)
    np.testing.assert_allclose(seen[0][0], (np.stack(images) - 10.0) / 200, atol=1e-6)


def test_points_lie_in_the_measuring_range(trained, sphere_view, tiny):
    near = replace(tiny.system, z_max=600.0)
    found = predict(trained, check_photographs(trained, shoot(sphere_view, 24, 114), near))
    inside = np.isfinite(found.points).all(axis=-1)
    np.testing.assert_array_equal(inside, (found.depth >= 480) & (found.depth <= 600))
    assert 0 < inside.sum() < found.mask.sum()


def test_nothing_in_the_measuring_range_is_an_error(sphere_view, tiny):
    near = replace(tiny.system, z_min=480.0, z_max=480.001)
    shown = check_photographs(SFNET, shoot(sphere_view, 24, 304), near)
    with pytest.raises(ValueError, match="none of .* has a depth of 480 to 480"):
        predict(replace(SFNET, network=Far()), shown)


def black(images):
    images[1] = np.zeros_like(images[1])


def nan(images):
    images[0] = images[0].astype(float)
    images[0][3, 4] = np.nan


def flat(images):
    images[:] = [np.full((120, 160), 90, np.uint8)] * 2


@pytest.mark.parametrize(
    "spoil, said",
    [
        (list.pop, "1 photographs given; 2 are needed: 1. pitch 24 .high., step 0 of 15; 2. pitch"),
        (black, "photograph 2 is black, its brightest grey level 0"),
        (nan, "photograph 1 with NaN"),
        (flat, "no fringes seen; a modulation above 8"),
        (lambda f: f.append(f.pop()[:, 1:]), "160 x 120, 159 x 120 pixels given; one size"),
        (lambda f: f.__setitem__(slice(2), [a[1:] for a in f]), "160 x 119 .* camera has 160 x 12"),
    ],
)
def test_what_cannot_be_used_is_an_error(spoil, said, sphere_view, tiny):
    images = shoot(sphere_view, 24, 304)
    spoil(images)
    with pytest.raises(ValueError, match=said):
        warnings(check_photographs(SFNET, images, tiny.system))


def test_weights_without_pitches(sphere_view, tiny):
    with pytest.raises(ValueError, match="do not say for which camera they are"):
        check_photographs(replace(SFNET, metadata={"pitches": PITCHES}), [], tiny.system)
