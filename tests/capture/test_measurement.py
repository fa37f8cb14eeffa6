"""A capture decoded fringe by fringe: against the geometry, and what a pixel is worth."""

import cv2
import matplotlib.pyplot as plt
import numpy as np
import pytest

from fpputil.capture.depth import locate
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.quality import Reason
from fpputil.capture.report import overview
from fpputil.capture.virtual import photograph
from fpputil.decoding.decoder import decode
from fpputil.decoding.triangulation import depth_of, triangulate
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
    result = measure(written(tmp_path, view, patterns, noise=0.5), axis, system=system)
    truth = view.column if axis == "column" else view.row
    off = (result.coordinate - truth)[result.mask]
    assert result.mask.sum() > 0.9 * view.mask.sum()
    assert np.abs(off).max() < 0.5 * min(f.pitch for f in result.fringes)
    assert np.sqrt(np.mean(off**2)) < 0.25
    assert np.isnan(result.Phi[~result.mask]).all()
    assert len(result.offsets) == len(result.sharpness) == len(result.fringes) - 1
    assert np.abs(result.offsets).max() < 0.05 and result.sharpness.min() > 0.9
    assert (result.reason[~view.mask] != Reason.GOOD).all()


def test_it_is_what_the_decoder_of_all_frames_finds(tmp_path, view):
    patterns = SETS["mf"]
    result = measure(written(tmp_path, view, patterns))
    frames = [f for _, f in photograph(view, patterns, SYSTEM, 0, noise=1.0)]
    whole = decode(np.stack(frames), patterns.fringes, 912)
    np.testing.assert_allclose(result.Phi[result.mask], whole.Phi[result.mask], atol=1e-3)
    np.testing.assert_allclose(result.modulation, whole.modulation, atol=1e-3)


def test_sixteen_bit_is_the_same_scene(tmp_path, view):
    patterns = SETS["mf"]
    eight = measure(written(tmp_path, view, patterns))
    for shot in patterns.shots():
        frame = cv2.imread(str(tmp_path / shot.file), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(tmp_path / shot.file), frame.astype(np.uint16) * 16)
    capture = open_capture(tmp_path, patterns, full=4080)
    np.testing.assert_allclose(measure(capture).Phi, eight.Phi, atol=1e-3)


@pytest.mark.slow
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


def test_gamma_is_estimated_or_taken(tmp_path, view):
    assert measure(written(tmp_path, view, SETS["mf"])).gamma == 1
    few = Patterns(PROJECTOR, fringe_set((912, 114, 24), (8, 8, 3)))
    capture = written(tmp_path, view, few, gamma=0.6)
    assert measure(capture).gamma == pytest.approx(0.6, rel=0.05)
    result = measure(capture, gamma=0.6)
    off = np.abs(result.coordinate - view.column)[result.mask]
    assert np.median(off) < 0.05


def test_the_overview_counts_grey_levels_and_modulations(tmp_path, view):
    result = measure(written(tmp_path, view, SETS["mf"]))
    fig = overview(result)
    lit = [frames[:, np.ptp(frames, axis=0) > 16] for frames in result.sample]
    for ax, values, top in ((fig.axes[1], lit, 256), (fig.axes[7], result.modulation, 128)):
        expected = [np.histogram(v, 64, (0, top))[0] for v in values]
        outlines = [patch.get_xy()[1:128:2, 1] for patch in ax.patches]
        np.testing.assert_array_equal(outlines, np.maximum(expected, ax.patches[0].get_xy()[0, 1]))
    plt.close(fig)


def test_points_are_those_of_the_columns_within_the_range(tmp_path, view):
    result = measure(written(tmp_path, view, SETS["mf"]))
    points = result.points(SYSTEM)
    depth = depth_of(points, SYSTEM)
    known = np.isfinite(depth)
    assert (result.mask[known]).all() and known.sum() > 0.95 * result.mask.sum()
    np.testing.assert_array_equal(
        points[known],
        triangulate(result.Phi.astype(float) * np.float64(24 / (2 * np.pi)), SYSTEM)[known],
    )
    sigma = locate([result], SYSTEM).sigma
    assert np.isfinite(sigma[known]).all()
    # how far the depth itself moves if every phase does by its sigma
    moved = result.Phi.astype(float) + result.sigma
    there = depth_of(triangulate(moved * 24 / (2 * np.pi), SYSTEM), SYSTEM)
    np.testing.assert_allclose(sigma[known], np.abs(there - depth)[known], rtol=0.01)


def test_photographs_that_are_too_many_to_be_kept_are_read_twice(taken, monkeypatch):
    capture = taken(Patterns((912, 1140), fringe_set((912, 114, 36), 3)), response=1.8)
    read, frames = [], type(capture).frames
    monkeypatch.setattr(type(capture), "frames", lambda self, k: read.append(k) or frames(self, k))
    once = measure(capture)
    assert read == [0, 1, 2]
    monkeypatch.setattr("fpputil.capture.measurement.KEPT", 0)
    np.testing.assert_array_equal(measure(capture).Phi, once.Phi)
    assert sorted(read) == [0, 0, 0, 1, 1, 1, 2, 2, 2]
