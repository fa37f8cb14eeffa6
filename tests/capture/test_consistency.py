"""Photographs against one another, through any response, flickering or square."""

import numpy as np
import pytest

from fpputil.capture.faults.consistency import (
    doubled,
    exchanged,
    flicker_of,
    flickers_of,
    misfits,
)
from fpputil.capture.patterns import Patterns
from fpputil.optics import shapes
from fpputil.optics.fringes import Fringe, fringe_set
from fpputil.optics.parts import part
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import preset

PROJECTOR, SYSTEM = (912, 1140), preset("small").system
LIGHTS = {
    "linear": lambda c: (1 + c) / 2,
    "gamma 2.2": lambda c: ((1 + c) / 2) ** 2.2,
    "gamma 0.5": lambda c: ((1 + c) / 2) ** 0.5,
    "square": lambda c: np.clip(0.5 + 6 * c, 0, 1),
}


def photographs(steps, light="linear", flicker=0.0, seed=0, pixels=400):
    rng = np.random.default_rng(seed)
    turn = rng.uniform(-np.pi, np.pi, pixels) + 2 * np.pi * np.arange(steps)[:, None] / steps
    frames = 10 + rng.uniform(60, 180, pixels) * LIGHTS[light](np.cos(turn))
    gains = 1 + flicker * rng.uniform(-1, 1, steps)
    frames = frames * gains[:, None] + rng.standard_normal(frames.shape)
    return frames, gains / gains.mean()


CASES = [
    *((steps, light) for steps in (6, 8, 12) for light in ("linear", "gamma 2.2", "gamma 0.5")),
    (18, "square"),
    (12, "square"),
]


@pytest.mark.parametrize("flicker", [0.0, 0.08])
@pytest.mark.parametrize("steps, light", CASES)
def test_faults_are_named_through_a_response_and_a_flicker(steps, light, flicker):
    frames, _ = photographs(steps, light, flicker)
    assert doubled(frames) is None and exchanged(frames) is None and misfits(frames) == []
    noise = np.random.default_rng(1).standard_normal(frames[0].shape)
    for a, b in ((2, 3), (steps - 1, 0)):
        twice = frames.copy()
        twice[b] = frames[a] + noise
        assert set(doubled(twice)) == {a, b}
        if light != "square":
            assert doubled(twice) == (b, a)  # the one to take again comes first
        order = list(range(steps))
        order[a], order[b] = b, a
        assert set(exchanged(frames[order])) == {a, b}
        assert doubled(frames[order]) is None


@pytest.mark.parametrize("light", ["linear", "gamma 2.2"])
def test_a_photograph_between_two_steps_is_late(light):
    frames, _ = photographs(8, light)
    frames[5] = (frames[5] + frames[4]) / 2
    assert misfits(frames) == [5]


@pytest.mark.parametrize("light", ["linear", "gamma 2.2"])
@pytest.mark.parametrize("steps", [6, 8, 12, 18])
def test_the_brightness_of_each_photograph_is_found_where_it_flickers(steps, light):
    frames, gains = photographs(steps, light, 0.08)
    np.testing.assert_allclose(flicker_of(frames), gains, atol=0.01)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("steps", [4, 5, 8, 12, 18])
def test_a_steady_light_does_not_flicker(steps, light):
    assert (flicker_of(photographs(steps, light)[0]) == 1).all()


SETS = [(4, 4, 4), (3, 3, 3), (4,), (8, 3, 3)]


@pytest.mark.parametrize("steps", SETS)
def test_the_brightness_of_few_steps_is_found_by_all_pitches_together(steps):
    rng = np.random.default_rng(5)
    albedo = rng.uniform(60, 180, 400)

    def shots(flicker):
        for number in steps:
            turn = rng.uniform(-np.pi, np.pi, 400) + 2 * np.pi * np.arange(number)[:, None] / number
            gains = 1 + flicker * rng.uniform(-1, 1, number)
            light = 10 + albedo * (1 + np.cos(turn)) / 2
            yield light * gains[:, None] + rng.standard_normal(light.shape), gains / gains.mean()

    frames, gains = zip(*shots(0.08), strict=True)
    for found, true in zip(flickers_of(frames), gains, strict=True):
        np.testing.assert_allclose(found, true, atol=0.01)
    frames, _ = zip(*shots(0.0), strict=True)
    assert all((found == 1).all() for found in flickers_of(frames))


def test_three_steps_alone_tell_no_brightness():
    frames, _ = photographs(3, flicker=0.08)
    assert (flickers_of([frames])[0] == 1).all()


