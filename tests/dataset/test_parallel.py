"""A Dask cluster on loopback, one of whose workers is killed."""

import json
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from fpputil.dataset import parallel


def double(x):
    return 2 * x


def fail(x):
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_results_and_errors(workers):
    with parallel.executor(workers) as pool:
        assert sorted(parallel.run(double, [(n,) for n in range(5)], pool)) == [0, 2, 4, 6, 8]
        assert list(parallel.run(double, [], pool)) == []
        with pytest.raises(OSError, match="No space"):
            list(parallel.run(fail, [(1,), (2,)], pool))


def in_script(monkeypatch, tmp_path, code, spec=None):
    """As if a script of this code ran."""
    (tmp_path / "script.py").write_text(code, encoding="utf-8")
    main = SimpleNamespace(__file__=str(tmp_path / "script.py"), __spec__=spec)
    monkeypatch.setitem(sys.modules, "__main__", main)


def test_a_script_without_a_main_guard_is_told_so_before_a_process_starts(monkeypatch, tmp_path):
    in_script(monkeypatch, tmp_path, "generate(workers=2)")
    with pytest.raises(RuntimeError, match=r'script.py starts .*if __name__ == "__main__":'):
        with parallel.executor(2):
            raise AssertionError
    with parallel.executor(1) as pool:
        assert pool is None


@pytest.mark.parametrize(
    "code, name", [('if __name__ == "__main__":\n    run()', None), ("run()", "package.__main__")]
)
def test_what_a_new_process_does_not_run_again_may_start_processes(
    monkeypatch, tmp_path, code, name
):
    in_script(monkeypatch, tmp_path, code, name and SimpleNamespace(name=name))
    with parallel.executor(2) as pool:
        assert pool is not None


def test_any_executor_will_do():
    with ThreadPoolExecutor(2) as pool:
        assert sorted(parallel.run(double, [(n,) for n in range(5)], pool)) == [0, 2, 4, 6, 8]


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(parallel, "PATIENCE", 1)
    with pytest.raises(RuntimeError, match="tcp://127.0.0.1:9 given; it does not answer"):
        with parallel.executor(scheduler="tcp://127.0.0.1:9"):
            pass


@pytest.mark.slow
def test_jobs_after_an_error_are_not_started(tmp_path):
    jobs = [(0, str(tmp_path))] + [(n, str(tmp_path)) for n in range(1, 60)]
    with pytest.raises(OSError, match="No space"):
        with parallel.executor(2) as pool:
            list(parallel.run(touch_or_fail, jobs, pool))
    assert len(list(tmp_path.iterdir())) < 30


def touch_or_fail(n, folder):
    if n == 0:
        fail(n)
    time.sleep(0.05)
    (Path(folder) / str(n)).touch()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no kill -9")
def test_workers_end_with_a_killed_parent():
    script = (
        "import os, time; from fpputil.dataset import parallel\n"
        "if __name__ == '__main__':\n"
        "    with parallel.executor(2) as pool:\n"
        "        for pid in parallel.run(os.getppid, [()] * 4, pool): assert pid == os.getpid()\n"
        "        print('ready', flush=True); time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as parent:
        assert parent.stdout.readline() == b"ready\n"
        workers = psutil.Process(parent.pid).children(recursive=True)
        parent.kill()
    assert len(workers) >= 2
    assert not psutil.wait_procs(workers, timeout=10)[1]


def test_without_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RuntimeError, match="Dask is missing: pip install"):
        with parallel.executor(scheduler="tcp://127.0.0.1:9"):
            pass


@pytest.fixture
def cluster(tmp_path):
    """A scheduler and two workers, each a process of its own, on loopback."""
    pytest.importorskip("distributed")
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    address = tmp_path / "scheduler.json"
    options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", address]
    with open(tmp_path / "log", "w", encoding="utf-8") as log:
        quiet = {"stdout": log, "stderr": log, "cwd": tmp_path}
        processes = [subprocess.Popen([*start, *options], **quiet)]
        try:
            wait_for(address.exists)
            start = [
                sys.executable,
                "-m",
                "distributed.cli.dask_worker",
                "--scheduler-file",
                address,
            ]
            options = ["--no-nanny", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1"]
            processes += [subprocess.Popen([*start, *options], **quiet) for _ in range(2)]
            yield json.loads(address.read_text())["address"], processes[1:]
        finally:
            for process in processes:
                process.kill()
                process.wait()


def wait_for(condition, seconds=60):
    limit = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < limit
        time.sleep(0.02)


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker(small_set, cluster, tmp_path):
    """The dataset is complete all the same, and no byte differs."""
    address, workers = cluster
    import distributed

    with distributed.Client(address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
    out = tmp_path / "set"
    options = ["--models", "10", "--held-out", "1", "--views", "2", "--scheduler", address]
    run = subprocess.Popen(
        [sys.executable, "-m", "fpputil.cli", "dataset", "generate", str(out), *options],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    wait_for(lambda: list(out.glob("records/*.json")) or run.poll() is not None)
    workers[0].send_signal(signal.SIGKILL)
    half_way = len(list(out.glob("records/*.json")))
    said, _ = run.communicate(timeout=120)
    assert run.returncode == 0, said
    assert workers[0].wait() == -signal.SIGKILL and 0 < half_way < 11
    files = {f.relative_to(out): f.read_bytes() for f in out.rglob("*") if f.is_file()}
    expected = {
        f.relative_to(small_set): f.read_bytes() for f in small_set.rglob("*") if f.is_file()
    }
    assert files == expected


@pytest.mark.slow
def test_a_cluster_that_goes_away(cluster, tmp_path):
    address, workers = cluster
    out = tmp_path / "set"
    call = [sys.executable, "-m", "fpputil.cli", "dataset", "generate", str(out), "--models", "200"]
    run = subprocess.Popen([*call, "--scheduler", address], stderr=subprocess.PIPE, text=True)
    wait_for(lambda: list(out.glob("records/*.json")) or run.poll() is not None)
    scheduler = psutil.Process(workers[0].pid).parent()
    for process in scheduler.children():
        if "dask_scheduler" in " ".join(process.cmdline()):
            process.kill()
    _, said = run.communicate(timeout=120)
    assert run.returncode == 1 and "the same command goes on" in said.splitlines()[-1]
