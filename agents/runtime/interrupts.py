"""Interruptions from the keyboard, kept from where they would do harm."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Put an interruption off; processes started meanwhile never see one, and print nothing."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    asked: list[int] = []
    resource_tracker.ensure_running()  # to start it later would let interruptions through
    before = signal.signal(signal.SIGINT, lambda number, _: asked.append(number))
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited; the handler is not
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, before)
    if asked:
        raise KeyboardInterrupt


@contextmanager
def defer_interrupt() -> Iterator[Callable[[], None]]:
    """Put an interruption off until it is looked for; a second one comes through.

    Compiled code may crash the process where an exception meets it on its way into Python and back.

    Yields:
        What looks for it: raises KeyboardInterrupt if there was one.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return
    asked = 0

    def handle(*_: object) -> None:
        nonlocal asked
        asked += 1
        if asked > 1:
            raise KeyboardInterrupt

    def look() -> None:
        if asked:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, handle)
    try:
        yield look
    finally:
        signal.signal(signal.SIGINT, before)
    look()
