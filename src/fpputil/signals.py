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
