"""The work of a command after its input was checked, and its exit status."""

from __future__ import annotations

from collections.abc import Callable

DONE = 0
Job = Callable[[], int | None]
"""A command ready to run; returns the exit status, or None for `DONE`, which is success."""
