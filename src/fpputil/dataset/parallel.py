"""Running the same function over many jobs: here, in processes, or on a Dask cluster."""

from __future__ import annotations

import os
import re
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process

from fpputil.checks import whole
from fpputil.signals import answered

PATIENCE = 10  # seconds that a scheduler has to answer


def check(workers: int, scheduler: str | None) -> None:
    """ValueError unless there is a worker, and a scheduler's address has a scheme and a port."""
    whole("workers", workers, 1)
    if scheduler is not None and not re.fullmatch(r"\w+://.+:\d+", scheduler):
        raise ValueError(
            f"scheduler {scheduler!r} given; an address like tcp://host:8786 is needed"
        )


def run(
    function: Callable, jobs: Sequence[tuple], workers: int = 1, scheduler: str | None = None
) -> Iterator:
    """Results of ``function(*job)`` as they are done, in any order.

    Parameters
    ----------
    function : callable
        Importable by name, so that other processes find it.
    jobs : sequence of tuple
        Arguments of each call.
    workers : int
        Processes; 1 works in this one.
    scheduler : str, optional
        Address of a Dask scheduler, as in "tcp://host:8786". Its workers do the work instead,
        and a job whose worker dies goes to another.

    Raises
    ------
    ValueError
        If there are no workers, or the address is none.
    RuntimeError
        If a worker was ended from outside, or the scheduler cannot be reached or goes away.
    """
    check(workers, scheduler)
    if not jobs:
        return
    if workers == 1 and scheduler is None:
        yield from (function(*job) for job in jobs)
        return
    with _processes(workers) if scheduler is None else _cluster(scheduler) as executor:
        futures = []
        try:
            with _without_interrupts():  # workers that start now inherit the deafness
                futures += [executor.submit(function, *job) for job in jobs]
            for future in as_completed(futures):
                yield future.result()
        finally:  # on an error or Ctrl-C, jobs in flight end and the others never start
            for future in futures:
                future.cancel()


@contextmanager
def _processes(workers: int) -> Iterator[Executor]:
    # Spawned, not forked: Embree, BLAS and Zarr have threads that a fork would cut in half.
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin_worker)
    try:
        yield pool
    except BrokenProcessPool:
        raise RuntimeError(
            "a worker process was ended from outside (is the memory full?); "
            "what is finished stays, and the same command goes on"
        ) from None
    finally:
        with _without_interrupts():  # a second Ctrl-C must not cut the end short
            pool.shutdown(cancel_futures=True)


def _without_interrupts():
    return answered(signal.SIG_IGN, signal.SIGINT)


def _begin_worker() -> None:
    # Ctrl-C reaches every process of a terminal; only the first of them answers it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for ever; nothing it writes can be half."""
    parent_process().join()
    os._exit(1)


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
        raise RuntimeError(
            f"scheduler {address} given; it does not answer ({error}); start one with: "
            "dask scheduler"
        ) from error
    try:
        yield client.get_executor(retries=3)
    except (CancelledError, KilledWorker) as error:
        raise RuntimeError(
            f"the cluster of {address} is gone or loses its workers ({type(error).__name__}); "
            "what is finished stays, and the same command goes on"
        ) from None
    finally:
        with suppress(OSError, RuntimeError):
            client.close(timeout=PATIENCE)
