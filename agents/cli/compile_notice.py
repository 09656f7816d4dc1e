"""Tells that code is being compiled, where a command would else seem to stand still."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from numba.core import event

from agents.runtime.terminal import COMPILING, Terminal


class _First(event.Listener):
    """Hears of the first compilation; what an earlier run has compiled causes none."""

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
    """Note it once, if the block sets about to compile in this process and shows no bar."""
    with event.install_listener("numba:compile", _First(terminal)):
        yield
