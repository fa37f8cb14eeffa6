"""What `pip install .` gives where there is neither git, nor the repository, nor torch."""

import shutil
import subprocess
import sys
from pathlib import Path
from sysconfig import get_path

import pytest

ROOT = Path(__file__).parents[1]
LEFT_OUT = ("torch", "safetensors", "zarr", "numcodecs", "filelock")

BLOCK = f"""import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {LEFT_OUT!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
"""


@pytest.fixture(scope="module")
def fpp(tmp_path_factory):
    """The command of a wheel made from the sources alone, in an environment of its own."""
    place = tmp_path_factory.mktemp("package")
    sources = place / "sources"
    sources.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, sources)
    leave = shutil.ignore_patterns("__pycache__", "*.egg-info")
    shutil.copytree(ROOT / "src", sources / "src", ignore=leave)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    build = ["wheel", "--no-deps", "--no-build-isolation", "--no-index", "-w", place, sources]
    subprocess.run([*pip, *build], check=True)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", place / "env"], check=True)
    python = place / "env" / "bin" / "python"
    subprocess.run(
        [*pip, "--python", python, "install", "--no-deps", "--no-index", *place.glob("*.whl")],
        check=True,
    )
    (site,) = (place / "env" / "lib").glob("python*/site-packages")
    # The other packages are this environment's; what the extra `learning` brings is hidden.
    (site / "others.pth").write_text(f"{get_path('purelib')}\nimport hide_learning\n")
    (site / "hide_learning.py").write_text(BLOCK)
    folder = place / "elsewhere"
    folder.mkdir()

    def run(*arguments):
        command = [place / "env" / "bin" / "fpp", *map(str, arguments)]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True)

    return run


@pytest.mark.slow
def test_patterns_render_and_decode_run_without_torch(fpp):
    """From a pattern to points, outside the repository."""
    for command in (
        ("patterns", "patterns", "--projector", "912x1140"),
        ("render", "shots", "--patterns", "patterns/patterns.toml", "--part", "3"),
        ("decode", "shots", "--system", "paper", "--out", "out"),
        ("system", "show", "tiny"),
    ):
        run = fpp(*command)
        assert run.returncode == 0, run.stderr
    assert (
        "points in" in fpp("decode", "shots", "--system", "paper", "--force", "--out", "out").stdout
    )


@pytest.mark.slow
def test_what_needs_the_extra_says_so(fpp):
    run = fpp("train", "sfnet", "--data", "none", "--out", "run")
    assert run.returncode == 1 and "Traceback" not in run.stderr
    assert "fpputil[learning]" in run.stderr and len(run.stderr.splitlines()) == 1
