"""Routes by particle swarm and by artificial bee colony: the whole flight as one chain.

Swarms with different random seeds run one after the other, each for a fixed number of evaluations,
until the budget is used up. The route is the shortest chain that is certified collision-free. A
colliding chain counts as a failure; it is not repaired.

Reference:
    Kennedy & Eberhart (1995), Particle swarm optimization; Karaboga (2005), An idea based on
    honey bee swarm for numerical optimization; both as in pagmo: Biscani & Izzo (2020), A
    parallel global multiobjective framework for optimization: pagmo, J. Open Source Software 5.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ferguson_gym.curves import evaluate, length
from ferguson_gym.curves.certified_kernels import bounds_margins
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, transition
from planners.interface import Evaluations, Route, Seconds
from planners.whole_path.swarm_objective import ChainObjective, Encoding, Penalties, chain_objective

BUDGET = Evaluations(150_000)
"""About a second."""
MAX_SEGMENTS = 1000
"""Greatest number of segments of a chain."""
TOLERANCE = 1e-6
"""Depth in obstacles and outside the bounds [m] that certification tolerates."""
POINTS = 50
"""Number of points of a route on each segment."""


class Method(Protocol):
    """An algorithm of pygmo and its parameters."""

    @property
    def size(self) -> int:
        """Number of particles or bees."""

    def algorithm(self, generations: int, seed: int) -> Any:
        """The pygmo.algorithm that evolves a population for a number of generations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Particles:
    """Particle swarm: each particle is drawn to its own and its neighbours' best positions."""

    size: int = 25

    def algorithm(self, generations: int, seed: int) -> Any:
        """The algorithm; particles keep their velocities from call to call."""
        import pygmo

        return pygmo.algorithm(pygmo.pso(gen=generations, memory=True, seed=seed))


@dataclass(frozen=True, slots=True, kw_only=True)
class Bees:
    """Artificial bee colony; each bee changes one unknown at a time."""

    size: int = 20
    limit: int = 200
    """Trials after which a source without improvement is abandoned. pygmo restarts the count with
    each call; in training fields neither that nor a limit of 60 made a difference."""

    def algorithm(self, generations: int, seed: int) -> Any:
        """The algorithm."""
        import pygmo

        return pygmo.algorithm(pygmo.bee_colony(gen=generations, limit=self.limit, seed=seed))


@dataclass(frozen=True, slots=True, kw_only=True)
class Swarms:
    """Routes by one swarm after the other."""

    method: Method
    encoding: Encoding = dataclasses.field(default_factory=Encoding)
    penalties: Penalties = dataclasses.field(default_factory=Penalties)
    budget: Evaluations | Seconds = BUDGET
    evaluations_per_swarm: int = 25_000
    """Evaluations of each swarm."""
    generations: int = 50
    """Generations between checks of the budget and of the best chain."""
    smallest_spread: float = 0.05
    """Initial unknowns are drawn from [-r, r], with r log-uniform between this value and 1, so that
    some chains start near the straight line."""

    def route(self, field: Field, vehicle: transition.State, seed: int) -> Route | None:
        """The shortest certified chain that any swarm finds; None if there is none.

        No chain is searched for if the goal is out of reach of the remaining segments, or of
        `MAX_SEGMENTS`. The budget
        is checked after each round of generations and may be exceeded by one round.

        Raises:
            ValueError: a field that is not planar.
        """
        began = time.perf_counter()
        distance = float(np.linalg.norm(field.goal - vehicle.position))
        left = field.limits.segments - vehicle.segments
        if distance > field.limits.longest * left:
            return None
        if self.encoding.segments(distance) > MAX_SEGMENTS:
            return None  # the encoding needs memory with the square of their number
        objective = chain_objective(field, vehicle, self.encoding, self.penalties)
        stream = np.random.default_rng([seed, vehicle.segments])
        best: Array | None = None
        progress: list[tuple[float, float]] = []
        evaluations = 0
        for unknowns, more in self._best_of_each_round(objective, stream):
            evaluations += more
            chain = objective.control(unknowns)
            flown = float(length(chain).sum())
            shorter = best is None or flown < progress[-1][1]
            if shorter and _is_clear(chain, field):
                best = chain
                progress.append((time.perf_counter() - began, flown))
            if self._is_spent(evaluations, time.perf_counter() - began):
                break
        if best is None:
            return None
        curve = evaluate(best, np.linspace(0.0, 1.0, POINTS + 1)[1:]).reshape(-1, 2)
        return Route(
            points=np.concatenate([vehicle.position[None], curve]),
            length=progress[-1][1],
            progress=progress,
            evaluations=evaluations,
        )

    def _best_of_each_round(
        self, objective: ChainObjective, stream: np.random.Generator
    ) -> Iterator[tuple[Array, int]]:
        """Best unknowns of a swarm after each round of generations, and the round's evaluations."""
        import pygmo

        problem = pygmo.problem(_Problem(objective))
        while True:
            swarm = pygmo.population(problem, seed=int(stream.integers(2**31)))
            reach = self.smallest_spread ** stream.uniform(0.0, 1.0, (self.method.size, 1))
            for x in reach * stream.uniform(-1.0, 1.0, (len(reach), objective.unknowns)):
                swarm.push_back(x)
            algorithm = self.method.algorithm(self.generations, int(stream.integers(2**31)))
            before = 0
            while before < self.evaluations_per_swarm:
                swarm = algorithm.evolve(swarm)
                evaluations = swarm.problem.get_fevals()
                yield swarm.champion_x, evaluations - before
                before = evaluations

    def _is_spent(self, evaluations: int, seconds: float) -> bool:
        if isinstance(self.budget, Seconds):
            return seconds >= self.budget.seconds
        return evaluations >= self.budget.count


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """The objective in the form of pygmo."""

    objective: ChainObjective

    def fitness(self, x: Array) -> tuple[float]:
        return (self.objective.value(x),)

    def get_bounds(self) -> tuple[list[float], list[float]]:
        unknowns = self.objective.unknowns
        return [-1.0] * unknowns, [1.0] * unknowns


def _is_clear(chain: Array, field: Field) -> bool:
    """Whether a chain is certified to keep clear of obstacles and inside the bounds."""
    clear = bool((field.obstacles.clearance(chain) >= -TOLERANCE).all())
    return clear and bool((bounds_margins(chain, field.bounds) >= -TOLERANCE).all())


def particles() -> Swarms:
    """Particle swarms with the best parameters in training fields.

    An encoding in which each unknown moves one knot sideways gives slightly shorter paths, but
    finds no route in a third of the dense fields.
    """
    encoding, penalties = Encoding(spacing=13.0), Penalties(inside=10.0)
    return Swarms(method=Particles(), encoding=encoding, penalties=penalties)


def bees() -> Swarms:
    """Bee colonies with the best parameters in training fields.

    Bees change one unknown at a time, so that some unknowns must bend the whole chain.
    """
    return Swarms(method=Bees(), penalties=Penalties(inside=10.0))
