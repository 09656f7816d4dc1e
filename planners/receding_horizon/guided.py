"""Guided receding horizon: the paper's windows with the exact cost-to-go as terminal cost.

The cost-to-go of the vehicle, with the turn into the shortest path, is nearly a lower bound on the
objective of windows. A window of convex programs (`planners.receding_horizon.convex`) that comes
close to it is flown at once. Otherwise a search follows: as in the paper, three segments are
optimised and the first is flown. The objective is the window's length plus that of the shortest
path from its end, plus a small multiple of the integral of |X''|^2 over t (`settings`). Initial
guesses follow the shortest paths of the best homotopy classes, with evenly spaced knots. Where a
window exceeds the bound by much, or none is feasible, further guesses follow the path's turns. The
best window is flown. The planner is deterministic.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import ClassVar, NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.shortest_paths.homotopy_classes import classes
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world import Field, Step, is_feasible, transition
from ferguson_gym.world.turn_radius import check_turn_radius, keeps_turn_radius
from planners.interface import Decision, Knowledge, State, WindowReport
from planners.optimization import MultiStart, along_route, offset_guesses
from planners.optimization.certification import Certified, WindowSolver
from planners.optimization.chain import Chain
from planners.optimization.convex import Effort
from planners.optimization.distance_objective import ToGoObjective
from planners.optimization.initial_guesses import shifted
from planners.optimization.objectives import LengthObjective
from planners.optimization.quadrature import lengths
from planners.optimization.route_knots import turn_aligned
from planners.optimization.sqp.turn_contacts import RADIUS_FACTOR
from planners.optimization.window import SIDE_OFFSET, SMOOTH, Window, WindowSettings, final_window
from planners.receding_horizon.convex import Choice, Convex
from planners.receding_horizon.turn_bound import TurnBound
from planners.receding_horizon.turn_in import turn_in_routes
from planners.rescaling import decided_in_image
from planners.rollout import StepByStep, ends_on_goal, remaining_plan
from planners.whole_path.exact import SPACING
from planners.whole_path.route_fit import CLOSE

_TURNS, _TURNS_BY = 2, 0.02
"""Number of turns of a slalom within a window, and the least angle [rad] of one that counts."""
_AHEAD = 3.0
"""Length of the part of a path to whose turns guesses are aligned, in longest segments."""
_TIGHT = 0.85
"""Mean length needed of the segments left, relative to the longest, above which all are planned
together."""


class Start(NamedTuple):
    """A window and an initial guess."""

    name: str
    window: Window
    guess: Array
    """Segments (n, 4, 2)."""


class _Choice(NamedTuple):
    """A start and the feasible chain found from it."""

    start: Start
    end: Certified
    step: Step
    """Its first segment as flown."""

    @property
    def objective(self) -> float:
        """Of the window: the chain's length and the cost-to-go of its end [m]."""
        return self.end.solution.objective

    def excess(self, bound: TurnBound) -> float:
        """Objective beyond the bound, relative to the length of the chain."""
        return (self.objective - bound.togo - bound.turn) / float(lengths(self.end.control).sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class Guided(StepByStep):
    """The paper's receding horizon, guided by the exact cost-to-go.

    `strides` are those of fields of the paper's scale, see `planners.rescaling`.

    Raises:
        ValueError: a minimum turn radius that is not finite or not above the tolerance.
    """

    METRES: ClassVar[tuple[str, ...]] = ("min_turn_radius",)
    knows: ClassVar[Knowledge] = Knowledge.WHOLE_FIELD

    classes: int = 2
    """Number of homotopy classes, best first, that initial guesses follow until one succeeds."""
    detours: int = 6
    """Number of further classes, tried if a turn radius makes the first ones fail."""
    strides: tuple[float, ...] = (11.0, 7.0, 4.5)
    """Segment lengths of initial guesses [m], tried until one leads to a chain."""
    solver: WindowSolver = field(default_factory=lambda: MultiStart(sidesteps=()))
    settings: WindowSettings = SMOOTH
    convex: Convex | None = field(default_factory=Convex)
    """Its windows are flown where they are good enough or the search finds no better ones; None
    always searches."""
    good: float = 3e-4
    """Excess of a convex window over the bound, relative to its length, that needs no search."""
    min_turn_radius: float | None = None
    """Minimum radius of curvature along the whole flight [m], certified; None allows any turn."""

    def __post_init__(self) -> None:
        if self.min_turn_radius is not None:
            check_turn_radius(self.min_turn_radius)

    @decided_in_image
    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and tentative further ones; the seed has no effect.

        Raises:
            TypeError: a field that is not planar.
        """
        began = time.perf_counter()
        if ends_on_goal(field, state) and (left := self._remaining(field, state)) is not None:
            return Decision(left[0], _report(state, began, []), first_step=left[1])
        bound, found, effort = TurnBound.of(field, state), None, Effort()
        # convex programs know neither a turn radius nor an upper limit of lengths
        plain = self.min_turn_radius is None and not is_tight(field, state.vehicle, bound.togo)
        if self.convex is not None and plain:
            found, effort = self.convex.window(field, state)
            if found is not None and found.excess <= bound.turn + self.good * found.length:
                return Choice.of(found, effort).decision(state, began)
        tried: list[tuple[str, Array]] = []
        ends: list[Certified] = []
        best: _Choice | None = None
        for start in self.starts(field, state):
            best = self._attempt(field, state, start, tried, ends)
            if best is not None:
                break
        if best is None or (best.excess(bound) > CLOSE and self._is_slalom(field, state)):
            # entries beside the route take long, and matter where nothing else leads on
            tries = None if best is None else 1
            for start in self._aligned_starts(field, state, tries):
                other = self._attempt(field, state, start, tried, ends)
                if other is None or (best is not None and other.objective >= best.objective):
                    continue
                best = other
                if best.excess(bound) <= 2.0 * CLOSE:
                    break
        if found is not None and (best is None or found.objective <= best.objective):
            return Choice.of(found, effort).decision(state, began)
        if best is not None:
            report = _report(state, began, ends, best)
            return Decision(best.end.control, report, tried, first_step=best.step)
        # no window has a solution, but the rest of the last plan may still be feasible
        rest, first = self._remaining(field, state) or (None, None)
        return Decision(rest, _report(state, began, ends), tried, first_step=first)

    def _is_slalom(self, field: Field, state: State) -> bool:
        """Whether the shortest path turns so often that even segments may not follow it."""
        path = distance_to_go(field).path(state.vehicle.position)
        if path is None:
            return False
        chords = np.linalg.norm(np.diff(path.lines, axis=1)[:, 0], axis=1)
        way = np.cumsum(chords[:-1] + path.radii * path.sweeps)
        within = self.settings.segments * self.strides[0]
        return int(np.count_nonzero(path.sweeps[way <= within] > _TURNS_BY)) >= _TURNS

    def _attempt(
        self,
        field: Field,
        state: State,
        start: Start,
        tried: list[tuple[str, Array]],
        ends: list[Certified],
    ) -> _Choice | None:
        """Solve a window; None without a feasible chain that can be continued."""
        tried.append((start.name, start.guess))
        (end,) = self.solver.solve(start.window, [start.guess])
        ends.append(end)
        if not end.feasible:
            return None
        step = self._fly(field, state.vehicle, end.control[0])
        if step is None or not self._can_be_continued(field, end.control):
            return None
        return _Choice(start, end, step)

    def _aligned_starts(self, field: Field, state: State, tries: int | None) -> Iterator[Start]:
        """Windows whose guesses follow turns: the last plan extended, then the best classes.

        Each has a number of `tries`, or all that there are.

        There are none with a minimum turn radius, which paths with such turns would violate.
        """
        if self.min_turn_radius is not None:
            return
        vehicle, tail = state.vehicle, state.tail[: self.settings.segments - 1]
        if len(tail):
            rest = shifted(vehicle, tail, len(tail))
            flown = vehicle.segments + len(tail)
            end = transition.State(rest[-1, 1], rest[-1, 3], flown)
            path = distance_to_go(field).path(end.position)
            if path is not None and path.length >= field.limits.shortest:
                yield from islice(
                    self._followed("extended plan", field, vehicle, rest, end, path), tries
                )
        for rank, path in self._class_paths(field, state):
            begun = np.empty((0, 4, 2))
            name = f"turns of class {rank}"
            found = self._followed(name, field, vehicle, begun, vehicle, path)
            yield from islice(found, tries)

    def _followed(
        self,
        name: str,
        field: Field,
        vehicle: transition.State,
        begun: Array,
        end: transition.State,
        path: ShortestPath,
    ) -> Iterator[Start]:
        """Windows of some segments (n, 4, 2) and those that follow a path from their end."""
        # one segment more than usual: the objective ignores the direction at the end of the last
        most = self.settings.segments + 1
        points, share = _first_part(path.points(SPACING), _AHEAD * field.limits.longest)
        left = math.ceil(share * (field.limits.segments - end.segments))
        for chain in turn_aligned(end, points, field.obstacles, field.limits, left):
            whole = np.concatenate([begun, chain])
            final = share == 1.0 and len(whole) <= most
            make = self._final_window if final else self.window
            guess = whole[:most]
            yield Start(name, make(field, vehicle, len(guess)), guess)

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
        left = max(1, field.limits.segments - vehicle.segments)
        if is_tight(field, vehicle, length) and left > self.settings.segments:
            # a window would not know that later segments must be long
            yield (
                self._final_window(field, vehicle, left),
                along_route(vehicle, points, left, length),
            )
        least = length / left
        for stride in dict.fromkeys(max(stride, least) for stride in self.strides):
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
            obstacles=field.obstacles.near(vehicle.position, segments * field.limits.longest),
            samples=self.settings.samples,
            bending_weight=self.settings.bending_weight,
            turn_radius=self.min_turn_radius or 0.0,
        )

    def _final_window(self, field: Field, vehicle: transition.State, segments: int) -> Window:
        window = final_window(field, vehicle, self.settings, segments)
        return replace(window, turn_radius=self.min_turn_radius or 0.0)

    def _remaining(self, field: Field, state: State) -> tuple[Array, Step] | None:
        """The rest of the last plan and its first segment as flown, if they are feasible."""
        rest = remaining_plan(field, state)
        return (
            rest if rest is not None and self._keeps_turn_radius(field, rest[1].control) else None
        )

    def _fly(self, field: Field, vehicle: transition.State, segment: Array) -> Step | None:
        """A segment (4, 2) as flown, certified since rounding changes it; None if it fails."""
        step = transition.fly_segment(field, vehicle, segment)
        return step if step.flown and self._keeps_turn_radius(field, step.control) else None

    def _keeps_turn_radius(self, field: Field, segment: Array) -> bool:
        """Whether a segment (4, 2) keeps the turn radius."""
        radius = self.min_turn_radius
        return radius is None or bool(keeps_turn_radius(segment, radius, field.limits.tolerance))

    def _can_be_continued(self, field: Field, chain: Array) -> bool:
        """Whether a chain (n, 4, 2) ends on the goal, or a feasible segment continues it."""
        if len(chain) > self.settings.segments or np.array_equal(chain[-1, 1], field.goal):
            return True
        end = transition.State(chain[-1, 1], chain[-1, 3])
        path = distance_to_go(field).path(end.position)
        if path is None:
            return False
        points = path.points(SPACING)
        for stride in self.strides:
            ahead = along_route(end, points, 1, min(path.length, stride))
            if is_feasible(ahead, field).all() and self._keeps_turn_radius(field, ahead[0]):
                return True
        turns = [
            along_route(end, route, 1, self.strides[0])
            for route in self._turn_in_routes(end, points)
        ]
        ends = self.solver.solve(self.window(field, end, 1), [ahead, *turns])
        return any(further.feasible for further in ends)


def _first_part(points: Array, length: float) -> tuple[Array, float]:
    """The first part of a route (m, 2), at least `length` [m] if it is so long, and its share."""
    way = np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))
    last = min(int(np.searchsorted(way, length)), len(way) - 1)
    return points[: last + 2], float(way[last] / way[-1])


def is_tight(field: Field, vehicle: transition.State, length: float) -> bool:
    """Whether nearly all segments that are left must be long to fly a route of a length [m]."""
    left = field.limits.segments - vehicle.segments
    return length > _TIGHT * field.limits.longest * left


def _report(
    state: State, began: float, ends: list[Certified], chosen: _Choice | None = None
) -> WindowReport:
    """The report on some searches; and on the choice among them, if any."""
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
        start=chosen.start.name,
        objective=chosen.end.solution.objective,
        final=isinstance(chosen.start.window.objective, LengthObjective),
        rounds=chosen.end.rounds,
        solver_status=chosen.end.solution.status,
    )
