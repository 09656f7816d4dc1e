"""Announces first-run compilation, during which a command would seem to hang, as commands do."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from agents.runtime.terminal import Terminal
from ferguson_gym.runtime import compilation


class _Notes(logging.Handler):
    def __init__(self, terminal: Terminal, warn: Callable[[str], None]) -> None:
        super().__init__()
        self._terminal, self._warn = terminal, warn

    def emit(self, record: logging.LogRecord) -> None:
        if record.name == compilation.__name__:
            self._terminal.note(record.getMessage())
        else:
            self._warn(record.getMessage())


@contextmanager
def announce_compilation(terminal: Terminal, warn: Callable[[str], None]) -> Iterator[None]:
    """Print what the package reports of its compilation in the block.

    Args:
        terminal: prints the notice that kernels are compiled, unless it is quiet.
        warn: prints warnings.
    """
    logger, handler = logging.getLogger(compilation.PACKAGE), _Notes(terminal, warn)
    before, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.propagate = before
