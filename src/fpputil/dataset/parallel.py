"""Running the same function over many jobs: here, in processes, or on a Dask cluster."""

from __future__ import annotations

import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from multiprocessing import get_context, parent_process
from pathlib import Path

from fpputil.checks import whole

PATIENCE = 10  # seconds that a scheduler has to answer
GOES_ON = "what is finished stays, and the same command goes on"


def run(function: Callable, jobs: Sequence[tuple], executor: Executor | None = None) -> Iterator:
    """Results of ``function(*job)`` as they are done, in any order; without executor, in order.

    On an error or Ctrl-C, jobs in flight end and the others never start.

    >>> list(run(pow, [(2, 3), (3, 2)]))
    [8, 9]
    """
    if executor is None:
        yield from (function(*job) for job in jobs)
        return
    futures = [executor.submit(function, *job) for job in jobs]
    try:
        for future in as_completed(futures):
            yield future.result()
    finally:
        for future in futures:
            future.cancel()


def executor(
    workers: int = 1, scheduler: str | None = None
) -> AbstractContextManager[Executor | None]:
    """What `run` works with: nothing for one worker, processes, or the workers of a Dask scheduler.

    It is a RuntimeError, inside, if processes are ended from outside or the scheduler goes away.
    """
    whole("workers", workers, 1)
    if scheduler is None:
        return nullcontext() if workers == 1 else _processes(workers)
    if not re.fullmatch(r"\w+://.+:\d+", scheduler):
        raise ValueError(
            f"scheduler {scheduler!r} given; an address like tcp://host:8786 is needed"
        )
    return _cluster(scheduler)


def _begin_worker() -> None:
    # Ctrl-C reaches every process of a terminal; the first alone answers it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent_process().join()  # ended, perhaps by kill -9: nobody else would end this worker
    os._exit(1)


def _check_main() -> None:
    """RuntimeError if the script that runs would run again in each process that it starts."""
    main = sys.modules["__main__"]
    path, spec = Path(getattr(main, "__file__", None) or "none"), getattr(main, "__spec__", None)
    if not path.is_file() or path.suffix != ".py" or (spec and spec.name.endswith("__main__")):
        return  # nothing that a new process runs again
    code = path.read_bytes()
    if b"__main__" not in code and b"parent_process" not in code:
        raise RuntimeError(
            f"{path.name} starts processes, each of which would run it from its first line; put "
            'what it does under a line `if __name__ == "__main__":`, or use one worker'
        )


@contextmanager
def _processes(workers: int) -> Iterator[Executor]:
    _check_main()
    # Spawned, not forked: Embree, BLAS and Zarr have threads that a fork would cut in half.
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin_worker)
    try:
        yield pool
    except BrokenProcessPool:
        why = "a worker process was ended from outside (is the memory full?)"
        raise RuntimeError(f"{why}; {GOES_ON}") from None
    finally:  # a second Ctrl-C must not cut the end short: workers would wait for ever
        main = threading.current_thread() is threading.main_thread()
        before = signal.signal(signal.SIGINT, signal.SIG_IGN) if main else None
        pool.shutdown(cancel_futures=True)
        if main:
            signal.signal(signal.SIGINT, before)


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise RuntimeError(
            f"scheduler {address} given; Dask is missing: pip install 'fpputil[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        why = f"it does not answer ({error}); start one with: dask scheduler"
        raise RuntimeError(f"scheduler {address} given; {why}") from error
    try:
        yield client.get_executor(retries=3)
    except (CancelledError, KilledWorker) as error:
        why = f"is gone or loses its workers ({type(error).__name__})"
        raise RuntimeError(f"the cluster of {address} {why}; {GOES_ON}") from None
    finally:
        with suppress(OSError, RuntimeError):
            client.close(timeout=PATIENCE)
