"""Signals are answered for a while, and then as before."""

import os
import signal
import threading

import pytest

from fpputil.signals import answered


def test_a_signal_is_answered_for_a_while():
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt), answered(signal.default_int_handler, signal.SIGTERM):
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) == before


def test_other_threads_answer_nothing():
    done = []

    def work():
        with answered(signal.SIG_IGN, signal.SIGTERM):
            done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done
