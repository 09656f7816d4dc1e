"""Chains along a shortest path by convex programs, one around the solution of the one before."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ferguson_gym.guidance.path_tree import PathTree, look_ahead
from ferguson_gym.guidance.way import tree_of
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal, distance_to_go
from ferguson_gym.world import Field, Step, is_feasible, transition
from planners.optimization.certification import target_tolerance
from planners.optimization.convex.last_segment import last_segment
from planners.optimization.convex.program import Surroundings, Terminal, Weights, assemble
from planners.optimization.convex.solver import solve
from planners.optimization.convex.turning_half_planes import even_parts
from planners.optimization.quadrature import lengths

_BESIDE = 0.25
"""Distance along a path over which its direction is taken, to both sides [m]."""
_LEAST_LINE = 0.5
"""Lower limit of the radius of curvature of the distance's level lines [m]."""
_LAST = 1.15
"""Chains up to this multiple of their usual length end on the goal."""
_LONG = 0.9
"""Mean length of the segments left, relative to the longest, that a chain does not exceed."""


class Nominal(NamedTuple):
    """A chain along the shortest path, feasible or not."""

    control: Array
    """(n, 4, 2)."""
    final: bool
    """Whether it ends on the goal."""
    route: float
    """Length of the route to the goal that it follows [m]."""


class Found(NamedTuple):
    """A certified chain."""

    control: Array
    """(n, 4, 2)."""
    step: Step
    """Its first segment as flown."""
    excess: float
    """Its length and the distance to go from its end, beyond the length of the route that it
    follows, in multiples of its length."""


class Effort(NamedTuple):
    """What the programs of a decision took."""

    programs: int = 0
    rows: int = 0
    """Most rows of a program."""
    iterations: int = 0
    """Most iterations of a program."""

    def plus(self, rows: int, iterations: int) -> Effort:
        """With one more program."""
        return Effort(self.programs + 1, max(self.rows, rows), max(self.iterations, iterations))


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainSolver:
    """Solves a fixed number of quadratic programs a chain at most.

    Lengths are for fields of the paper's scale, see `planners.rescaling`.
    """

    rounds: int = 2
    """Programs solved one after the other, each around the solution of the one before."""
    iterations: int = 250
    """Maximum number of iterations of a program's solver."""
    rows: int = 600
    """Maximum number of rows of a program."""
    enough: float = 2e-5
    """Excess of a certified chain above which a further program is solved."""
    weights: Weights = field(default_factory=Weights)

    def solve(
        self,
        where: Field,
        vehicle: transition.State,
        nominal: Nominal,
        parts: int,
        effort: Effort | None = None,
    ) -> tuple[Found | None, Effort]:
        """The best certified chain among the solutions of the programs, None if there is none.

        Args:
            where: field of the paper's scale.
            vehicle: where the chain begins.
            nominal: chain around which the first program is written.
            parts: of each segment, which have half-planes of their own.
            effort: spent before; returned with the effort of these programs.
        """
        control, best = nominal.control, None
        around, effort = _around(where), effort or Effort()
        for _ in range(self.rounds):
            terminal, _ = _terminal(where, control, nominal.final)
            if terminal is None:
                break
            fits, program = assemble(
                control,
                terminal,
                even_parts(parts),
                where.bounds,
                around,
                where.limits.shortest,
                self.weights,
                self.rows,
            )
            if not fits:
                break
            solution = solve(program, control, nominal.final, self.iterations)
            effort = effort.plus(solution.rows, solution.iterations)
            if solution.control is None:
                break
            control = solution.control
            if not is_feasible(control, where, target_tolerance(where)).all():
                continue
            step = transition.fly_segment(where, vehicle, control[0])
            if not step.flown:
                continue
            length = float(lengths(control).sum())
            left = _terminal(where, control, nominal.final)[1]
            found = Found(control, step, (length + left - nominal.route) / length)
            if best is None or found.excess < best.excess:
                best = found
            if found.excess <= self.enough:
                break
        return best, effort


def detour(field: Field, vehicle: transition.State) -> Found | None:
    """A last segment from nearer to the goal than the shortest segment, without a program."""
    control = last_segment(field, vehicle)
    if control is None:
        return None
    step = transition.fly_segment(field, vehicle, control[0])
    return Found(control, step, np.inf) if step.flown else None


