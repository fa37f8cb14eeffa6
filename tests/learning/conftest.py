"""What trainings of tests share: one thread, no drawing, and a key that stops them."""

import contextlib
import os
import signal
from multiprocessing import active_children

import pytest
import torch

from fpputil.networks.methods import SFNetMethod


@pytest.fixture
def small_and_quick(undrawn):
    """One thread; no drawing, which takes longer than a small epoch; no process left behind."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
    with contextlib.suppress(RuntimeError):  # torch watches its workers
        for process in active_children():
            process.kill()  # or the tests would never end
            process.join()


@pytest.fixture
def interrupt():
    """Function that presses Ctrl-C in the middle of the batch `at`, counted from 1."""

    def press(monkeypatch, at):
        losses, count = SFNetMethod.losses, iter(range(1, 10**9))

        def stopped(self, *batch):
            if next(count) == at:
                os.kill(os.getpid(), signal.SIGINT)
            return losses(self, *batch)

        monkeypatch.setattr(SFNetMethod, "losses", stopped)

    return press
