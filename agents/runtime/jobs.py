"""A command whose input was checked: work that returns the exit status."""

from __future__ import annotations

from collections.abc import Callable

Job = Callable[[], int]
"""Work whose input was checked; returns the exit status."""

DONE = 0
"""Exit status of a command that did what was asked."""
