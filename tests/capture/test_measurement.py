"""A capture decoded photograph by photograph: against the geometry, and what a pixel is worth."""

import cv2
import numpy as np
import pytest

from fpputil.capture.marking import Reason
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.quality import Noise, noise_of, order_step
from fpputil.capture.virtual import photograph
from fpputil.decoding.decoder import decode
from fpputil.optics import shapes
from fpputil.optics.fringes import fringe_set
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import preset

SYSTEM = preset("tiny").system
PROJECTOR = (912, 1140)
SETS = {
    "mf": Patterns(PROJECTOR, fringe_set((912, 114, 24), 8), "mf"),
    "mw": Patterns(PROJECTOR, fringe_set((21, 23, 25.3), (8, 9, 8)), "mw"),
    "nt": Patterns(PROJECTOR, fringe_set((31, 33), 12), "nt", shift=-1),
    "minimum": Patterns(PROJECTOR, fringe_set((304, 24), 4), "minimum"),
    "rows": Patterns(PROJECTOR, fringe_set((1140, 114, 24), 6, axis="row")),
}


@pytest.fixture(scope="module")
def view():
    return raycast(shapes.sphere(100, [0, 0, 660]), SYSTEM)


def written(folder, view, patterns, kind=".png", **camera):
    camera = {"noise": 1.0, **camera}
    for shot, frame in photograph(view, patterns, SYSTEM, 0, **camera):
        cv2.imwrite(str(folder / shot.file), frame)
    return open_capture(folder, patterns)


@pytest.mark.parametrize("name", SETS)
def test_every_unwrapping_finds_the_columns(tmp_path, view, name):
    patterns = SETS[name]
    axis = patterns.axes[0]
    system = SYSTEM if name == "minimum" else None
    found = measure(written(tmp_path, view, patterns, noise=0.5), axis, system=system)
    truth = view.column if axis == "column" else view.row
    off = (found.coordinate - truth)[found.mask]
    assert found.mask.sum() > 0.9 * view.mask.sum()
    assert np.abs(off).max() < 0.5 * min(f.pitch for f in found.fringes)
    assert np.sqrt(np.mean(off**2)) < 0.25
    assert np.isnan(found.Phi[~found.mask]).all()
    assert (found.reason[~view.mask] != Reason.GOOD).all()


def test_it_is_what_the_decoder_of_all_frames_finds(tmp_path, view):
    patterns = SETS["mf"]
    found = measure(written(tmp_path, view, patterns))
    frames = [f for _, f in photograph(view, patterns, SYSTEM, 0, noise=1.0)]
    whole = decode(np.stack(frames), patterns.fringes, 912)
    np.testing.assert_allclose(found.Phi[found.mask], whole.Phi[found.mask], atol=1e-3)
    np.testing.assert_allclose(found.modulation, whole.modulation, atol=1e-3)


def test_sixteen_bit_is_the_same_scene(tmp_path, view):
    patterns = SETS["mf"]
    eight = measure(written(tmp_path, view, patterns))
    for shot in patterns.shots():
        frame = cv2.imread(str(tmp_path / shot.file), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(tmp_path / shot.file), frame.astype(np.uint16) * 16)
    capture = open_capture(tmp_path, patterns, full=4080)
    np.testing.assert_allclose(measure(capture).Phi, eight.Phi, atol=1e-3)


@pytest.mark.parametrize("steps, noise", [(3, 2.0), (4, 3.0), (8, 2.0), (15, 4.0)])
def test_the_predicted_uncertainty_is_that_of_many_trials(tmp_path, view, steps, noise):
    patterns = Patterns(PROJECTOR, fringe_set((912, 114, 24), steps), files="{pitch}-{step}.npy")
    trials = []
    for seed in range(80):
        shots = photograph(view, patterns, SYSTEM, seed, noise=noise, ambient=20, quantise=False)
        for shot, frame in shots:
            np.save(tmp_path / shot.file, frame.astype(np.float32))
        trials.append(
            measure(open_capture(tmp_path, patterns), noise=noise if steps == 3 else None)
        )
    Phi = np.stack([t.Phi for t in trials])
    sigma = np.stack([t.sigma for t in trials])
    use = np.isfinite(Phi).all(axis=0) & (trials[0].modulation[-1] > 20)
    assert use.sum() > 1000
    ratio = np.sqrt(Phi[:, use].var(axis=0, ddof=1).mean() / (sigma[:, use] ** 2).mean())
    assert ratio == pytest.approx(1, abs=0.05)
    B = trials[0].modulation[-1][use]
    for low, high in ((20, 40), (40, 200)):
        some = (B >= low) & (B < high)
        if some.sum() > 200:
            one = np.sqrt(Phi[:, use][:, some].var(axis=0, ddof=1).mean())
            assert np.sqrt((sigma[:, use][:, some] ** 2).mean()) == pytest.approx(one, rel=0.05)


