"""A probe answers; it never crashes."""

import pytest

from fpputil import probe


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    """Nothing tried yet, nothing asked of the environment."""
    monkeypatch.delenv("FPP_PYVISTA", raising=False)
    monkeypatch.delenv("FPP_BLENDER", raising=False)
    monkeypatch.delenv("VTK_DEFAULT_OPENGL_WINDOW", raising=False)
    monkeypatch.setattr(probe.importlib.util, "find_spec", lambda name: object())
    probe.pyvista_works.cache_clear()
    probe.blender_works.cache_clear()
    yield
    probe.pyvista_works.cache_clear()
    probe.blender_works.cache_clear()


ENDS = {
    "success": ("pass", True),
    "an exception": ("raise ImportError('libSM.so.6')", False),
    "a segmentation fault": ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", False),
}


@pytest.mark.slow
@pytest.mark.parametrize(("trial", "answer"), ENDS.values(), ids=ENDS)
def test_every_end_of_a_trial_is_an_answer(monkeypatch, trial, answer):
    monkeypatch.setattr(probe, "_TRIAL", {"pyvista": trial, "bpy": trial})
    assert probe.pyvista_works() is answer
    assert probe.blender_works() is answer


@pytest.mark.slow
def test_what_fails_is_named_with_its_packages(monkeypatch, capsys):
    monkeypatch.setattr(probe, "_TRIAL", {"pyvista": "raise SystemExit(139)", "bpy": "pass"})
    probe.main()
    printed = capsys.readouterr().out
    assert "apt install libegl1 libegl-mesa0 libgl1-mesa-dri" in printed
    assert "libsm6" not in printed


def test_the_environment_can_say_no(monkeypatch):
    monkeypatch.setenv("FPP_PYVISTA", "0")
    monkeypatch.setenv("FPP_BLENDER", "0")
    assert not probe.pyvista_works()
    assert not probe.blender_works()


def test_what_is_not_installed_does_not_work(monkeypatch):
    monkeypatch.setattr(probe.importlib.util, "find_spec", lambda name: None)
    assert not probe.pyvista_works()
    assert not probe.blender_works()
