"""Announces first-run compilation, during which a command would seem to hang."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from numba.core import event

from agents.runtime.terminal import COMPILING, Terminal


class _First(event.Listener):  # loading code that is compiled already is no event
    def __init__(self, terminal: Terminal) -> None:
        self._terminal: Terminal | None = terminal

    def on_start(self, event: object) -> None:
        terminal, self._terminal = self._terminal, None
        if terminal is not None:
            terminal.note(COMPILING)

    def on_end(self, event: object) -> None:
        pass


@contextmanager
def announce_compilation(terminal: Terminal) -> Iterator[None]:
    """Print one note if the block compiles in this process; for blocks without a progress bar."""
    with event.install_listener("numba:compile", _First(terminal)):
        yield
