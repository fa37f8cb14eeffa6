"""The rendered book, for all tests of this folder."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from filelock import FileLock

ROOT = Path(__file__).parents[2]
STORED = ROOT / "_build/stored"


@pytest.fixture(scope="session")
def html(testrun_uid):
    """Folder of the pages, rendered from the stored outputs once a run; a warning is an error."""
    out, mark = STORED / "_build/html", STORED / "rendered-by-tests"
    STORED.mkdir(parents=True, exist_ok=True)
    with FileLock(STORED / "tests.lock"):
        if not mark.exists() or mark.read_text() != testrun_uid:
            shutil.rmtree(out, ignore_errors=True)
            command = [Path(sys.executable).with_name("jupyter-book"), "build", ROOT]
            command += ["-W", "-n", "--keep-going", "--path-output", STORED]
            environment = {**os.environ, "FPP_EXECUTE": "off"}
            result = subprocess.run(command, env=environment, capture_output=True, text=True)
            assert result.returncode == 0, result.stderr[-5000:]
            mark.write_text(testrun_uid)
    return out