def nominal_chain(
    field: Field, vehicle: transition.State, stride: float, most: int
) -> Nominal | None:
    """Even segments along the shortest path; None without a path.

    Args:
        field: of the paper's scale.
        vehicle: where the chain begins.
        stride: length of a segment [m]; longer where few segments are left.
        most: maximum number of segments; a chain that would come near the goal ends on it.
    """
    limits, togo = field.limits, distance_to_go(field)
    left = max(1, limits.segments - vehicle.segments)
    (length,), _ = togo(vehicle.position[None])
    if not np.isfinite(length):
        return None
    stride = min(max(stride, length / left), _LONG * limits.longest)
    number = max(1, round(length / stride))
    final = length <= _LAST * most * stride and number <= max(most, left)
    number = min(number, left) if final else most
    knots = (length / number if final else stride) * np.arange(1, number + 1)
    beside = (knots[:, None] + [-_BESIDE, 0.0, _BESIDE]).ravel()
    places = _ahead(togo, vehicle.position, beside)
    return _through(places, vehicle, knots[0], field, final, float(length))


def nominal_along(
    points: Array, length: float, vehicle: transition.State, field: Field, stride: float
) -> Nominal:
    """Even segments along a route to the goal.

    Args:
        points: (m, 2) of the route from the vehicle to the goal, close to each other [m].
        length: of the route [m].
        vehicle: where the chain begins.
        field: whose goal it is.
        stride: approximate length of a segment [m].
    """
    left = max(1, field.limits.segments - vehicle.segments)
    number = min(max(1, round(length / stride)), left)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    knots = along[-1] / number * np.arange(1, number + 1)
    beside = (knots[:, None] + [-_BESIDE, 0.0, _BESIDE]).ravel()
    places = np.stack([np.interp(beside, along, points[:, d]) for d in range(2)], axis=1)
    return _through(places, vehicle, knots[0], field, True, length)


def _through(
    places: Array,
    vehicle: transition.State,
    speed: float,
    field: Field,
    final: bool,
    length: float,
) -> Nominal:
    """Segments through knots, given with the places just before and after each: (3 n, 2) [m]."""
    before, here, after = places.reshape(-1, 3, 2).swapaxes(0, 1)
    slopes = after - before
    slopes *= speed / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-12)
    control = np.empty((len(here), 4, 2))
    control[0, 0], control[0, 2] = vehicle.position, vehicle.derivative
    control[1:, 0], control[1:, 2] = here[:-1], slopes[:-1]
    control[:, 1], control[:, 3] = here, slopes
    if final:
        control[-1, 1] = field.goal
    return Nominal(control, final, length)


def _terminal(field: Field, control: Array, final: bool) -> tuple[Terminal | None, float]:
    """The distance to go from a chain's end to second order, and itself [m]; None if infinite."""
    if final:
        return Terminal(True, 0.0, 0.0, 0.0), 0.0
    way = distance_to_go(field).departure(*control[-1, 1].tolist())
    if not np.isfinite(way.distance):
        return None, np.inf
    return Terminal(False, way.ux, way.uy, 1.0 / max(way.line, _LEAST_LINE)), way.distance


@lru_cache(maxsize=2)
def _around(field: Field) -> Surroundings:
    """The obstacles of a field for compiled functions."""
    obstacles = field.obstacles
    centers, radii = obstacles.balls
    columns = np.ascontiguousarray(centers.T)
    corners = np.ascontiguousarray(obstacles.points.T)
    return Surroundings(columns, radii, corners, obstacles.starts, obstacles.radii)


def _ahead(togo: DistanceToGoal, position: Array, distances: Array) -> Array:
    """Points (n, 2) [m] at distances (n,) along the shortest path, which exists."""
    tree = _tree(togo)
    if tree is None:
        path = togo.path(position)
        assert path is not None
        return path.at(distances)
    places, length = np.empty((1, len(distances), 2)), np.empty(1)
    look_ahead(tree, position[None], distances[None], places, length)
    ahead: Array = places[0]
    return ahead


@lru_cache(maxsize=2)
def _tree(togo: DistanceToGoal) -> PathTree | None:
    return tree_of(togo)
