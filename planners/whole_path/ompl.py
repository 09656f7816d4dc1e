"""Planners of the Open Motion Planning Library as routers; the library runs in a worker.

Reference:
    Sucan, Moll & Kavraki (2012), The Open Motion Planning Library, IEEE Robotics & Automation
    Magazine 19(4).
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, get_args

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.optional_dependencies import require
from ferguson_gym.shortest_paths.tangents import Records, scene
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS
from planners.interface import Iterations, Route, Seconds
from planners.whole_path.subprocess_worker import Worker

Algorithm = Literal["rrt", "rrt-star", "prm", "bit-star"]

WORKER = "planners.whole_path.ompl_server"
"""The module that answers."""
HAIR = 1e-12
"""Discs that the ends touch are smaller by this part: rounding must not shut the ends in."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Problem:
    """What the worker is asked."""

    algorithm: Algorithm
    discs: Records
    """(n,); no point of a route is nearer to a centre than the disc's reach."""
    bounds: Array
    """(2, 2) least and greatest coordinates [m]."""
    start: Array
    """(2,) [m]."""
    goal: Array
    """(2,) [m]."""
    seed: int
    """In 1 to 2^31 - 1."""
    budget: Iterations | Seconds
    simplify: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Answer:
    """What the worker found."""

    points: Array | None
    """(n, 2) corners [m]; None if no route to the goal was found."""
    progress: Sequence[tuple[float, float]]
    """As in `Route`; seconds count from the arrival of the problem."""


@cache
def shared_worker() -> Worker:
    """The process that all routers share: it takes a second to start, and answers by the seed."""
    return Worker(WORKER)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Ompl:
    """A planner of OMPL, with the library's default settings.

    Raises:
        ValueError: an unknown algorithm, OMPL is not installed, patience that is not positive.
    """

    algorithm: Algorithm
    """`rrt` stops at the first route; `rrt-star`, `prm` and `bit-star` use their budget up."""
    budget: Iterations | Seconds
    """Iterations are those of the tree (`rrt`, `rrt-star`), milestones (`prm`) or batches
    (`bit-star`)."""
    simplify: bool = True
    """Whether OMPL's path simplifier shortens the route; its time adds to the budget."""
    patience: float = 60.0
    """Time beyond the budget after which the library is taken to hang [s]."""
    worker: Worker = dataclasses.field(default_factory=shared_worker, repr=False)
    """Where the library runs; routers that share one plan one after the other."""

    def __post_init__(self) -> None:
        if self.algorithm not in get_args(Algorithm):
            known = ", ".join(get_args(Algorithm))
            raise ValueError(f"unknown algorithm {self.algorithm!r}; OMPL's are {known}")
        if not self.patience > 0:
            raise ValueError(f"patience must be positive, got {self.patience!r} s")
        require(self.algorithm, "ompl", "OMPL")

    def route(self, field: Field, vehicle: transition.State, seed: int) -> Route | None:
        """A route from a vehicle to the goal, None if none was found.

        It enters no disc and stays inside the bounds, but where the vehicle already violates them
        by the tolerance; there it goes no deeper.

        Raises:
            CrashedError: OMPL crashed or did not answer.
            TypeError: obstacles other than discs in the plane.
        """
        began = time.perf_counter()
        problem = self._problem(field, vehicle, seed)
        if problem is None:
            return None
        asked = time.perf_counter() - began
        most = self.budget.seconds if isinstance(self.budget, Seconds) else 0.0
        answer: Answer = self.worker.ask(problem, most + self.patience)
        if answer.points is None:
            return None
        return Route(
            points=answer.points,
            length=float(np.linalg.norm(np.diff(answer.points, axis=0), axis=1).sum()),
            progress=[(asked + seconds, length) for seconds, length in answer.progress],
        )

    def _problem(self, field: Field, vehicle: transition.State, seed: int) -> Problem | None:
        """What to ask; None where the vehicle is not free."""
        discs = scene(field)[0].discs.copy()
        tolerance = PAPER_LIMITS.tolerance
        discs["reach"] = discs["radius"]
        for end in (vehicle.position, field.goal):
            distance = np.hypot(discs["x"] - end[0], discs["y"] - end[1])
            if (distance < discs["radius"] - tolerance).any():
                return None
            discs["reach"] = np.minimum(discs["reach"], distance * (1.0 - HAIR))
        low, high = field.bounds
        beyond = np.maximum(low - vehicle.position, vehicle.position - high)
        if beyond.max() > tolerance:
            return None
        stream = np.random.default_rng([seed, vehicle.segments])
        return Problem(
            algorithm=self.algorithm,
            discs=discs,
            bounds=np.stack(
                [np.minimum(low, vehicle.position), np.maximum(high, vehicle.position)]
            ),
            start=vehicle.position,
            goal=field.goal,
            seed=int(stream.integers(1, 2**31)),
            budget=self.budget,
            simplify=self.simplify,
        )
