"""Progress as lines of text, where a bar cannot be drawn: in files, pipes and dumb terminals."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from rich.progress import Progress, Task

EVERY = 60.0
"""Time between two lines [s]."""


class ProgressLines(Progress):
    """Writes a line for each unfinished task about once a minute.

    The first line comes after a minute: what takes less needs no progress. A field `line` of a task
    replaces its line.
    """

    def __init__(
        self,
        write: Callable[[str], None],
        *,
        counts: bool = True,
        threaded: bool = True,
        every: float | None = None,
    ) -> None:
        """Set up the lines.

        Args:
            write: writes one line.
            counts: whether the lines show numbers of parts; else percentages.
            threaded: whether a thread writes; else lines are written on `refresh` alone.
            every: time between two lines [s]; None: `EVERY`.
        """
        super().__init__(disable=True, auto_refresh=threaded)
        self._write, self._counts, self._every = write, counts, every or EVERY
        self._threaded = threaded
        self._stopped = threading.Event()
        self._due = 0.0

    def start(self) -> None:
        """Begin; the block of a `with` statement does so."""
        self._due = time.monotonic() + self._every
        if self._threaded:
            self._stopped.clear()
            threading.Thread(target=self._write_until_stopped, daemon=True).start()

    def stop(self) -> None:
        """Write no more lines."""
        self._stopped.set()

    def refresh(self) -> None:
        """Write lines if the last ones are old enough."""
        now = time.monotonic()
        if not self._due or now < self._due:
            return
        self._due = now + self._every
        for task in self.tasks:
            if not task.finished:
                self._write(self._line(task))

    def _write_until_stopped(self) -> None:
        while not self._stopped.wait(self._every):
            self._due = time.monotonic()
            self.refresh()

    def _line(self, task: Task) -> str:
        if (line := task.fields.get("line")) is not None:
            return str(line)
        text = task.description
        if task.total is not None and self._counts:
            text = f"{text}: {task.completed:,.0f} of {task.total:,.0f}"
        elif task.total is not None:
            text = f"{text}: {task.percentage:.0f}%"
        return f"{text}, after {_duration(task.elapsed or 0.0)}"


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02} min"
