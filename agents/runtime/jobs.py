"""The work of a command after its input was checked, and its exit status."""

from __future__ import annotations

from collections.abc import Callable

Job = Callable[[], int]
"""A command ready to run; returns the exit status."""

DONE = 0
"""Exit status of success."""
