"""Plans the same fields with several planners, one after the other, and measures the plans."""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from joblib import delayed

from agents.policies.warm_up import warm
from agents.runtime.worker_processes import map_in_processes
from ferguson_gym.curves import Path
from ferguson_gym.curves.turning import bending_energy, fastest_turn
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import exact_length, gap, reference_length
from ferguson_gym.world import Field, inspect, is_feasible
from planners.interface import Plan, Route, Status, initial_state
from planners.reachability import unreachable_plan

LIBRARIES = ("numpy", "scipy", "numba", "networkx", "ompl", "pygmo", "drake")
"""Libraries that plans depend on, whose versions are recorded."""
FALSE_SUCCESS = "false_success"
"""Status of a plan that was reported as solved but fails the benchmark's own check."""
_AFTERWARDS = "planners.csv has the plans before"
_ROUNDING = 1e-6
"""Relative rounding error by which a path may be shorter than the shortest."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Run:
    """One planner's plan of one field, measured; values that a failed plan lacks are None."""

    planner: str
    field: Field
    seed: int
    status: str
    """The label of the planner's status, or `FALSE_SUCCESS`."""
    route: Route | None
    """Route of a whole-path planner before the fit."""
    control: Array
    """Segments (n, 4, 2) of a success; n = 0 for a failure."""
    exact_length: float | None
    """Length of the field's shortest path [m]; None also if the start is within the gate of the
    goal."""
    length: float | None
    clearance: float | None
    """Minimum clearance along the path [m]."""
    min_turn_radius: float | None
    """Smallest turn radius [m]; infinite on a straight path."""
    max_turn_speed: float | None
    """Speed of a coordinated turn at the paper's roll angle at the sharpest turn [m/s]."""
    bending: float | None
    """Integral of squared curvature over arc length [1/m]."""
    evaluations: int | None
    """Evaluations of the objective in the search, without those of the fit."""
    reason: str
    """Message of a crash; empty otherwise."""
    seconds: float
    """Planning time with fit and certification [s]."""

    @property
    def success(self) -> bool:
        """Whether the plan was solved and passed the benchmark's own check."""
        return self.status == Status.SOLVED.label

    @property
    def raw_length(self) -> float | None:
        """Length of the route before the fit [m]."""
        return None if self.route is None else self.route.length

    @property
    def raw_gap(self) -> float | None:
        """Gap of the route before the fit."""
        return self._gap(self.raw_length)

    @property
    def gap(self) -> float | None:
        """Gap of the path."""
        return self._gap(self.length)

    def _gap(self, length: float | None) -> float | None:
        exact = self.exact_length
        return None if length is None or exact is None else gap(length, exact)

    @property
    def segments(self) -> int | None:
        """Number of segments."""
        return len(self.control) if self.success else None

    @property
    def seconds_first(self) -> float | None:
        """Time until the first route or, without routes, until the path [s]."""
        if self.route is not None:
            return self.route.progress[0][0]
        return self.seconds if self.success else None

    @property
    def improved(self) -> bool:
        """Whether the planner found a shorter route after its first."""
        return self.route is not None and len(self.route.progress) > 1


def certified(control: Array, field: Field) -> bool:
    """Whether segments (n, 4, 2) are a feasible path from a field's start to its goal."""
    try:
        path = Path(control)
    except ValueError:  # joints that do not meet
        return False
    exact = exact_length(field)
    return (
        len(path) <= field.limits.segments
        and np.array_equal(control[0, 0], field.start)
        and np.array_equal(control[0, 2], field.departure)
        and np.array_equal(control[-1, 1], field.goal)
        and bool(is_feasible(control, field).all())
        and (exact is None or gap(path.length, exact) >= -_ROUNDING)
    )


def run(name: str, seconds: float | None, field: Field, seed: int) -> Run:
    """Plan one field from its start and measure the plan; called in worker processes.

    `seconds` is the search time of a planner with a budget [s]; None: its own budget. A crash of a
    planner's library is a failed plan. Any other error is raised with a note that names the planner
    and the field.

    Raises:
        ValueError: the planner is unknown.
    """
    # planners may cache by a field's identity, so each run gets its own copy
    field = dataclasses.replace(field)
    try:
        planner = warm(name, seconds)
        unreachable = unreachable_plan(field)
        began = time.perf_counter()
        plan = unreachable or planner.plan(field, initial_state(field), seed)
        elapsed = time.perf_counter() - began
    except Exception as error:
        error.add_note(f"while {name} planned the field {field.name} with seed {seed}")
        raise
    return measure(name, field, seed, plan, elapsed)


def measure(name: str, field: Field, seed: int, plan: Plan, seconds: float) -> Run:
    """Measure a plan that took some seconds."""
    path = plan.path if plan.success and certified(plan.control, field) else None
    radius = None if path is None else path.min_turn_radius
    return Run(
        planner=name,
        field=field,
        seed=seed,
        status=plan.status.label if path is not None or not plan.success else FALSE_SUCCESS,
        route=plan.route,
        control=np.empty((0, 4, 2)) if path is None else path.control,
        exact_length=reference_length(field),
        length=None if path is None else path.length,
        clearance=None if path is None else float(inspect(path.control, field).clearance.min()),
        min_turn_radius=radius,
        max_turn_speed=None if radius is None else fastest_turn(radius),
        bending=None if path is None else float(bending_energy(path.control).sum()),
        evaluations=plan.evaluations or None,
        reason=plan.reason,
        seconds=seconds,
    )


def runs(
    planners: Sequence[str],
    seconds: float | None,
    fields: Sequence[Field],
    seeds: Sequence[int],
    workers: int,
) -> Iterator[Run]:
    """Run every planner on every field with every seed, in an order independent of workers.

    All planners plan a field before the next, so that a slow phase of the machine affects all.

    Raises:
        WorkerDiedError: workers died repeatedly at the same plan.
    """
    tasks = itertools.product(fields, seeds, planners)
    calls = (delayed(run)(name, seconds, field, seed) for field, seed, name in tasks)
    with map_in_processes(calls, workers, in_order=True, afterwards=_AFTERWARDS) as results:
        yield from results
