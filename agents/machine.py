"""What a measurement ran on: processor, threads and versions."""

from __future__ import annotations

import importlib.metadata
import platform
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


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
