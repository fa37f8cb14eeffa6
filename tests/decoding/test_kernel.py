"""The compiled kernel is kept for the next process, and does without where nothing can be kept."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import fpputil

PROGRAM = """
import numpy as np
from fpputil.decoding import decode
from fpputil.decoding.kernel import sweep
from fpputil.optics import fringe_set
fringes = fringe_set((912,), 3)
frames = np.stack([f.intensity(np.arange(64.0)[None], n) for f in fringes for n in range(3)])
Phi = decode(frames.astype({dtype!r}), fringes, 912).Phi
np.testing.assert_allclose(Phi[0], 2 * np.pi * np.arange(64) / 912, atol=0.01)
print(sum(sweep.stats.cache_hits.values()), sum(sweep.stats.cache_misses.values()))
"""


def hits_and_misses(dtype="uint8", **environment):
    """Of the kernel's cache in a fresh process that decodes one capture."""
    command = [sys.executable, "-c", PROGRAM.format(dtype=dtype)]
    text = subprocess.check_output(command, env=os.environ | environment, text=True)
    return tuple(map(int, text.split()))


@pytest.mark.slow
def test_a_second_process_compiles_nothing(tmp_path):
    for dtype in ("uint8", "float32"):
        assert hits_and_misses(dtype, NUMBA_CACHE_DIR=str(tmp_path)) == (0, 1)
        kept = sorted(tmp_path.rglob("*.nb*"))
        assert hits_and_misses(dtype, NUMBA_CACHE_DIR=str(tmp_path)) == (1, 0)
        assert sorted(tmp_path.rglob("*.nb*")) == kept


@pytest.mark.slow
def test_a_package_and_a_home_that_cannot_be_written_do_not_matter(tmp_path):
    """Files stand where the folders of the two caches would: that stops root, too."""
    source = Path(fpputil.__file__).parent
    shutil.copytree(source, tmp_path / "fpputil", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "fpputil/decoding/__pycache__").write_text("")
    (tmp_path / "home").write_text("")
    home = {name: str(tmp_path / "home") for name in ("HOME", "XDG_CACHE_HOME", "LOCALAPPDATA")}
    assert hits_and_misses(PYTHONPATH=str(tmp_path), NUMBA_CACHE_DIR="", **home) == (0, 1)
    assert not list(tmp_path.rglob("*.nb*"))
