"""Batches in an order that seed and epoch decide, for one process or several (chapter 8)."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from torch.utils.data import DataLoader, Sampler

from fpputil.checks import whole
from fpputil.dataset.synthfringe import SynthFringe


class Batches(Sampler):
    """Positions in a dataset, dealt into batches anew each `epoch`.

    Of `number` items `size` make a batch, which all processes share. Items left over at the end of
    an epoch wait for another; a dataset smaller than a batch is one batch.

    >>> list(Batches(5, 2, seed=0))
    [[2, 4], [3, 0]]
    >>> list(Batches(5, 2, seed=0, rank=1, ranks=2))
    [[4], [0]]
    """

    def __init__(self, number: int, size: int, seed: int, rank: int = 0, ranks: int = 1):
        if size % ranks or number % ranks and number < size:
            raise ValueError(
                f"batches of {min(size, number)} for {ranks} processes given; "
                "each of them takes an equal part"
            )
        self.number, self.size, self.seed = number, size, seed
        self.share = slice(rank, None, ranks)
        self.epoch = 0

    def __len__(self) -> int:
        return max(1, self.number // self.size)

    def __iter__(self) -> Iterator[list[int]]:
        order = np.random.default_rng((self.seed, self.epoch)).permutation(self.number)
        for k in range(len(self)):
            yield order[k * self.size : (k + 1) * self.size][self.share].tolist()


def spread(data: SynthFringe, most: int) -> list[int]:
    """Positions of all items, or of `most` of them, evenly spread.

    >>> spread(range(100), 4)
    [0, 33, 66, 99]
    """
    most = min(whole("views", most, 1), len(data))
    return np.linspace(0, len(data) - 1, most).round().astype(int).tolist()


@contextmanager
def closing(*loaders: DataLoader):
    """End the processes of loaders at the end: they ignore SIGTERM and would be waited for."""
    try:
        yield
    finally:
        for loader in loaders:
            if loader._iterator is not None and loader.num_workers:
                loader._iterator._shutdown_workers()


def loader_options(workers: int) -> dict:
    """Options of a loader whose processes leave it to the one that trains when to stop."""
    if not whole("workers", workers, 0):
        return {"num_workers": 0}
    return {"num_workers": workers, "persistent_workers": True, "worker_init_fn": _quiet}


def _quiet(worker: int) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):  # both may be sent to the whole group
        signal.signal(number, signal.SIG_IGN)
    torch.set_num_threads(1)
