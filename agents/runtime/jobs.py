"""A job: the work that remains after a command's input was checked; exit statuses."""

from __future__ import annotations

from collections.abc import Callable

DONE = 0
Job = Callable[[], int | None]
"""A command ready to run; returns the exit status, or None for `DONE`, which is success."""
