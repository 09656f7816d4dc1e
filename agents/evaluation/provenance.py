"""Provenance of results: versions, commit, machine, and the files of models."""

from __future__ import annotations

import hashlib
import os
import platform
from functools import cache
from typing import Any

from agents.models import shipped_agents
from agents.policies import PolicySpec
from agents.policies.registry import make_planner
from agents.runtime import provenance
from ferguson_gym.world import Field
from planners.interface import Seconds

LIBRARIES = (
    *("ferguson-gym", "gymnasium", "numpy", "scipy", "numba"),
    *("torch", "stable-baselines3", "sb3-contrib", "ompl", "pygmo", "networkx"),
)
"""Libraries that flights depend on."""


@cache
def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that flights depend on."""
    return dict(provenance.facts(*LIBRARIES)["versions"])


def software() -> dict[str, Any]:
    """Versions and commit, on which flights depend beside the request."""
    return {"versions": versions(), "commit": provenance.commit()}


def facts() -> dict[str, Any]:
    """Processor, platform, cores and threads of this machine."""
    known = provenance.facts()
    return {
        "processor": known["processor"],
        "platform": platform.platform(),
        "cores": os.cpu_count(),
        "threads": known["threads"],
    }


def models(policy: str) -> dict[str, str]:
    """SHA-256 of the files of a policy's models, by path; empty for planners."""
    return {
        str(file): hashlib.sha256(file.read_bytes()).hexdigest()
        for agent in PolicySpec.parse(policy).agents
        if (place := shipped_agents.find_agent(agent)) is not None
        for file in (place / name for name in ("model.zip", "model.json"))
        if file.is_file()
    }


def stopped_by_clock(policy: str) -> bool:
    """Whether a planner stops after some seconds, so that flights do not repeat exactly."""
    spec = PolicySpec.parse(policy)
    if not spec.is_planner:
        return False
    router = getattr(make_planner(spec), "router", None)
    return isinstance(getattr(router, "budget", None), Seconds)


def hash_field(field: Field) -> str:
    """SHA-256 of a field's arrays, limits and obstacles."""
    obstacles = field.obstacles
    arrays = [field.start, field.goal, field.bounds, field.departure]
    arrays += [obstacles.points, obstacles.radii]
    rest = repr(field.limits).encode()
    if not obstacles.are_discs:
        rest += obstacles.starts.tobytes()
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays) + rest).hexdigest()
