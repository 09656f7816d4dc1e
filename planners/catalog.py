"""Planners by name."""

from __future__ import annotations

from collections.abc import Callable

from planners.astar import AStar
from planners.budget import Iterations
from planners.extras import require
from planners.guided import Guided
from planners.interface import Planner
from planners.multi_start import MultiStart
from planners.ompl_router import Ompl
from planners.receding_horizon import RecedingHorizon
from planners.shortest import Exact
from planners.swarm import bees, particles
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


def rrt() -> WholePath:
    """A rapidly exploring random tree, from OMPL."""
    return WholePath(router=Ompl(algorithm="rrt", budget=Iterations(100_000)))


def rrt_star() -> WholePath:
    """RRT*, from OMPL."""
    return WholePath(router=Ompl(algorithm="rrt-star", budget=Iterations(12_000)))


def prm() -> WholePath:
    """A probabilistic roadmap, from OMPL."""
    return WholePath(router=Ompl(algorithm="prm", budget=Iterations(10_000)))


def bit_star() -> WholePath:
    """Batch informed trees, BIT*, from OMPL."""
    return WholePath(router=Ompl(algorithm="bit-star", budget=Iterations(40)))


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
    "guided": Guided,
    "shortest": shortest,
    "voronoi": voronoi,
    "astar": astar,
    "rrt": rrt,
    "rrt-star": rrt_star,
    "prm": prm,
    "bit-star": bit_star,
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
