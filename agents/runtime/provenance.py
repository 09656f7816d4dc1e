"""What a measurement ran on: processor, threads and versions."""

from __future__ import annotations

import importlib.metadata
import platform
import subprocess
from pathlib import Path
from typing import Any

import numba


def facts(*packages: str) -> dict[str, Any]:
    """Of this machine, with the versions of those of some packages that are installed."""
    return {
        "processor": platform.processor() or platform.machine(),
        "threads": numba.get_num_threads(),
        "versions": {
            "python": platform.python_version(),
            **{name: version for name in packages if (version := _version(name))},
        },
    }


def commit() -> str | None:
    """The commit of this checkout, with `-dirty` behind it if files were changed since.

    None where there is no checkout, or no git.
    """
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return None
    ask = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        answer = subprocess.run(ask, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return answer.stdout.strip()


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
