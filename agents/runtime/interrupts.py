"""Defer Ctrl-C to a point where the program can stop safely."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker


class Interrupt:
    """Signal handler: the first Ctrl-C is recorded, the second one raises KeyboardInterrupt."""

    def __init__(self, notice: bytes = b"") -> None:
        self.pressed = False
        """Whether Ctrl-C was pressed."""
        self._notice = notice

    def __call__(self, *_: object) -> None:
        """Handle Ctrl-C."""
        if self.pressed:
            raise KeyboardInterrupt
        self.pressed = True
        os.write(2, self._notice)  # a handler may run in the middle of any other writing


@contextmanager
def defer_interrupt(notice: bytes = b"") -> Iterator[Interrupt]:
    """Defer Ctrl-C to the end of the block, or to the next `raise_if_interrupted` in it.

    Compiled code may crash the process if an exception is raised while it calls Python. Inside
    another such block, and outside the main thread, this one changes nothing.

    Args:
        notice: written to standard error when Ctrl-C is pressed.

    Raises:
        KeyboardInterrupt: At the end of the block, if Ctrl-C was pressed in it.
    """
    before = signal.getsignal(signal.SIGINT)
    if isinstance(before, Interrupt):
        yield before
        return
    interrupt = Interrupt(notice)
    if threading.current_thread() is not threading.main_thread():
        yield interrupt
        return
    signal.signal(signal.SIGINT, interrupt)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, before)
    if interrupt.pressed:
        raise KeyboardInterrupt


def raise_if_interrupted() -> None:
    """Raise a deferred Ctrl-C now.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed within a block of `defer_interrupt`.
    """
    handler = signal.getsignal(signal.SIGINT)
    if isinstance(handler, Interrupt) and handler.pressed:
        raise KeyboardInterrupt


@contextmanager
def shield_new_processes() -> Iterator[None]:
    """Make processes started in the block ignore Ctrl-C, so that only their parent ends them.

    Raises:
        KeyboardInterrupt: As `defer_interrupt`.
    """
    with defer_interrupt():
        if not hasattr(signal, "pthread_sigmask"):  # Windows
            yield
            return
        resource_tracker.ensure_running()  # its start would unblock the signal
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # children inherit it
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
