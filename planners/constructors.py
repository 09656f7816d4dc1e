"""Constructors of this project's planners, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ferguson_gym.runtime.optional_dependencies import require
from planners.interface import Iterations, Planner, Router
from planners.optimization import MultiStart
from planners.receding_horizon import Convex, Guided, Pursuit, RecedingHorizon
from planners.whole_path.astar import AStar
from planners.whole_path.convex_fit import convex_fit
from planners.whole_path.exact import ShortestPathRouter
from planners.whole_path.gcs import Gcs
from planners.whole_path.ompl import Ompl
from planners.whole_path.planner import Fitter, WholePath
from planners.whole_path.route_fit import fit
from planners.whole_path.swarm import bees, particles
from planners.whole_path.voronoi import VoronoiEdges


def single_start() -> RecedingHorizon:
    """The paper's planner without random guesses; local minima can trap it."""
    return RecedingHorizon(random_starts=0, solver=MultiStart(sidesteps=()))


def multi_start() -> RecedingHorizon:
    """The paper's planner from the shifted plan and 10 random feasible guesses."""
    return RecedingHorizon()


def _fitted(
    router: Callable[..., Router], *needs: str, fitter: Fitter = fit, **options: Any
) -> Callable[[], WholePath]:
    """A constructor of planners that fit segments to routes; `needs` are arguments of `require`."""

    def construct() -> WholePath:
        if needs:
            require(*needs)
        return WholePath(router=router(**options), fitter=fitter)

    return construct


shortest = _fitted(ShortestPathRouter)
"""Segments fitted to the exact shortest path."""
convex_path = _fitted(ShortestPathRouter, fitter=convex_fit)
"""All segments along the exact shortest path at once, by convex programs."""
voronoi = _fitted(VoronoiEdges)
"""Segments fitted to a route along the Voronoi diagram of the obstacles' centres."""
astar = _fitted(AStar, "astar", "networkx", "networkx")
"""Segments fitted to a shortened A* path on a grid."""
rrt = _fitted(Ompl, algorithm="rrt", budget=Iterations(100_000))
"""A rapidly exploring random tree, from OMPL."""
rrt_star = _fitted(Ompl, algorithm="rrt-star", budget=Iterations(12_000))
"""RRT*, from OMPL."""
prm = _fitted(Ompl, algorithm="prm", budget=Iterations(10_000))
"""A probabilistic roadmap, from OMPL."""
bit_star = _fitted(Ompl, algorithm="bit-star", budget=Iterations(40))
"""Batch informed trees, BIT*, from OMPL."""
pso = _fitted(particles, "pso", "pygmo", "pygmo")
"""Segments fitted to a route that particle swarms find."""
abc = _fitted(bees, "abc", "pygmo", "pygmo")
"""Segments fitted to a route that artificial bee colonies find."""
gcs = _fitted(Gcs)
"""Graphs of Convex Sets, from Drake."""

OWN: dict[str, Callable[[], Planner]] = {
    "single-start": single_start,
    "multi-start": multi_start,
    "guided": Guided,
    "pursuit": Pursuit,
    "convex": Convex,
    "shortest": shortest,
    "convex-path": convex_path,
    "voronoi": voronoi,
    "astar": astar,
    "rrt": rrt,
    "rrt-star": rrt_star,
    "prm": prm,
    "bit-star": bit_star,
    "pso": pso,
    "abc": abc,
    "gcs": gcs,
}
"""Constructors by name; they raise a ValueError if a library is not installed."""
