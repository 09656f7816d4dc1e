"""Optional libraries: a check that one is installed, and the command that installs it."""

from __future__ import annotations

import importlib.util
from pathlib import Path


def require(planner: str, module: str, library: str, extra: str = "peers") -> None:
    """Check that a planner's library, imported as `module`, is installed; do not import it.

    Raises:
        ValueError: it is not; the message names the planner, the library and the extra that
            installs it.
    """
    if importlib.util.find_spec(module) is None:
        raise ValueError(f"planner {planner!r} needs {library}: {installing(extra)}")


def installing(extra: str) -> str:
    """The command that installs an extra of this project, in a checkout as the README has it."""
    if (Path(__file__).parents[2] / "pyproject.toml").is_file():
        return f".venv/bin/pip install --editable '.[{extra}]'"
    return f"pip install 'ferguson-gym[{extra}]'"
