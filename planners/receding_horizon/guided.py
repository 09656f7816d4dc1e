"""The receding horizon that knows the way: length flown plus the exact distance from there.

Three segments are optimised and one is flown, as in the paper; but the window's end is judged by
the length of the shortest path from there, and its starts lie on the shortest paths of the best
homotopy classes. There are no random numbers.
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
from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS, Limits
from ferguson_gym.world.turn_radius import check_turn_radius, keeps_turn_radius
from planners.interface import Decision, Plan, State, WindowReport
from planners.optimization.certification import Certified, WindowSolver
from planners.optimization.chain import Chain
from planners.optimization.initial_guesses import along
from planners.optimization.objectives import LengthObjective
from planners.optimization.sqp.multi_start import MultiStart, offset_guesses
from planners.optimization.sqp.turn_contacts import WIDER
from planners.optimization.window import ASIDE, STIFFNESS, Window, WindowSettings, final_window
from planners.receding_horizon.distance_objective import ToGoObjective
from planners.receding_horizon.turn_in import turned
from planners.rollout import arriving, rest, roll_out
from planners.whole_path.exact import SPACING


class Start(NamedTuple):
    """A window and where a search of it begins."""

    name: str
    window: Window
    guess: Array
    """Segments (n, 4, 2)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Guided:
    """The paper's receding horizon, guided by the exact distance to the goal.

    Raises:
        ValueError: a least turn radius that is not finite or not above the tolerance.
    """

    classes: int = 2
    """Homotopy classes that windows start from: the next is tried where one leads to nothing."""
    detours: int = 6
    """Further classes, where a turn radius lets these lead to nothing."""
    strides: tuple[float, ...] = (11.0, 7.0, 4.5)
    """Lengths of segments at first [m], likewise."""
    solver: WindowSolver = field(default_factory=lambda: MultiStart(sidesteps=()))
    settings: WindowSettings = field(default_factory=lambda: WindowSettings(stiffness=STIFFNESS))
    limits: Limits = PAPER_LIMITS
    min_turn_radius: float | None = None
    """Least radius of curvature along the whole flight [m], certified; None turns at will."""

    def __post_init__(self) -> None:
        if self.min_turn_radius is not None:
            check_turn_radius(self.min_turn_radius, self.limits.tolerance)

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal; the seed changes nothing.

        Raises:
            TypeError: obstacles other than discs in the plane.
        """
        return roll_out(self, field, state, seed)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Decide the next segment, and what is meant to follow it.

        Raises:
            TypeError: obstacles other than discs in the plane.
        """
        began = time.perf_counter()
        if arriving(field, state) and (left := self._rest(field, state)) is not None:
            return Decision(left, _report(state, began, []))
        tried: list[tuple[str, Array]] = []
        ends: list[Certified] = []
        for start in self.starts(field, state):
            tried.append((start.name, start.guess))
            ends += self.solver.solve(start.window, [start.guess])
            if ends[-1].feasible and self._holds(field, state.vehicle, ends[-1].control):
                return Decision(ends[-1].control, _report(state, began, ends, start), tried)
        # nothing new was found, but what was planned before still leads somewhere
        return Decision(self._rest(field, state), _report(state, began, ends), tried)

    def starts(self, field: Field, state: State) -> Iterator[Start]:
        """Windows along shortest paths, the best class first, and guesses on and beside them."""
        vehicle, ways = state.vehicle, []
        for rank, path in self._ways(field, state):
            points = path.points(SPACING)
            ways.append((rank, points))
            for window, guess in self._along(field, vehicle, points, path.length):
                yield Start(f"class {rank}", window, guess)
                for side in offset_guesses(guess, ASIDE):
                    yield Start(f"beside class {rank}", window, side)
        for rank, points in ways:
            for route in self._turned(vehicle, points):
                length = float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum())
                for window, guess in self._along(field, vehicle, route, length):
                    yield Start(f"turned to class {rank}", window, guess)

    def _along(
        self, field: Field, vehicle: transition.State, points: Array, length: float
    ) -> Iterator[tuple[Window, Array]]:
        """Windows and guesses on a route to the goal (m, 2) of some length [m]."""
        for stride in self.strides:
            reach = self.settings.segments * stride
            final = length <= reach
            segments = math.ceil(length / stride) if final else self.settings.segments
            window = (
                self._final_window(field, vehicle, segments)
                if final
                else self.window(field, vehicle, segments)
            )
            yield window, along(vehicle, points, segments, min(length, reach))

    def _turned(self, vehicle: transition.State, points: Array) -> list[Array]:
        """A route after turns into it, where they have a radius."""
        if self.min_turn_radius is None:
            return []
        return turned(vehicle, points, WIDER * self.min_turn_radius)

    def _ways(self, field: Field, state: State) -> Iterator[tuple[int, ShortestPath]]:
        """The shortest paths of the best classes, numbered from 1."""
        togo, position = distance_to_go(field), state.vehicle.position
        best = classes(togo, position, self.classes)
        yield from enumerate(best, start=1)
        # not found at once: most flights never need a detour
        if self.min_turn_radius is not None:
            every = classes(togo, position, self.classes + self.detours)
            yield from enumerate(every[len(best) :], start=len(best) + 1)

    def window(self, field: Field, vehicle: transition.State, segments: int) -> Window:
        """So many segments, past the obstacles within their reach."""
        return Window(
            chain=Chain.from_state(vehicle.position, vehicle.derivative, segments),
            objective=ToGoObjective(distance_to_go(field)),
            field=field,
            obstacles=field.obstacles.near(vehicle.position, segments * self.limits.longest),
            limits=self.limits,
            samples=self.settings.samples,
            stiffness=self.settings.stiffness,
            turn_radius=self.min_turn_radius or 0.0,
        )

    def _final_window(self, field: Field, vehicle: transition.State, segments: int) -> Window:
        window = final_window(field, vehicle, self.limits, self.settings, segments)
        return replace(window, turn_radius=self.min_turn_radius or 0.0)

    def _rest(self, field: Field, state: State) -> Array | None:
        """What is left of a plan, if it can be flown."""
        left = rest(field, state, self.limits)
        if left is None or self.min_turn_radius is None:
            return left
        return left if self._flies(field, state.vehicle, left[0]) else None

    def _flies(self, field: Field, vehicle: transition.State, segment: Array) -> bool:
        """Whether a segment can be flown, rounded as actions are."""
        step = transition.fly_segment(field, vehicle, segment, self.limits)
        return step.flown and self._turns(step.control)

    def _turns(self, segment: Array) -> bool:
        """Whether a segment keeps the turn radius."""
        if self.min_turn_radius is None:
            return True
        return bool(keeps_turn_radius(segment, self.min_turn_radius, self.limits.tolerance))

    def _holds(self, field: Field, vehicle: transition.State, chain: Array) -> bool:
        """Whether a chain can be flown and, unless it ends on the goal, be continued."""
        if not self._flies(field, vehicle, chain[0]):
            return False
        if np.array_equal(chain[-1, 1], field.goal):
            return True
        end = transition.State(chain[-1, 1], chain[-1, 3])
        path = distance_to_go(field).path(end.position)
        if path is None:
            return False
        points = path.points(SPACING)
        for stride in self.strides:
            ahead = along(end, points, 1, min(path.length, stride))
            if is_feasible(ahead, field, self.limits).all() and self._turns(ahead[0]):
                return True
        turns = [along(end, route, 1, self.strides[0]) for route in self._turned(end, points)]
        ends = self.solver.solve(self.window(field, end, 1), [ahead, *turns])
        return any(further.feasible for further in ends)


def _report(
    state: State, began: float, ends: list[Certified], kept: Start | None = None
) -> WindowReport:
    """On some searches, the last of them from the start that was kept."""
    report = WindowReport(
        step=state.vehicle.segments,
        start="" if ends else "planned",
        starts=len(ends),
        feasible=sum(end.feasible for end in ends),
        evaluations=sum(end.evaluations for end in ends),
        seconds=time.perf_counter() - began,
    )
    if kept is None:
        return report
    return replace(
        report,
        start=kept.name,
        objective=ends[-1].solution.objective,
        final=isinstance(kept.window.objective, LengthObjective),
        rounds=ends[-1].rounds,
        solver_status=ends[-1].solution.status,
    )
