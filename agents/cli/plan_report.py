"""What `ferguson plan` prints: a plan as text and as JSON."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from agents.flights import Flight
from agents.flights.metrics import finite
from agents.flights.path_file import write_path
from agents.plots.flight_grid import draw_flights
from agents.runtime import terminal_tables
from ferguson_gym.shortest_paths import gap
from ferguson_gym.world import Field, inspect
from planners.interface import Plan, Planner, Route, initial_state


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
        """One JSON object, with nulls if no path was found and instead of infinite numbers."""
        flight, found = self.flight, self.plan.success
        return json.dumps(
            {
                "field": self.field.name,
                "planner": self.name,
                "seed": self.seed,
                "status": self.plan.status.label,
                "success": found,
                "length": flight.length if found else None,
                "exact_length": flight.exact_length,
                "gap": flight.gap,
                "clearance": finite(flight.clearance) if found else None,
                "segments": len(flight.control) if found else None,
                "min_turn_radius": finite(flight.min_turn_radius) if found else None,
                "step_seconds": self.plan.step_seconds,
                "wall_seconds": self.wall_seconds,
                "control": flight.control.tolist() if found else None,
            },
            allow_nan=False,
        )

    def lines(self, windows: bool = True) -> Iterator[Table | str]:
        """Tables and sentences that describe the plan, without planning windows if so asked."""
        flight = self.flight
        if windows and any(decision.report.starts for decision in self.plan.decisions):
            yield terminal_tables.windows(self.plan.decisions)
        if self.plan.route is not None:
            yield format_route(self.plan.route, flight.exact_length)
        yield f"{self.name} on {self.field.name}, seed {self.seed}: {self.plan.status.sentence}"
        facts = [f"{len(flight.control)} segments", f"{flight.length:.4f} m"]
        if flight.gap is not None:
            facts.append(
                f"{_percent(flight.gap)} above the shortest path, {flight.exact_length:.4f} m"
            )
        if len(flight.control):
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

        Raises:
            ValueError: the spacing [m] is too small for the path.
            OSError: the file cannot be written.
        """
        path = self.plan.path
        if path is None:
            return 0
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


def plan(planner: Planner, name: str, field: Field, seed: int, *, reference: bool = True) -> Report:
    """Plan a field from its start; compare the plan with the shortest path if so asked."""
    began = time.perf_counter()
    result = planner.plan(field, initial_state(field), seed)
    seconds = time.perf_counter() - began
    return Report(
        name=name,
        field=field,
        seed=seed,
        plan=result,
        wall_seconds=seconds,
        reference=reference,
    )
