"""Optional libraries: whether one is there, and what to install where it is missing."""

from __future__ import annotations

import importlib.util


def require(planner: str, module: str, library: str) -> None:
    """See that a planner's library is there, without importing it.

    Args:
        planner: its name in the catalog.
        module: what would be imported.
        library: the name by which pip and people know it.

    Raises:
        ValueError: it is not installed.
    """
    if importlib.util.find_spec(module) is None:
        raise ValueError(f"planner {planner!r} needs {library}: {installing('peers')}")


def installing(extra: str) -> str:
    """The command that installs an extra of this project, in its checkout, as the README has it."""
    return f".venv/bin/pip install --editable '.[{extra}]'"
