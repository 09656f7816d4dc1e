"""Terminal output: results on standard output, notes and progress bars on standard error."""

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

from agents.runtime.progress_lines import ProgressLines

WIDTH = 120
"""Width of tables without a terminal, in columns."""
HINT = "(is it compiling, on the first run?)"
"""Shown where worker processes, which announce nothing, may be compiling."""
_HINT_AFTER = 5.0
"""Seconds without a finished part, after which a bar shows the hint."""


def silence(stream: TextIO) -> None:
    """Redirect a closed stream to the null device, so that further output raises no error."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)


class _Console(Console):
    """A console that continues silently when its reader closes the pipe."""

    def on_broken_pipe(self) -> None:
        """Continue; the library would end the program with its own exit status."""
        silence(self.file)  # type: ignore[arg-type]


class _CompilationHint(ProgressColumn):
    """Explains why the first part takes long."""

    max_refresh = 0.5

    def render(self, task: Task) -> Text:
        waits = not task.completed and (task.elapsed or 0.0) > _HINT_AFTER
        return Text(HINT if waits else "")


class Terminal:
    """Results, notes and progress bars of one command; lines where no bar can be drawn."""

    def __init__(self, *, quiet: bool = False, colour: bool = True, as_json: bool = False) -> None:
        """Set up the output; by default everything is shown.

        Args:
            quiet: whether to omit progress bars and notes.
            colour: whether to use colours; the environment may forbid them too (NO_COLOR).
            as_json: whether results are one JSON object instead of tables.
        """
        plain = None if colour else True
        self._out = _Console(highlight=False, no_color=plain)
        if not self._out.is_terminal:
            self._out = _Console(highlight=False, no_color=plain, width=WIDTH)
        self._err = _Console(highlight=False, no_color=plain, stderr=True)
        self.quiet, self.as_json = quiet, as_json

    def show(self, *results: RenderableType) -> None:
        """Print tables and sentences, unless results are JSON."""
        if not self.as_json:
            for result in results:  # sentences are wrapped on terminals only
                whole = isinstance(result, str) and not self._out.is_terminal
                self._out.print(result, markup=False, soft_wrap=whole)

    def show_json(self, text: str) -> None:
        """Print the JSON object, if results are JSON."""
        if self.as_json:
            self._out.out(text, highlight=False)

    def note(self, text: str) -> None:
        """Print a note to standard error, unless quiet."""
        if not self.quiet:
            self._err.print(text, markup=False, soft_wrap=True)

    def bar(self) -> Progress:
        """Progress bar with the number of finished parts, elapsed and remaining time."""
        times = (TimeElapsedColumn(), TimeRemainingColumn(), _CompilationHint())
        return self._progress(BarColumn(), MofNCompleteColumn(), *times)

    def share_bar(self) -> Progress:
        """Progress bar with the percentage done, for work without parts."""
        percentage = TextColumn("{task.percentage:.0f}%")
        return self._progress(BarColumn(), percentage, TimeElapsedColumn(), counts=False)

    def still_bar(self) -> Progress:
        """Progress bar for timed parts, which a thread that draws would disturb: on `refresh`."""
        columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        return self._progress(*columns, auto_refresh=False)

    def _progress(
        self, *columns: object, auto_refresh: bool = True, counts: bool = True
    ) -> Progress:
        err = self._err
        # a bar cannot be erased from a file or a dumb terminal
        if not self.quiet and (not err.is_terminal or err.is_dumb_terminal):
            return ProgressLines(self.note, counts=counts, threaded=auto_refresh)
        return Progress(
            TextColumn("{task.description}"),
            *columns,  # type: ignore[arg-type]
            console=err,
            auto_refresh=auto_refresh,
            transient=True,
            disable=self.quiet,
        )
