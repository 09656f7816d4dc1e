"""How results were made: versions, commit, machine, and the files of models."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from agents.models import shipped_agents
from agents.policies.registry import FROM, SHIELDED, is_planner, make_planner, plain_agent
from agents.runtime import provenance
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Discs
from planners.interface import Seconds

LIBRARIES = (
    "ferguson-gym",
    "gymnasium",
    "numpy",
    "scipy",
    "numba",
    "daqp",
    "torch",
    "stable-baselines3",
    "sb3-contrib",
    "ompl",
    "pygmo",
    "networkx",
)
"""What flights depend on."""


@cache
def _versions() -> str:
    return json.dumps(provenance.facts(*LIBRARIES)["versions"])


def versions() -> dict[str, str]:
    """Of Python and the libraries that flights depend on."""
    found: dict[str, str] = json.loads(_versions())
    return found


def software() -> dict[str, Any]:
    """What else than the request decides on flights."""
    return {"versions": versions(), "commit": provenance.commit()}


def facts() -> dict[str, Any]:
    """Of this machine."""
    known = provenance.facts()
    return {
        "processor": known["processor"],
        "platform": platform.platform(),
        "cores": os.cpu_count(),
        "threads": known["threads"],
    }


def models(policy: str) -> dict[str, str]:
    """SHA-256 of the files of every model that a policy flies with, by path; none for planners."""
    return {
        str(file): hashlib.sha256(file.read_bytes()).hexdigest()
        for place in _agents(policy)
        for file in (place / name for name in ("model.zip", "model.json"))
        if file.is_file()
    }


def _agents(policy: str) -> Iterator[Path]:
    """Directories of the agents in a policy's name."""
    plain = policy.removesuffix(SHIELDED)
    if is_planner(plain):
        proposer = plain.partition(FROM)[2]
        if proposer:
            yield from _agents(proposer)
    elif (place := shipped_agents.find(plain_agent(plain))) is not None:
        yield place


def stopped_by_clock(policy: str) -> bool:
    """Whether a policy's planner searches for a time, so that its flights do not repeat."""
    plain = policy.removesuffix(SHIELDED)
    if not is_planner(plain):
        return False
    router = getattr(make_planner(plain), "router", None)
    return isinstance(getattr(router, "budget", None), Seconds)


def hash_field(field: Field) -> str:
    """SHA-256 of what a field holds."""
    found = hashlib.sha256()
    for array in (field.start, field.goal, field.bounds, field.departure):
        found.update(array.tobytes())
    obstacles = field.obstacles
    if isinstance(obstacles, Discs):
        found.update(obstacles.centers.tobytes() + obstacles.radii.tobytes())
    else:
        found.update(repr(obstacles).encode())
    return found.hexdigest()