@pytest.mark.parametrize("steps", [3, 4, 5, 8, (8, 8, 3)])
def test_flicker_is_told_and_divided_out(judged, error, steps):
    rng = np.random.default_rng(3)

    def wheel(frames):
        return {
            name: np.clip(np.rint(frame * (1 + 0.08 * rng.uniform(-1, 1))), 0, 255).astype("u1")
            for name, frame in frames.items()
        }

    patterns = Patterns(PROJECTOR, fringe_set((912, 114, 36), steps))
    result, findings = judged(patterns, wheel, gain=0.8)
    steady, clean = judged(patterns, gain=0.8)
    assert [k for k in findings if k not in clean] == ["flicker"]
    assert not findings["flicker"].severe and "but for" not in findings["flicker"].message
    rms, best = (np.sqrt(np.mean(error(one)[0] ** 2)) for one in (result, steady))
    assert rms < 1.2 * best


@pytest.mark.parametrize("camera", [{"response": 2.2}, {"response": 0.5}, {"gamma": 0.5}])
def test_the_command_names_them_with_their_files(judged, camera):
    patterns = Patterns(PROJECTOR, fringe_set((912, 114, 36), 8))
    a, b = "column-36-03.png", "column-36-02.png"
    _, findings = judged(patterns, lambda frames: frames | {a: frames[b]}, **camera)
    assert list(findings) == ["frame"] and findings["frame"].message.startswith(a)
    assert f"it is the picture of {b}" in findings["frame"].message
    both = {a: b, b: a}
    _, findings = judged(
        patterns, lambda frames: {k: frames[both.get(k, k)] for k in frames}, **camera
    )
    assert list(findings) == ["exchanged"]
    assert a in findings["exchanged"].message and b in findings["exchanged"].message


def test_few_steps_say_which_two_and_that_more_is_not_told(judged):
    patterns = Patterns(PROJECTOR, fringe_set((912, 114, 36), 4))
    a, b = "column-36-03.png", "column-36-02.png"
    result, findings = judged(patterns, lambda frames: frames | {a: frames[b]})
    assert f"{b} or {a}" in findings["frame"].message
    row = "exchanged and late photographs"
    assert result.numbers()[row] == "cannot be told from 4 steps"
    eight = Patterns(PROJECTOR, fringe_set((912, 114, 36), 8))
    assert judged(eight)[0].numbers()[row] == "looked for"


@pytest.mark.parametrize("steps, severe", [(18, False), (12, False), (6, True), (4, True)])
def test_square_fringes_are_an_error_only_of_few_steps(judged, steps, severe, monkeypatch):
    whole = Fringe._buffer
    square = lambda fringe, i, n: np.where(whole(fringe, i, n) > 127.5, 255.0, 0.0)  # noqa: E731
    monkeypatch.setattr(Fringe, "_buffer", square)
    result, findings = judged(Patterns(PROJECTOR, fringe_set((912, 114, 36), steps)))
    assert [f.code for f in findings.values() if f.severe] == (["square"] if severe else [])
    assert severe or result.mask.sum() > 0.9 * result.lit.sum()


@pytest.mark.parametrize("steps", [3, 6])
@pytest.mark.parametrize("pitch", [912, 114, 36])
def test_a_pitch_that_begins_a_third_late_is_named_with_its_step(judged, steps, pitch):
    late = steps // 3
    names = [f"column-{pitch}-{n:02}.png" for n in range(steps)]

    def turned(frames):
        return frames | dict(
            zip(names, [frames[n] for n in names[late:] + names[:late]], strict=True)
        )

    _, findings = judged(Patterns(PROJECTOR, fringe_set((912, 114, 36), steps)), turned)
    assert findings["offset"].severe
    assert f"pitch {pitch} began with step {late}" in findings["offset"].message


def test_a_noisy_pitch_that_begins_late_is_named_too(judged):
    names = [f"column-66-{n:02}.png" for n in range(3)]

    def turned(frames):
        return frames | dict(zip(names, [frames[n] for n in names[1:] + names[:1]], strict=True))

    result, findings = judged(Patterns(PROJECTOR, fringe_set((912, 66, 30), 3)), turned, noise=10.0)
    assert result.sharpness[0] < 0.6  # so blurred is how far the first two are apart
    assert "pitch 66 began with step 1" in findings["offset"].message


@pytest.mark.parametrize("steps", [4, 5, 8, 12])
@pytest.mark.parametrize("response", [1.4, 2.2, 2.6])
def test_the_dark_of_a_response_is_no_doubled_picture(judged, steps, response):
    """A small body sees a part of the longest period, where several pictures are dark."""
    patterns = Patterns(PROJECTOR, fringe_set((912, 114, 19), steps))
    for number in (4, 7):
        view = raycast(shapes.place(part(number), 120, [0, 0, 660]), SYSTEM)
        _, findings = judged(patterns, view=view, response=response)
        assert not [f for f in findings.values() if f.severe]


def test_one_file_twice_is_told_of_three_steps(judged):
    files = [f"column-114-{n:02}.png" for n in (0, 2)]
    _, findings = judged(
        Patterns(PROJECTOR, fringe_set((912, 114, 19), 3)),
        lambda frames: frames | {files[1]: frames[files[0]]},
    )
    assert [f.code for f in findings.values() if f.severe] == ["frame"]
    assert f"{files[0]} or {files[1]}" in findings["frame"].message
