"""What `ferguson plan` prints: a plan as text and as JSON."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from agents.flights import Flight
from agents.flights.field_changes import UNCHANGED, FieldChanges
from agents.flights.metrics import finite
from agents.flights.path_file import write_path
from agents.plots.flight_grid import draw_flights
from agents.runtime import terminal_tables
from ferguson_gym.curves import Path as Curve
from ferguson_gym.shortest_paths import gap
from ferguson_gym.world import Field, inspect
from planners.deadline import plan_within
from planners.interface import Plan, Planner, Route, Status, initial_state
from planners.reachability import start_hint, unreachable_plan


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Report:
    """A plan, and how it is printed."""

    name: str
    """Canonical name of the planner."""
    field: Field
    seed: int
    plan: Plan
    wall_seconds: float
    reference: bool = True
    """Whether the plan is compared with the field's shortest path."""
    deadline: float | None = None
    """Time for planning [s]; None: no limit."""
    changes: FieldChanges = UNCHANGED
    """How the field was changed before it was planned."""

    @property
    def message(self) -> str:
        """How planning ended, and if it failed what is known about the cause."""
        plan = self.plan
        sentence = plan.status.sentence
        if plan.status is Status.OUT_OF_TIME:
            sentence += f", after {self.deadline:g} s"
        details = [plan.reason]
        if not plan.success and len(plan.control) == 0:
            details.append(start_hint(self.field))
        return "; ".join([sentence, *filter(None, details)])

    @property
    def flight(self) -> Flight:
        """The planned flight."""
        plan = self.plan
        return Flight(
            policy=self.name,
            field=self.field,
            seed=self.seed,
            outcome=plan.status.outcome,
            control=plan.control,
            refused=None,
            clearance=_clearance(plan, self.field),
            seconds=self.wall_seconds,
            decision_seconds=plan.step_seconds,
            decisions=list(plan.decisions),
            route=plan.route,
            reference=self.reference,
        )

    def to_json(self) -> str:
        """One JSON object; after a failure its segments are those before the failure.

        Numbers that are infinite or not known are null, and all that describe a path if it has no
        segments.
        """
        flight, plan = self.flight, self.plan
        some = len(flight.control) > 0
        return json.dumps(
            {
                "field": self.field.name,
                "planner": self.name,
                "seed": self.seed,
                "status": plan.status.label,
                "success": plan.success,
                "length": flight.length if some else None,
                "exact_length": flight.exact_length,
                "gap": flight.gap,
                "clearance": finite(flight.clearance) if some else None,
                "segments": len(flight.control) if some else None,
                "min_turn_radius": finite(flight.min_turn_radius) if some else None,
                "step_seconds": plan.step_seconds,
                "wall_seconds": self.wall_seconds,
                "control": flight.control.tolist() if some else None,
                "message": self.message,
                "to_goal": self._to_goal(),
                "evaluations": plan.evaluations,
                "inflate": self.changes.inflate,
                "limits": asdict(self.field.limits),
                "route_length": None if plan.route is None else plan.route.length,
            },
            allow_nan=False,
        )

    def _to_goal(self) -> float:
        """Straight distance from the end of the path to the goal [m]."""
        end = self.plan.states[-1].vehicle.position
        return float(np.linalg.norm(self.field.goal - end))

    def lines(self, windows: bool = True) -> Iterator[Table | str]:
        """Tables and sentences that describe the plan, without planning windows if so asked."""
        flight = self.flight
        if windows and any(decision.report.starts for decision in self.plan.decisions):
            yield terminal_tables.windows(self.plan.decisions)
        if self.plan.route is not None:
            yield format_route(self.plan.route, flight.exact_length)
        changed = f" with {self.changes}" if self.changes else ""
        yield f"{self.name} on {self.field.name}{changed}, seed {self.seed}: {self.message}"
        number = len(flight.control)
        facts = [f"{number} segment{'s' * (number != 1)}"]
        if number:
            facts.append(f"{flight.length:.4f} m")
        if number and not self.plan.success:
            facts.append(f"ends {self._to_goal():.4f} m from the goal")
        if flight.gap is not None:
            facts.append(
                f"{_percent(flight.gap)} above the shortest path, {flight.exact_length:.4f} m"
            )
        if number:
            radius = flight.min_turn_radius
            # within the tolerance the path touches an obstacle
            clear = flight.clearance if abs(flight.clearance) > self.field.limits.tolerance else 0.0
            facts.append(f"clearance {clear:.3f} m" if math.isfinite(clear) else "no obstacles")
            facts.append(f"smallest turn radius {radius:.3g} m")
        if self.plan.evaluations:
            facts.append(f"{self.plan.evaluations} function evaluations")
        facts.append(f"{self.wall_seconds:.2f} s")
        yield ", ".join(facts)

    def draw(self, path: Path) -> None:
        """Draw the plan into a file."""
        draw_flights([self.flight], path)

    def write_path(self, file: Path, spacing: float) -> int:
        """Write points of the path into a file; returns their number, 0 if there is no path.

        After a deadline, the path is the part that was planned.

        Raises:
            ValueError: the spacing [m] is too small for the path.
            OSError: the file cannot be written.
        """
        partial = self.plan.status is Status.OUT_OF_TIME
        if not (self.plan.success or partial) or len(self.plan.control) == 0:
            return 0
        path = Curve(self.plan.control)
        samples = path.sample(spacing=spacing)
        write_path(path, samples, file)
        return len(samples)


def _clearance(plan: Plan, field: Field) -> float:
    """Minimum clearance along a plan [m] as its planner certified it; infinite without segments."""
    certificates = plan.certificates
    if certificates is None:  # the planner keeps no certificates
        certificates = [inspect(segment, field) for segment in plan.control]
    return min((float(found.clearance) for found in certificates), default=math.inf)


def format_route(route: Route, exact: float | None) -> str:
    """Length and search time of a route before the fit; exact is the shortest length [m]."""
    seconds, _ = route.progress[-1]
    facts = [f"route: {route.length:.4f} m", f"found after {seconds:.3f} s"]
    if exact is not None:
        facts.insert(1, f"{_percent(gap(route.length, exact))} above the shortest path")
    return ", ".join(facts)


def _percent(gap: float) -> str:
    """A gap in per cent, without a negative zero from rounding."""
    return f"{round(100.0 * gap, 2) + 0.0:.2f} %"


def plan(
    planner: Planner,
    name: str,
    field: Field,
    seed: int,
    *,
    reference: bool = True,
    deadline: float | None = None,
    changes: FieldChanges = UNCHANGED,
) -> Report:
    """Plan a field from its start, unless no flight can reach its goal.

    Args:
        planner: as `name` says.
        name: its canonical name.
        field: where to plan.
        seed: of the planner's random numbers.
        reference: whether to compare the plan with the shortest path.
        deadline: as in `planners.deadline.plan_within`; None: no limit.
        changes: how the field was changed before, for the report.
    """
    state = initial_state(field)
    unreachable = unreachable_plan(field, exact=reference)
    began = time.perf_counter()
    if unreachable is not None:
        result = unreachable
    elif deadline is None:
        result = planner.plan(field, state, seed)
    else:
        result = plan_within(planner, field, state, seed, deadline)
    seconds = time.perf_counter() - began
    return Report(
        name=name,
        field=field,
        seed=seed,
        plan=result,
        wall_seconds=seconds,
        reference=reference,
        deadline=deadline,
        changes=changes,
    )
