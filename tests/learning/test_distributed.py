"""Two processes that share each batch train as one does."""

import os
import subprocess
import sys

import pytest
import torch
from matplotlib.figure import Figure
from safetensors.torch import load_file

from fpputil.cli import main
from fpputil.learning.checkpoint import read_state
from fpputil.learning.log import read_log

pytestmark = pytest.mark.slow
OPTIONS = (
    *("--epochs", "2", "--batch", "6", "--base", "2", "--levels", "2", "--validation-views", "2"),
    *("--dropout", "0", "--precision", "float32", "--threads", "1", "--workers", "0"),
)  # augmentation is drawn by view and epoch: the number of processes does not change it
NAMES = ("phase", "consistency", "geometric", "total", "validation_mae", "validation_rmse")


@pytest.fixture(scope="module")
def both(small_set, tmp_path_factory):
    """The same run by one process and by two: their folders."""
    one, two = (tmp_path_factory.mktemp(name) / "run" for name in ("one", "two"))
    call = ["train", "sfnet", "--data", str(small_set), *OPTIONS]
    threads = torch.get_num_threads()
    with pytest.MonkeyPatch.context() as patched:  # drawing takes longer than such an epoch
        patched.setattr(Figure, "savefig", lambda self, file, **_: file.write(b"no picture"))
        assert main([*call, "--out", str(one)]) == 0
    torch.set_num_threads(threads)
    torchrun = ["-m", "torch.distributed.run", "--nproc-per-node", "2", "--nnodes", "1",
                "--rdzv-backend", "c10d", "--rdzv-endpoint", "localhost:0",
                "--master-addr", "127.0.0.1", "--local-addr", "127.0.0.1"]  # fmt: skip
    done = subprocess.run(
        [sys.executable, *torchrun, "-m", "fpputil.cli", *call, "--out", str(two)],
        capture_output=True, text=True, timeout=300,
        env={**os.environ, "OMP_NUM_THREADS": "1", "GLOO_SOCKET_IFNAME": "lo"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return one, two, done


def test_losses_are_those_of_one_process(both):
    one, two, _ = both
    rows, shared = (read_log(out / "log.csv") for out in (one, two))
    assert len(rows) == len(shared) == 2
    for row, other in zip(rows, shared, strict=True):
        assert row["images"] == other["images"] and row["learning_rate"] == other["learning_rate"]
        for name in NAMES:
            assert abs(row[name] - other[name]) <= 1e-5 * max(1, row[name]), name
        assert other["validation_order_errors"] == pytest.approx(
            row["validation_order_errors"], abs=1e-3
        )


def test_weights_are_those_of_one_process(both):
    one, two, _ = both
    a, b = (load_file(out / "checkpoint.safetensors") for out in (one, two))
    assert a.keys() == b.keys()
    for name in a:
        torch.testing.assert_close(a[name], b[name], rtol=1e-2, atol=1e-5)
    assert len(read_state(two / "checkpoint.safetensors")["history"]) == 2


def test_the_first_process_alone_writes_and_shows(both):
    one, two, done = both
    assert {f.name for f in two.iterdir()} == {f.name for f in one.iterdir()}
    assert done.stderr.count("| 0/24 [00:00<?") == 1
    assert done.stdout.count("best validation MAE") == 1
