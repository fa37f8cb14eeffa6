"""One test for each convention of the book (book/conventions.md)."""

import ast
import importlib
import pkgutil
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from fpputil.decoding import geometric_constraint as reference
from fpputil.decoding import phase, triangulation, unwrap
from fpputil.decoding.decoder import decode
from fpputil.optics.fringes import Fringe, fringe_set

SOURCE = Path(__file__).parents[1] / "src" / "fpputil"


def test_frames_are_n_h_w(sphere_view):
    assert sphere_view.frames(Fringe(24, 4)).shape == (4, 120, 160)


def test_lengths_are_millimetres(sphere_view):
    assert 579 < np.nanmin(sphere_view.depth) < 581  # a sphere of 100 mm around 680 mm


def test_pixel_centres_are_integers(tiny):
    assert tiny.system.camera.rays(np.array([79.5, 59.5])).tolist() == [0, 0, 1]


def test_camera_is_the_world_with_y_down(tiny):
    u, v = tiny.system.camera.project(np.array([10.0, 20.0, 660.0])) - (79.5, 59.5)
    assert u > 0 and v > 0


def test_fringe_is_a_cosine_of_the_column():
    assert Fringe(15, 4).intensity(np.array([0.0, 7.5]), 0).tolist() == [255, 0]
    np.testing.assert_allclose(Fringe(15, 4).shifts, np.pi / 2 * np.arange(4))


def test_phase_is_minus_atan2_and_grows_with_the_column():
    column = np.array([0.0, 1.0, 2.0])
    frames = np.stack([Fringe(15, 4).intensity(column, n) for n in range(4)])
    M, D = phase.numerator_denominator(frames)
    np.testing.assert_allclose(M, -4 / 2 * 127.5 * np.sin(2 * np.pi * column / 15), atol=1e-9)
    np.testing.assert_allclose(phase.wrapped_phase(M, D), 2 * np.pi * column / 15, atol=1e-12)


def test_absolute_phase_is_two_pi_columns_over_pitch():
    np.testing.assert_allclose(triangulation.column(2 * np.pi * 33.0 / 15, 15), 33.0)


def test_unit_frequency_starts_half_a_pixel_before_column_0():
    start = unwrap.unit_start(912, 912)
    np.testing.assert_allclose(start, -np.pi / 912)


def test_guard_is_five_sigma():
    np.testing.assert_allclose(unwrap.guard_columns(0.02, 912), 5 * 0.02 * 912 / (2 * np.pi))


def test_network_targets_have_unit_amplitude():
    _, M, D = reference.refined_reference(np.array([1.0]), np.array([0.0]), 114, 304)
    np.testing.assert_allclose(M**2 + D**2, 1)
    np.testing.assert_allclose(phase.wrapped_phase(M, D), 114 / 304)


def test_minimum_phase_is_the_smaller_of_two_planes_and_centred(tiny):
    near, far = (2 * np.pi * tiny.system.columns_at(z) / 304 for z in (480.0, 820.0))
    middle = (slice(None), slice(60, 100))  # where both planes are lit
    plain = reference.minimum_phase(tiny.system, 304, centred=False)[middle]
    np.testing.assert_allclose(plain, np.minimum(near, far)[middle])
    free = 2 * np.pi - np.abs(far - near)[middle]
    centred = reference.minimum_phase(tiny.system, 304)[middle]
    np.testing.assert_allclose(plain - centred, free / 2)


def test_outside_the_mask_is_nan(sphere_view):
    fringes = fringe_set((912, 114, 24))
    decoded = decode(sphere_view.frames(fringes), fringes, 912)
    assert np.isnan(decoded.Phi[~decoded.mask]).all()
    assert np.isnan(sphere_view.column[~sphere_view.mask]).all()


ARROWS = {  # each package imports from those below it alone
    "checks": (),
    "files": ("checks",),
    "probe": (),
    "notebook": (),
    "optics": ("checks", "files", "probe"),
    "plotting": ("optics", "probe"),
    "decoding": ("checks", "files", "optics"),
    "calibration": ("checks", "optics"),
    "interactive": ("decoding", "notebook", "optics", "plotting"),
    "capture": (
        *("calibration", "checks", "decoding", "files", "interactive", "notebook", "optics"),
        "plotting",
    ),
    "dataset": ("capture", "checks", "decoding", "files", "optics"),
    "networks": ("checks", "decoding", "optics"),
    "learning": (*("checks", "dataset", "decoding", "files", "networks", "optics", "plotting"),),
    "experiments": (
        *("checks", "dataset", "decoding", "files", "learning", "networks", "notebook", "optics"),
    ),
}
WITHOUT_TORCH = (
    "checks",
    "files",
    "probe",
    "plotting",
    "optics",
    "decoding",
    "calibration",
    "capture",
    "interactive",
)


def imports_of(file):
    """Dotted names that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("package", ARROWS)
def test_arrows_go_one_way(package):
    """Nothing imports upwards, and torch is met but as an array namespace below the networks."""
    files = [SOURCE / f"{package}.py"] if (SOURCE / f"{package}.py").exists() else []
    for file in files or (SOURCE / package).rglob("*.py"):
        for name in imports_of(file):
            first, *rest = name.split(".")
            if first == "fpputil" and rest:
                assert rest[0] in (package, *ARROWS[package]), (file, name)
            assert first != "torch" or package not in WITHOUT_TORCH, (file, name)


FACES = (
    *("optics", "decoding", "calibration", "capture", "interactive"),
    *("dataset", "networks", "learning", "experiments"),
)


def test_faces_import_nothing_heavy():
    """All faces together, in a fresh process."""
    code = f"import sys, {', '.join(f'fpputil.{name}' for name in FACES)}; "
    code += "print([m for m in ('torch', 'numba', 'cv2', 'trimesh', 'zarr') if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


@pytest.mark.parametrize("package", FACES)
def test_a_face_offers_what_there_is(package):
    """Each name is found, and none of a function is that of a file, which would hide it."""
    face = importlib.import_module(f"fpputil.{package}")
    files = {module.name for module in pkgutil.iter_modules(face.__path__)}
    for name in face.__all__:
        assert isinstance(getattr(face, name), types.ModuleType) == (name in files), name


@pytest.mark.parametrize("package", FACES)
def test_a_package_is_small(package):
    """About ten files, none deeper than a folder of one idea."""
    assert len(list((SOURCE / package).glob("*.py"))) <= 12


SAME = {"photograph"}  # by Blender or by our own rays


def test_no_two_public_things_share_a_name():
    """Commands and exercises aside, whose names are words that a reader types."""
    places = {}
    for file in SOURCE.rglob("*.py"):
        if {"cli", "exercises"} & set(file.relative_to(SOURCE).parts):
            continue
        for node in ast.parse(file.read_text()).body:
            named = isinstance(node, ast.FunctionDef | ast.ClassDef)
            if named and not node.name.startswith("_") and node.name not in {*SAME, "main"}:
                places.setdefault(node.name, []).append(file.relative_to(SOURCE).as_posix())
    assert {name: files for name, files in places.items() if len(files) > 1} == {}
