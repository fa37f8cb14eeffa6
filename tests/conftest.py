"""Shared scenes, built once a run, and a browser."""

import os
import shutil
import signal
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fpputil.optics.fringes import fringe_set
from fpputil.optics.pinhole import looking
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import sphere
from fpputil.optics.system import preset

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"]
FLAGS += ["--disable-background-networking", "--disable-component-update"]
BROWSER = os.environ.get("BROWSER_PATH") or next(filter(None, map(shutil.which, NAMES)), None)

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in the background of a script: ``test &``
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def tiny():
    return preset("tiny")


@pytest.fixture(scope="session")
def paper():
    return preset("paper")


@pytest.fixture(scope="session")
def hung():
    """Function from a system to one whose projector stands elsewhere, and is rolled, degrees.

    It looks at where the axes of the presets cross.
    """

    def hang(system, centre=(45, 0, 150), roll=0.0):
        p = system.projector
        upright = looking(centre, (0, 0, 664), (p.width, p.height), 30).R
        R = Rotation.from_euler("z", roll, degrees=True).as_matrix() @ upright
        return replace(system, projector=replace(p, R=R, t=-R @ np.array(centre, float)))

    return hang


@pytest.fixture(scope="session")
def sphere_view(tiny):
    return raycast(sphere(100, (0, 0, 680)), tiny.system)


@pytest.fixture(scope="session")
def paper_sphere_view(paper):
    return raycast(sphere(100, (0, 0, 680)), paper.system)


@pytest.fixture(scope="session")
def paper_fringes(paper):
    return fringe_set(paper.pitches.descending)


@pytest.fixture(scope="session")
def small_set(tmp_path_factory):
    """Ten models and one held out, two views each, at the preset "tiny"."""
    from fpputil.dataset.generation import generate
    from fpputil.dataset.models import seeded_models

    out = tmp_path_factory.mktemp("data") / "set"
    generate(out, "tiny", *seeded_models(10, 1), views=2)
    return out


@pytest.fixture
def undrawn(monkeypatch):
    """No figure is drawn, which takes most of a second; its file says so."""
    from matplotlib.figure import Figure

    monkeypatch.setattr(Figure, "savefig", lambda self, file, **_: file.write(b"no picture"))


@pytest.fixture(scope="session")
def browser():
    if BROWSER is None:
        pytest.skip("no Chromium or Chrome is installed (Debian: apt install chromium)")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
