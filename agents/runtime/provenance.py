"""Provenance of a measurement: processor, threads, versions and commit."""

from __future__ import annotations

import importlib.metadata
import platform
import subprocess
from pathlib import Path
from typing import Any

import numba


def facts(*packages: str) -> dict[str, Any]:
    """Processor, number of threads and versions of Python and of installed `packages`."""
    return {
        "processor": platform.processor() or platform.machine(),
        "threads": numba.get_num_threads(),
        "versions": {
            "python": platform.python_version(),
            **{name: version for name in packages if (version := _version(name))},
        },
    }


def commit() -> str | None:
    """The commit of this checkout, with the suffix `-dirty` if files have changed since.

    None outside a checkout or without Git.
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
