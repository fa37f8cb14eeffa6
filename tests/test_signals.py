"""Signals: the first of each kind waits for the batch, the second does not."""

import os
import signal
import threading

import pytest

from fpputil.signals import stopping


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_waits_and_the_same_once_more_does_not(number):
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
    with pytest.raises(KeyboardInterrupt):
        with stopping() as caught:
            assert not caught
            os.kill(os.getpid(), number)
            assert caught == [number]
            other = signal.SIGTERM if number == signal.SIGINT else signal.SIGINT
            os.kill(os.getpid(), other)  # a launcher sends one of each
            assert caught == [number, other]
            os.kill(os.getpid(), number)
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)] == before


def test_other_threads_train_as_well():
    seen = []

    def work():
        with stopping() as caught:
            seen.append(list(caught))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [[]]
