"""Signals answered for a while in a way of our own (chapters 7 and 8)."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def answered(handler, *numbers: signal.Signals) -> Iterator[None]:
    """Have a handler answer some signals; in threads but the main one, which get none, nothing."""
    main = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, handler) for number in numbers if main}
    try:
        yield
    finally:
        for number, was in before.items():
            signal.signal(number, was)


@contextmanager
def stopping() -> Iterator[list[int]]:
    """A list that is no longer empty once Ctrl-C or SIGTERM came, as a wish that a loop can grant
    when it suits; the same once more stops at once. A launcher may send one of each.
    """
    caught: list[int] = []

    def note(number, frame):
        if number in caught:
            raise KeyboardInterrupt
        caught.append(number)

    with answered(note, signal.SIGINT, signal.SIGTERM):
        yield caught
