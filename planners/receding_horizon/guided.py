"""Guided receding horizon: the paper's windows with the exact cost-to-go as terminal cost.

As in the paper, three segments are optimised and the first is flown. The objective is the window's
length plus that of the shortest path from its end, plus a small multiple of the integral of |X''|^2
over t (`settings`). Initial guesses follow the shortest paths of the best homotopy classes. The
planner is deterministic.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.shortest_paths.homotopy_classes import classes
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world import PAPER_LIMITS, Field, Limits, Step, is_feasible, transition
from ferguson_gym.world.turn_radius import check_turn_radius, keeps_turn_radius
from planners.interface import Decision, State, WindowReport
from planners.optimization import MultiStart, along_route, offset_guesses
from planners.optimization.certification import Certified, WindowSolver
from planners.optimization.chain import Chain
from planners.optimization.objectives import LengthObjective
from planners.optimization.sqp.turn_contacts import RADIUS_FACTOR
from planners.optimization.window import SIDE_OFFSET, SMOOTH, Window, WindowSettings, final_window
from planners.receding_horizon.distance_objective import ToGoObjective
from planners.receding_horizon.turn_in import turn_in_routes
from planners.rollout import StepByStep, ends_on_goal, remaining_plan
from planners.whole_path.exact import SPACING


class Start(NamedTuple):
    """A window and an initial guess."""

    name: str
    window: Window
    guess: Array
    """Segments (n, 4, 2)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Guided(StepByStep):
    """The paper's receding horizon, guided by the exact cost-to-go.

    Raises:
        ValueError: a minimum turn radius that is not finite or not above the tolerance.
    """

    classes: int = 2
    """Number of homotopy classes, best first, that initial guesses follow until one succeeds."""
    detours: int = 6
    """Number of further classes, tried if a turn radius makes the first ones fail."""
    strides: tuple[float, ...] = (11.0, 7.0, 4.5)
    """Segment lengths of initial guesses [m], tried until one leads to a chain."""
    solver: WindowSolver = field(default_factory=lambda: MultiStart(sidesteps=()))
    settings: WindowSettings = SMOOTH
    limits: Limits = PAPER_LIMITS
    min_turn_radius: float | None = None
    """Minimum radius of curvature along the whole flight [m], certified; None allows any turn."""

    def __post_init__(self) -> None:
        if self.min_turn_radius is not None:
            check_turn_radius(self.min_turn_radius, self.limits.tolerance)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and tentative further ones; the seed has no effect.

        Raises:
            TypeError: obstacles other than discs in the plane.
        """
        began = time.perf_counter()
        if ends_on_goal(field, state) and (left := self._remaining(field, state)) is not None:
            return Decision(left[0], _report(state, began, []), first_step=left[1])
        tried: list[tuple[str, Array]] = []
        ends: list[Certified] = []
        for start in self.starts(field, state):
            tried.append((start.name, start.guess))
            ends += self.solver.solve(start.window, [start.guess])
            if not ends[-1].feasible:
                continue
            chain = ends[-1].control
            step = self._fly(field, state.vehicle, chain[0])
            if step is not None and self._can_be_continued(field, chain):
                report = _report(state, began, ends, start)
                return Decision(chain, report, tried, first_step=step)
        # no window has a solution, but the rest of the last plan may still be feasible
        rest, first = self._remaining(field, state) or (None, None)
        return Decision(rest, _report(state, began, ends), tried, first_step=first)

    def starts(self, field: Field, state: State) -> Iterator[Start]:
        """Windows along shortest paths, best class first; guesses on the path and to both sides."""
        vehicle, ways = state.vehicle, []
        for rank, path in self._class_paths(field, state):
            points = path.points(SPACING)
            ways.append((rank, points))
            for window, guess in self._along(field, vehicle, points, path.length):
                yield Start(f"class {rank}", window, guess)
                for side in offset_guesses(guess, SIDE_OFFSET):
                    yield Start(f"beside class {rank}", window, side)
        for rank, points in ways:
            for route in self._turn_in_routes(vehicle, points):
                length = float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum())
                for window, guess in self._along(field, vehicle, route, length):
                    yield Start(f"turned to class {rank}", window, guess)

    def _along(
        self, field: Field, vehicle: transition.State, points: Array, length: float
    ) -> Iterator[tuple[Window, Array]]:
        """Windows and guesses along a route to the goal (m, 2) of a given length [m]."""
        for stride in self.strides:
            reach = self.settings.segments * stride
            final = length <= reach
            segments = math.ceil(length / stride) if final else self.settings.segments
            make = self._final_window if final else self.window
            window = make(field, vehicle, segments)
            yield window, along_route(vehicle, points, segments, min(length, reach))

    def _turn_in_routes(self, vehicle: transition.State, points: Array) -> list[Array]:
        """Routes that turn into a route (m, 2) on a circle, if there is a minimum turn radius."""
        if self.min_turn_radius is None:
            return []
        return turn_in_routes(vehicle, points, RADIUS_FACTOR * self.min_turn_radius)

    def _class_paths(self, field: Field, state: State) -> Iterator[tuple[int, ShortestPath]]:
        """The shortest paths of the best homotopy classes, numbered from 1."""
        togo, position = distance_to_go(field), state.vehicle.position
        best = classes(togo, position, self.classes)
        yield from enumerate(best, start=1)
        # computed only when needed: most flights use the first classes
        if self.min_turn_radius is not None:
            every = classes(togo, position, self.classes + self.detours)
            yield from enumerate(every[len(best) :], start=len(best) + 1)

    def window(self, field: Field, vehicle: transition.State, segments: int) -> Window:
        """A window of some segments among the obstacles that they can reach."""
        return Window(
            chain=Chain.from_state(vehicle.position, vehicle.derivative, segments),
            objective=ToGoObjective(distance_to_go(field)),
            field=field,
            obstacles=field.obstacles.near(vehicle.position, segments * self.limits.longest),
            limits=self.limits,
            samples=self.settings.samples,
            bending_weight=self.settings.bending_weight,
            turn_radius=self.min_turn_radius or 0.0,
        )

    def _final_window(self, field: Field, vehicle: transition.State, segments: int) -> Window:
        window = final_window(field, vehicle, self.limits, self.settings, segments)
        return replace(window, turn_radius=self.min_turn_radius or 0.0)

    def _remaining(self, field: Field, state: State) -> tuple[Array, Step] | None:
        """The rest of the last plan and its first segment as flown, if they are feasible."""
        rest = remaining_plan(field, state, self.limits)
        return rest if rest is not None and self._keeps_turn_radius(rest[1].control) else None

    def _fly(self, field: Field, vehicle: transition.State, segment: Array) -> Step | None:
        """A segment (4, 2) as flown, certified since rounding changes it; None if it fails."""
        step = transition.fly_segment(field, vehicle, segment, self.limits)
        return step if step.flown and self._keeps_turn_radius(step.control) else None

    def _keeps_turn_radius(self, segment: Array) -> bool:
        """Whether a segment (4, 2) keeps the turn radius."""
        radius = self.min_turn_radius
        return radius is None or bool(keeps_turn_radius(segment, radius, self.limits.tolerance))

    def _can_be_continued(self, field: Field, chain: Array) -> bool:
        """Whether a chain (n, 4, 2) ends on the goal, or a feasible segment continues it."""
        if np.array_equal(chain[-1, 1], field.goal):
            return True
        end = transition.State(chain[-1, 1], chain[-1, 3])
        path = distance_to_go(field).path(end.position)
        if path is None:
            return False
        points = path.points(SPACING)
        for stride in self.strides:
            ahead = along_route(end, points, 1, min(path.length, stride))
            if is_feasible(ahead, field, self.limits).all() and self._keeps_turn_radius(ahead[0]):
                return True
        turns = [
            along_route(end, route, 1, self.strides[0])
            for route in self._turn_in_routes(end, points)
        ]
        ends = self.solver.solve(self.window(field, end, 1), [ahead, *turns])
        return any(further.feasible for further in ends)


def _report(
    state: State, began: float, ends: list[Certified], chosen: Start | None = None
) -> WindowReport:
    """The report on some searches; the last of them belongs to the chosen start, if any."""
    report = WindowReport(
        step=state.vehicle.segments,
        start="" if ends else "planned",
        starts=len(ends),
        feasible=sum(end.feasible for end in ends),
        evaluations=sum(end.evaluations for end in ends),
        seconds=time.perf_counter() - began,
    )
    if chosen is None:
        return report
    return replace(
        report,
        start=chosen.name,
        objective=ends[-1].solution.objective,
        final=isinstance(chosen.window.objective, LengthObjective),
        rounds=ends[-1].rounds,
        solver_status=ends[-1].solution.status,
    )
