"""Ctrl-C and SIGTERM as a wish that a loop can grant when it suits (chapter 8)."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def stopping() -> Iterator[list[int]]:
    """A list that is no longer empty once Ctrl-C or SIGTERM came; the same
    once more stops at once. A launcher may send one of each.
    """
    caught: list[int] = []

    def note(number, frame):
        if number in caught:
            raise KeyboardInterrupt
        caught.append(number)

    main = threading.current_thread() is threading.main_thread()  # others get no signals
    wanted = (signal.SIGINT, signal.SIGTERM) if main else ()
    before = {number: signal.signal(number, note) for number in wanted}
    try:
        yield caught
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
