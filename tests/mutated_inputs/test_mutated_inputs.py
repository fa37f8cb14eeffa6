"""5,000 files changed at random: read, or refused in one line that names the file, and no more.

Each kind is read in a process of its own. Case N of a kind again:
``python tests/mutated_inputs KIND FOLDER N``; it leaves its files in FOLDER.
"""

import json
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
KINDS = runpy.run_path(str(HERE / "kinds.py"))["KINDS"]


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_a_changed_file_is_read_or_refused(name, tmp_path):
    words = [sys.executable, HERE, name, tmp_path / "cases"]
    run = subprocess.run(words, capture_output=True, text=True, errors="replace")
    lines = [json.loads(line) for line in run.stdout.splitlines()]
    faults = [f"case {line['case']}: {line['fault']}" for line in lines if "fault" in line]
    assert not faults, "\n".join(faults)
    assert run.returncode == 0, f"{lines[-1:]} ended the process: {run.stderr[-3000:]}"
    assert run.stderr == ""  # from libraries, too, which write beside Python
    assert len(lines) == KINDS[name].number