def test_reasons_tell_dark_saturated_unsure_and_outside(tmp_path, view):
    bright = measure(written(tmp_path, view, SETS["mf"], gain=1.6))
    shots = photograph(view, SETS["mf"], SYSTEM, 0, noise=1.0, gain=1.6)
    clipped = (np.stack([frame for _, frame in shots]) == 255).any(axis=0)
    assert clipped[bright.reason == Reason.SATURATED].all()
    assert (bright.reason[~view.mask] == Reason.DARK).mean() > 0.99
    few = Patterns(PROJECTOR, fringe_set((912, 24), 3))
    noisy = measure(written(tmp_path, view, few, noise=8.0), noise=8.0)
    wrong = np.abs(noisy.coordinate - view.column) > 12
    assert (noisy.reason == Reason.UNSURE).sum() > 100
    assert not wrong[noisy.mask].any()


def test_the_noise_is_found_as_a_line_over_the_grey_level():
    rng = np.random.default_rng(0)
    level = rng.uniform(30, 200, 40000)
    for steps in (4, 5, 8, 12, 20):
        phi = rng.uniform(-3, 3, 40000) + 2 * np.pi * np.arange(steps)[:, None] / steps
        frames = level + 25 * np.cos(phi)
        frames = frames + np.sqrt(2 + 0.03 * frames) * rng.standard_normal(frames.shape)
        found = noise_of([frames], 8)
        for grey in (50, 180):
            assert found.variance(grey) == pytest.approx(2 + 0.03 * grey, rel=0.1)
    assert not noise_of([rng.uniform(0, 255, (3, 4000))], 8).known
    assert Noise(0, 0, True).variance(5) == pytest.approx(1 / 12)


def test_a_power_is_estimated_or_taken(tmp_path, view):
    assert measure(written(tmp_path, view, SETS["mf"])).power == 1
    some = Patterns(PROJECTOR, fringe_set((912, 114, 24), (8, 8, 3)))
    capture = written(tmp_path, view, some, gamma=0.6)
    assert measure(capture).power == pytest.approx(1 / 0.6, rel=0.05)
    given = measure(capture, power=1 / 0.6)
    off = np.abs(given.coordinate - view.column)[given.mask]
    assert np.median(off) < 0.05


def test_order_steps_are_how_far_columns_part():
    assert [order_step(m, 30, 24) for m in ("mf", "mw", "nt", "minimum")] == [24, 6, 6, 24]


@pytest.mark.parametrize(
    "patterns, how, said",
    [
        (SETS["mf"], {"axis": "row"}, "axis 'row' given; the patterns have column"),
        (SETS["minimum"], {}, "no system given"),
        (SETS["minimum"], {"system": preset("small").system}, "the photographs have 160 x 120"),
        (Patterns(PROJECTOR, fringe_set((24, 912), 3)), {}, "they must descend strictly"),
        (Patterns(PROJECTOR, fringe_set((114, 24), 3)), {}, "must cover the whole projector"),
        (Patterns(PROJECTOR, fringe_set((14, 15), 3), "mw"), {}, "of their beats"),
    ],
)
def test_what_cannot_be_decoded_is_named(tmp_path, view, patterns, how, said):
    capture = written(tmp_path, view, patterns)
    with pytest.raises(ValueError) as error:
        measure(capture, **how)
    assert said in str(error.value)
