"""Faults of a capture, each made on purpose, and the word by which it is named."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fpputil.capture.faults.consistency import exchanged, misfits
from fpputil.capture.faults.diagnosis import diagnose
from fpputil.capture.faults.findings import FINDINGS, SEVERE
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.optics import shapes
from fpputil.optics.fringes import fringe_set
from fpputil.optics.parts import part
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import preset

SYSTEM = preset("small").system
PROJECTOR = (912, 1140)
EIGHT = Patterns(PROJECTOR, fringe_set((912, 114, 18), 8))


@pytest.fixture(scope="module")
def view():
    return raycast(shapes.place(part(3), 240, [0, 0, 660]), SYSTEM, supersample=2)


@pytest.fixture
def diagnosed(tmp_path, view, photographs):
    """Function from patterns, a change of their photographs and a camera to codes of findings."""

    def judge(
        patterns=EIGHT,
        change=lambda frames: frames,
        shown=None,
        response=1.0,
        gamma_back=None,
        **camera,
    ):
        camera = {"noise": 1.0, **camera}
        frames = photographs(view, shown or patterns, response, **camera)
        names = [shot.file for shot in patterns.shots()]
        frames = change(dict(zip(names, frames.values(), strict=True)))
        for name, frame in frames.items():
            cv2.imwrite(str(tmp_path / name), frame)
        capture = open_capture(tmp_path, patterns)
        system = SYSTEM if patterns.unwrap == "minimum" else None
        measurement = measure(capture, patterns.axes[0], system=system, gamma=gamma_back)
        findings = diagnose(measurement, capture)
        assert all(f.message and f.remedy for f in findings)
        return {f.code: f.severe for f in findings}

    return judge


def taken(*pairs):
    """Change that gives each first name the photograph of the second."""
    return lambda frames: frames | {a: frames[b] for a, b in pairs}


def swapped(p, q):
    names = [(f"column-{a}-{n:02}.png", f"column-{b}-{n:02}.png")
             for n in range(8) for a, b in ((p, q), (q, p))]  # fmt: skip
    return taken(*names)


@pytest.mark.parametrize("steps", [4, 5, 8, 15])
def test_nothing_is_said_of_a_good_capture(diagnosed, steps):
    assert diagnosed(Patterns(PROJECTOR, fringe_set((912, 114, 18), steps))) == {}


def test_other_unwrappings_are_good_too(diagnosed):
    for unwrap, pitches in (("mw", (15, 16, 17.2)), ("nt", (31, 33)), ("minimum", (304, 18))):
        assert diagnosed(Patterns(PROJECTOR, fringe_set(pitches, 8), unwrap)) == {}
    rows = Patterns(PROJECTOR, fringe_set((1140, 114, 19), 8, axis="row"))
    assert diagnosed(rows) == {}
    assert diagnosed(replace(rows, shift=-1), shown=rows) == {"direction": True}


@pytest.mark.parametrize("steps", [4, 8])
@pytest.mark.parametrize(
    "unwrap, pitches",
    [
        ("mf", (912, 114, 18)),
        ("mf", (912, 114, 19)),
        ("mw", (15, 16, 17.2)),
        ("nt", (31, 33)),
        ("minimum", (304, 18)),
    ],  # fmt: skip
)
def test_a_wrong_direction_of_the_shift_is_named(diagnosed, unwrap, pitches, steps):
    patterns = Patterns(PROJECTOR, fringe_set(pitches, steps), unwrap)
    assert diagnosed(replace(patterns, shift=-1), shown=patterns) == {"direction": True}


@pytest.mark.parametrize("pair", [(114, 18), (912, 114), (912, 18)])
def test_swapped_frequencies_are_named(diagnosed, pair):
    assert diagnosed(change=swapped(*pair)) == {"swapped": True}


def test_a_repeated_an_exchanged_and_a_rolled_photograph_are_named(diagnosed):
    a, b = "column-18-03.png", "column-18-02.png"
    assert diagnosed(change=taken((a, b))) == {"frame": True}
    assert diagnosed(change=taken((a, b), (b, a))) == {"exchanged": True}
    names = [f"column-114-{n:02}.png" for n in range(8)]
    rolled = list(zip(names, names[1:] + names[:1], strict=True))
    assert diagnosed(change=taken(*rolled)) == {"offset": True}


def test_other_pitches_than_given_are_named(diagnosed):
    shown = Patterns(PROJECTOR, fringe_set((912, 120, 20), 8))
    assert any(diagnosed(shown=shown).values())
    shown = Patterns(PROJECTOR, fringe_set((912, 60, 18), 8))
    assert diagnosed(shown=shown) == {"pitch": True}


def test_a_mirrored_picture_is_named(diagnosed):
    assert diagnosed(change=lambda f: {k: v[:, ::-1] for k, v in f.items()}) == {"direction": True}


@pytest.mark.parametrize("top", [0.6, 0.8])
def test_a_saturated_projector_is_named(diagnosed, top, monkeypatch):
    from fpputil.optics.fringes import Fringe

    whole = Fringe._buffer
    cut = lambda fringe, i, n: np.minimum(whole(fringe, i, n), 255 * top)  # noqa: E731
    monkeypatch.setattr(Fringe, "_buffer", cut)
    assert diagnosed() == {"clipped": True}


@pytest.mark.parametrize(
    "camera, expected",
    [
        ({"gain": 2.5}, {"saturated": True}),
        ({"gain": 1.55}, {"saturated": False}),
        ({"gain": 0.1}, {"dark": False}),
        ({"gain": 0.02}, {"dark": True}),
        ({"gain": 0.3, "ambient": 120}, {"contrast": False}),
        ({"response": 1.6}, {}),
        ({"gamma": 0.5}, {}),
    ],
)
def test_light_that_does_not_suit_is_named(diagnosed, camera, expected):
    assert diagnosed(**camera) == expected


def test_a_response_that_is_left_as_it_is_is_named(diagnosed):
    few = Patterns(PROJECTOR, fringe_set((912, 114, 18), (8, 8, 3)))
    assert diagnosed(few, gamma=0.7) == {}
    assert diagnosed(few, gamma_back=1.0, gamma=0.7) == {"response": False}


@pytest.mark.parametrize("level", [0, 200])
def test_a_picture_without_fringes_is_named(diagnosed, level):
    assert diagnosed(change=lambda f: {k: np.full_like(v, level) for k, v in f.items()}) == {
        "dark": True
    }


def test_steps_that_do_not_belong_are_found():
    rng = np.random.default_rng(0)
    phi = rng.uniform(-3, 3, 300)
    frames = 120 + 60 * np.cos(phi + 2 * np.pi * np.arange(12)[:, None] / 12)
    frames += rng.standard_normal(frames.shape)
    assert misfits(frames) == [] and exchanged(frames) is None
    bad = frames.copy()
    bad[[4, 9]] = frames[[9, 4]]
    assert exchanged(bad) == (4, 9)
    bad = frames.copy()
    bad[7] = 20
    assert misfits(bad) == [7]
    bad[2] = frames[5]
    assert sorted(misfits(bad)) == [2, 7]


def test_an_exchange_is_told_from_three_grey_levels_on():
    """Of what a sinusoid leaves of the worst step, RMS over the pixels."""
    phi, delta = np.linspace(-3, 3, 300), 2 * np.pi * np.arange(12)[:, None] / 12
    frames = np.cos(phi + delta)
    frames[[4, 9]] = frames[[9, 4]]
    terms = np.hstack([np.ones_like(delta), np.cos(delta), np.sin(delta)])
    left = frames - terms @ np.linalg.lstsq(terms, frames, rcond=None)[0]
    unit = np.sqrt(np.mean(left**2, axis=1)).max()
    assert exchanged(120 + frames * 2.9 / unit) is None
    assert exchanged(120 + frames * 3.6 / unit) == (4, 9)  # harmonics may take a little of it


def test_every_finding_says_what_to_do():
    assert set(SEVERE) < set(FINDINGS)
    for message, remedy in FINDINGS.values():
        assert message and remedy and not message.endswith(".") and not remedy.endswith(".")


def test_square_fringes_of_one_pitch_hide_no_clipping_of_another(diagnosed):
    def change(frames):
        coarse, fine = ({k: f for k, f in frames.items() if f"-{p}-" in k} for p in (912, 18))
        low, high = (reach([*coarse.values()], axis=0) for reach in (np.min, np.max))
        square = {k: np.where(f > (low / 2 + high / 2), high, low) for k, f in coarse.items()}
        top = np.max([*fine.values()], axis=0) * 0.7
        return frames | square | {k: np.minimum(f, top).astype(f.dtype) for k, f in fine.items()}

    assert "clipped" in diagnosed(Patterns(PROJECTOR, fringe_set((912, 114, 18), 10)), change)


def test_in_the_dark_no_response_is_told(diagnosed):
    codes = diagnosed(Patterns(PROJECTOR, fringe_set((912, 114, 18), 3)), gain=0.09)
    assert "response" not in codes and "dark" in codes
