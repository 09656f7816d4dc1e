"""Planners by name."""

from __future__ import annotations

from collections.abc import Callable

from planners.extras import require
from planners.interface import Planner
from planners.multi_start import MultiStart
from planners.receding_horizon import RecedingHorizon
from planners.shortest import Exact
from planners.swarm import bees, particles
from planners.whole_path import WholePath


def single_start() -> RecedingHorizon:
    """The paper's planner from the shifted plan alone, caught where that is."""
    return RecedingHorizon(random_starts=0, solver=MultiStart(sidesteps=()))


def multi_start() -> RecedingHorizon:
    """The paper's planner from the shifted plan and 10 random feasible starts."""
    return RecedingHorizon()


def shortest() -> WholePath:
    """The exact shortest path, fitted."""
    return WholePath(router=Exact())


def pso() -> WholePath:
    """Particle swarms that move the whole flight, fitted.

    Raises:
        ValueError: pygmo is not installed.
    """
    require("pso", "pygmo", "pygmo")
    return WholePath(router=particles())


def abc() -> WholePath:
    """Artificial bee colonies that move the whole flight, fitted.

    Raises:
        ValueError: pygmo is not installed.
    """
    require("abc", "pygmo", "pygmo")
    return WholePath(router=bees())


PLANNERS: dict[str, Callable[[], Planner]] = {
    "single-start": single_start,
    "multi-start": multi_start,
    "shortest": shortest,
    "pso": pso,
    "abc": abc,
}
"""Makers of planners by name."""


def make(name: str) -> Planner:
    """The planner of this name.

    Raises:
        ValueError: there is none, or its library is not installed.
    """
    if name not in PLANNERS:
        raise ValueError(f"unknown planner {name!r}; planners are {', '.join(PLANNERS)}")
    return PLANNERS[name]()
