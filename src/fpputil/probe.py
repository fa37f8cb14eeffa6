"""What this machine can do: 3D pictures through PyVista, photographs through Blender.

VTK ends the process (no exception) where EGL is missing, so both are tried in a process
of their own, once in each that asks: about 1.5 s for PyVista, 0.7 s for Blender.
``python -m fpputil.probe`` tries both and says what is missing.
"""

from __future__ import annotations

import functools
import importlib.util
import os
import subprocess
import sys

_EGL = "vtkEGLRenderWindow"
PACKAGES = {
    "pyvista": "libegl1 libegl-mesa0 libgl1-mesa-dri",
    "bpy": "libgl1 libsm6 libice6 libx11-6 libxext6 libxfixes3 libxi6 libxrender1 libxkbcommon0",
}
_FALLBACK = {
    "pyvista": "3D figures are shaded by Embree instead",
    "bpy": "pages with Blender show their stored photographs",
}
_TRIAL = {
    "pyvista": "import pyvista; p = pyvista.Plotter(off_screen=True, window_size=(32, 32)); "
    "p.add_mesh(pyvista.Sphere()); assert p.screenshot(return_img=True).std() > 0",
    "bpy": "import bpy; bpy.context.scene.render",
}


@functools.lru_cache
def pyvista_works() -> bool:
    """Whether PyVista can render off screen here. ``FPP_PYVISTA=0`` says no without a trial.

    Where it can and no display is open, VTK is told to render through EGL.
    """
    works = os.environ.get("FPP_PYVISTA") != "0" and _tried("pyvista")
    if works:
        os.environ.update(_environment("pyvista"))
    return works


@functools.lru_cache
def blender_works() -> bool:
    """Whether ``import bpy`` succeeds here. ``FPP_BLENDER=0`` says no without a trial."""
    return os.environ.get("FPP_BLENDER") != "0" and _tried("bpy")


def _environment(name: str) -> dict[str, str]:
    if name == "pyvista" and sys.platform == "linux" and not os.environ.get("DISPLAY"):
        return {"VTK_DEFAULT_OPENGL_WINDOW": _EGL}
    return {}


def _tried(name: str) -> bool:
    """Run the trial in another process; a crash there is an answer, not an accident."""
    if importlib.util.find_spec(name) is None:
        return False
    try:
        trial = subprocess.run(
            [sys.executable, "-c", _TRIAL[name]],
            env={**os.environ, **_environment(name)},
            capture_output=True,
            timeout=120,
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return trial.returncode == 0


def main() -> None:
    """Try both and print one line for each, and what would have to be installed."""
    for name, title in {"pyvista": "PyVista", "bpy": "Blender"}.items():
        if _tried(name):
            print(f"{title}: works.")
        elif importlib.util.find_spec(name) is None:
            print(f"{title}: not installed; {_FALLBACK[name]}.")
        else:
            print(f"{title}: does not run here; {_FALLBACK[name]}.")
            print(f"  On Debian: apt install {PACKAGES[name]}")


if __name__ == "__main__":
    main()
