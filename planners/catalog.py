"""Planners by name."""

from __future__ import annotations

from collections.abc import Callable

from planners.astar import AStar
from planners.extras import require
from planners.interface import Planner
from planners.multi_start import MultiStart
from planners.receding_horizon import RecedingHorizon
from planners.shortest import Exact
from planners.voronoi import VoronoiEdges
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


def voronoi() -> WholePath:
    """The Voronoi diagram of the obstacles' centres, fitted."""
    return WholePath(router=VoronoiEdges())


def astar() -> WholePath:
    """A* on a grid, pulled tight and fitted.

    Raises:
        ValueError: networkx is not installed.
    """
    require("astar", "networkx", "networkx")
    return WholePath(router=AStar())


PLANNERS: dict[str, Callable[[], Planner]] = {
    "single-start": single_start,
    "multi-start": multi_start,
    "shortest": shortest,
    "voronoi": voronoi,
    "astar": astar,
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
