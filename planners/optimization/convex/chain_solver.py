"""Chains along a shortest path by convex programs, one around the solution of the one before."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.world import Field, Step, is_feasible, transition
from planners.optimization.certification import target_tolerance
from planners.optimization.convex.last_segment import last_segment
from planners.optimization.convex.nominal import Nominal
from planners.optimization.convex.obstacle_rows import Surroundings
from planners.optimization.convex.program import Terminal
from planners.optimization.convex.rows import Weights
from planners.optimization.convex.solver import Caps, solve
from planners.optimization.quadrature import lengths

_LEAST_LINE = 0.5
"""Lower limit of the radius of curvature of the distance's level lines [m]."""
_ON_GOAL = Terminal(True, 0.0, 0.0, 0.0)


class Found(NamedTuple):
    """A certified chain."""

    control: Array
    """(n, 4, 2)."""
    step: Step
    """Its first segment as flown."""
    final: bool
    """Whether it ends on the goal."""
    length: float
    """Of the chain [m]."""
    objective: float
    """Its length and the distance to go from its end [m]."""
    route: float
    """Length of the shortest path from its begin [m]."""

    @property
    def excess(self) -> float:
        """The objective beyond the length of the shortest path [m]."""
        return self.objective - self.route


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

    rounds: int = 3
    """Programs solved one after the other, each around the solution of the one before."""
    caps: Caps = field(default_factory=Caps)
    enough: float = 2e-5
    """Excess of a certified chain, relative to its length, above which a further program is solved.
    """
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
        control, best, effort = nominal.control, None, effort or Effort()
        around, tolerance = _around(where), target_tolerance(where)
        terminal, _ = _terminal(where, control, nominal.final)
        given = self.weights if nominal.planned else self.weights._replace(halvings=0)
        for _ in range(self.rounds):
            if terminal is None:
                break
            solution = solve(
                control,
                terminal,
                parts,
                where.bounds,
                around,
                where.limits.shortest,
                given,
                self.caps,
            )
            given = self.weights
            if not solution.rows:
                break
            effort = effort.plus(solution.rows, solution.iterations)
            if not solution.found:
                break
            control = solution.control
            terminal, togo = _terminal(where, control, nominal.final)
            if not is_feasible(control, where, tolerance).all():
                continue
            step = transition.fly_segment(where, vehicle, control[0])
            if not step.flown:
                continue
            length = float(lengths(control).sum())
            found = Found(control, step, nominal.final, length, length + togo, nominal.route)
            if best is None or found.excess < best.excess:
                best = found
            if found.excess <= self.enough * length:
                break
        return best, effort


def detour(field: Field, vehicle: transition.State) -> Found | None:
    """A last segment from nearer to the goal than the shortest segment, without a program."""
    control = last_segment(field, vehicle)
    if control is None:
        return None
    step = transition.fly_segment(field, vehicle, control[0])
    if not step.flown:
        return None
    size, route = (
        float(step.inspection.length),
        float(np.linalg.norm(field.goal - vehicle.position)),
    )
    return Found(control, step, True, size, size, route)


def _terminal(field: Field, control: Array, final: bool) -> tuple[Terminal | None, float]:
    """The distance to go from a chain's end to second order, and itself [m]; None if infinite."""
    if final:
        return _ON_GOAL, 0.0
    way = distance_to_go(field).departure(*control[-1, 1].tolist())
    if not math.isfinite(way.distance):
        return None, math.inf
    return Terminal(False, way.ux, way.uy, 1.0 / max(way.line, _LEAST_LINE)), way.distance


@lru_cache(maxsize=2)
def _around(field: Field) -> Surroundings:
    """The obstacles of a field for compiled functions."""
    obstacles = field.obstacles
    centers, radii = obstacles.balls
    columns = np.ascontiguousarray(centers.T)
    corners = np.ascontiguousarray(obstacles.points.T)
    return Surroundings(columns, radii, corners, obstacles.starts, obstacles.radii)
