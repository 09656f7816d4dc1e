"""Routers that call the Open Motion Planning Library (OMPL) in a subprocess.

Reference:
    Sucan, Moll & Kavraki (2012), The Open Motion Planning Library, IEEE Robotics & Automation
    Magazine 19(4).
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.optional_dependencies import require
from ferguson_gym.shortest_paths.scene import scene
from ferguson_gym.world import Field, transition
from planners.interface import Iterations, Route, Seconds
from planners.whole_path.line_of_sight import Barriers
from planners.whole_path.subprocess_worker import Worker, shared_worker

Algorithm = Literal["rrt", "rrt-star", "prm", "bit-star"]

WORKER = "planners.whole_path.ompl_server"
"""Module that runs in the subprocess."""
CONTACT_MARGIN = 1e-12
"""Obstacles touched by start or goal are shrunk by this relative amount, so that rounding does not
put start or goal inside."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Problem:
    """Request to the subprocess: a planning problem."""

    algorithm: Algorithm
    barriers: Barriers
    """What a route keeps clear of."""
    bounds: Array
    """(2, 2) lower and upper bounds of the coordinates [m]."""
    start: Array
    """(2,) [m]."""
    goal: Array
    """(2,) [m]."""
    seed: int
    """From 1 to 2^31 - 1."""
    budget: Iterations | Seconds
    simplify: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Answer:
    """Answer of the subprocess: a route, if one was found."""

    points: Array | None
    """(n, 2) corners [m]; None if no route to the goal was found."""
    progress: Sequence[tuple[float, float]]
    """As in `Route`; the seconds count from the arrival of the request."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Ompl:
    """A planner of OMPL with the library's default settings, as a router.

    Raises:
        ValueError: The algorithm is unknown, OMPL is not installed, or `timeout` is not positive.
    """

    algorithm: Algorithm
    """`rrt` stops at the first route; `rrt-star`, `prm` and `bit-star` use all of their budget."""
    budget: Iterations | Seconds
    """An iteration is one of the tree (`rrt`, `rrt-star`), a milestone (`prm`) or a batch
    (`bit-star`)."""
    simplify: bool = True
    """Whether OMPL's path simplifier shortens the route, in addition to the budget."""
    timeout: float = 60.0
    """Time beyond the budget after which the library counts as hung [s]."""
    worker: Worker = dataclasses.field(default_factory=partial(shared_worker, WORKER), repr=False)
    """Subprocess of the library; routers that share it plan one at a time."""

    def __post_init__(self) -> None:
        if self.algorithm not in get_args(Algorithm):
            known = ", ".join(get_args(Algorithm))
            raise ValueError(f"unknown algorithm {self.algorithm!r}; OMPL's are {known}")
        if not self.timeout > 0:
            raise ValueError(f"timeout must be positive, got {self.timeout!r} s")
        require(self.algorithm, "ompl", "OMPL")

    def route(self, field: Field, vehicle: transition.State, seed: int) -> Route | None:
        """Plan a route (n, 2) from a vehicle to the goal; None if no route was found.

        The route enters no obstacle and stays inside the bounds. Where the vehicle violates them,
        by at most the tolerance, the route violates them no further.

        Raises:
            CrashedError: OMPL crashed or did not answer in time.
            TypeError: The field is not planar.
        """
        began = time.perf_counter()
        problem = self._problem(field, vehicle, seed)
        if problem is None:
            return None
        asked = time.perf_counter() - began
        most = self.budget.seconds if isinstance(self.budget, Seconds) else 0.0
        answer: Answer = self.worker.ask(problem, most + self.timeout)
        if answer.points is None:
            return None
        return Route(
            points=answer.points,
            length=float(np.linalg.norm(np.diff(answer.points, axis=0), axis=1).sum()),
            progress=[(asked + seconds, length) for seconds, length in answer.progress],
        )

    def _problem(self, field: Field, vehicle: transition.State, seed: int) -> Problem | None:
        """The planning problem; None if vehicle or goal is in collision or out of bounds."""
        (discs, _, _, shapes), kept = scene(field)
        obstacles, tolerance = field.obstacles.only_these(kept), field.limits.tolerance
        reach = obstacles.radii.copy()
        for end in (vehicle.position, field.goal):
            depth = -obstacles.signed_distance(end)
            if depth.max(initial=-np.inf) > tolerance:
                return None
            size = np.maximum(discs["radius"], np.abs(depth))
            reach = np.minimum(reach, obstacles.radii - depth - CONTACT_MARGIN * size)
        discs["reach"] = reach if obstacles.are_discs else discs["radius"]
        if not obstacles.are_discs:
            shapes = shapes._replace(reach=reach)
        low, high = field.bounds
        beyond = np.maximum(low - vehicle.position, vehicle.position - high)
        if beyond.max() > tolerance:
            return None
        stream = np.random.default_rng([seed, vehicle.segments])
        bounds = np.stack([np.minimum(low, vehicle.position), np.maximum(high, vehicle.position)])
        return Problem(
            algorithm=self.algorithm,
            barriers=(discs, *shapes),
            bounds=bounds,
            start=vehicle.position,
            goal=field.goal,
            seed=int(stream.integers(1, 2**31)),
            budget=self.budget,
            simplify=self.simplify,
        )
