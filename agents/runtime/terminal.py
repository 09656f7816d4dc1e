"""Who speaks where: what was asked for on standard output, all else on standard error."""

from __future__ import annotations

import os
from typing import TextIO

from rich.console import Console, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

WIDTH = 120
"""Of tables where there is no terminal, in columns."""
COMPILING = "compiling, as ever at the first run: a minute or two"
_PATIENCE = 5.0
"""Seconds without any part done, after which a bar says why that may be."""


def silence(stream: TextIO) -> None:
    """Lead a stream that nobody takes any more to nowhere, so that the rest of it is no error."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


class _Console(Console):
    """A console that goes on, unheard, when its reader has seen enough."""

    def on_broken_pipe(self) -> None:
        """The library would end the program here, and with a status of its own."""
        silence(self.file)  # type: ignore[arg-type]


class _Why(ProgressColumn):
    """What keeps workers from their first part."""

    max_refresh = 0.5

    def render(self, task: Task) -> Text:
        waits = not task.completed and (task.elapsed or 0.0) > _PATIENCE
        return Text(f"({COMPILING}?)" if waits else "")


class Terminal:
    """Results, notes and bars of one command."""

    def __init__(self, *, quiet: bool = False, colour: bool = True, as_json: bool = False) -> None:
        """A terminal; by default it shows all there is.

        Args:
            quiet: no bars and no notes; results, warnings and errors alone.
            colour: whether there may be any; also the environment may forbid it (NO_COLOR).
            as_json: results are one JSON object, no tables.
        """
        plain = None if colour else True
        self._out = _Console(highlight=False, no_color=plain)
        if not self._out.is_terminal:
            self._out = _Console(highlight=False, no_color=plain, width=WIDTH)
        self._err = _Console(highlight=False, no_color=plain, stderr=True)
        self._quiet, self.as_json = quiet, as_json

    @property
    def quiet(self) -> bool:
        """Whether only results, warnings and errors are told."""
        return self._quiet

    def show(self, *results: RenderableType) -> None:
        """Tables and sentences, where they were not asked for as JSON."""
        if not self.as_json:
            for result in results:  # a sentence is one line, but where someone reads it
                whole = isinstance(result, str) and not self._out.is_terminal
                self._out.print(result, markup=False, soft_wrap=whole)

    def show_json(self, text: str) -> None:
        """The one JSON object, if it was asked for."""
        if self.as_json:
            self._out.out(text, highlight=False)

    def note(self, text: str) -> None:
        """What is good to know, but no result."""
        if not self._quiet:
            self._err.print(text, markup=False, soft_wrap=True)

    def bar(self) -> Progress:
        """Of work in parts: how many are done, since when, and how long it may still take."""
        return self._progress(
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            _Why(),
        )

    def share_bar(self) -> Progress:
        """Of work without parts: which share of it is done."""
        return self._progress(
            BarColumn(), TextColumn("{task.percentage:.0f}%"), TimeElapsedColumn()
        )

    def still_bar(self) -> Progress:
        """Of work whose parts are timed: drawn only when it is asked to refresh.

        A thread that draws would be timed, too.
        """
        return self._progress(
            BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), auto_refresh=False
        )

    def _progress(self, *columns: object, auto_refresh: bool = True) -> Progress:
        err = self._err
        return Progress(
            TextColumn("{task.description}"),
            *columns,  # type: ignore[arg-type]
            console=err,
            auto_refresh=auto_refresh,
            transient=True,
            # nothing could be taken away again from a file, nor from a dumb terminal
            disable=self._quiet or not err.is_terminal or err.is_dumb_terminal,
        )
