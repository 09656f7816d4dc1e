"""What a measurement ran on: processor, threads and versions."""

from __future__ import annotations

import importlib.metadata
import platform
from typing import Any

import numba


def facts(*packages: str) -> dict[str, Any]:
    """Of this machine, with the versions of some installed packages."""
    return {
        "processor": platform.processor() or platform.machine(),
        "threads": numba.get_num_threads(),
        "versions": {
            "python": platform.python_version(),
            **{name: importlib.metadata.version(name) for name in packages},
        },
    }
