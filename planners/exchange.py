"""Solving until certified: rows join where the whole curve breaks a constraint.

Sampled constraints let a curve cut into a disc between samples, leave the bounds or turn a
corner. What certification finds joins the problem as a further row, and it is solved on
from where it stopped: the exchange method of semi-infinite programming.

Reference:
    Hettich & Kortanek (1993), Semi-infinite programming: theory, methods, and
    applications, SIAM Review 35(3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ferguson_gym.arc_length import length
from ferguson_gym.arrays import Array
from ferguson_gym.clearance import least_speed
from ferguson_gym.feasibility import is_feasible
from ferguson_gym.fields import Field
from ferguson_gym.limits import Limits
from ferguson_gym.splines import basis, extent
from planners.constraints import ClearanceAt, Constraint, InsideAt, LengthBounds, SpeedAt
from planners.problem import Problem
from planners.quadrature import lengths
from planners.solvers import Solution, Solver

AIM = 1e-6
"""Tolerance [m] that planners aim for; the rest of the limits' tolerance covers float32 actions."""
ROUNDS = 12
"""Most solves of one window."""
HOPELESS = 1e-3
"""A solver that leaves its own rows broken by more [m] is not helped by further rows."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Certified:
    """The end of a solve with exchange."""

    solution: Solution
    """Where the solver stopped last."""
    control: Array
    """Segments (n, 4, D) there."""
    feasible: bool
    """Whether every segment is certified feasible to `AIM`."""
    evaluations: int
    """Evaluations of the objective in all rounds."""
    rounds: int
    """Solves, 1 if no row had to join."""


def solve_certified(
    solver: Solver, problem: Problem, guess: Array, field: Field, limits: Limits
) -> Certified:
    """Solve a window from a guess (unknowns,) until certification has nothing to add."""
    evaluations, rounds = 0, 0
    while True:
        solution = solver.solve(problem, guess)
        evaluations, rounds = evaluations + solution.evaluations, rounds + 1
        control = problem.chain.control(solution.x)
        feasible = bool(is_feasible(control, field, limits, AIM).all())
        if feasible or rounds == ROUNDS or problem.c(solution.x).min() < -HOPELESS:
            break
        problem, guess = problem.joined_by(broken_rows(control, field, limits)), solution.x
    return Certified(
        solution=solution,
        control=control,
        feasible=feasible,
        evaluations=evaluations,
        rounds=rounds,
    )


def broken_rows(control: Array, field: Field, limits: Limits) -> list[Constraint]:
    """The rows that certification finds broken along segments (n, 4, D)."""
    rows: list[Constraint] = []
    certified = length(control)
    if ((certified < limits.shortest - AIM) | (certified > limits.longest + AIM)).any():
        rows.append(LengthBounds(limits, certified - lengths(control)))
    speed, t = least_speed(control)
    if len(slow := np.flatnonzero(speed < limits.slowest - AIM)):
        rows.append(SpeedAt(limits.slowest, slow, basis(t[slow], 1)))
    low, high = extent(control)
    outside = ((low < field.bounds[0] - AIM) | (high > field.bounds[1] + AIM)).any(axis=-1)
    if len(outer := np.flatnonzero(outside)):
        # densely, since a coordinate's extreme moves and there may be four of them
        t = np.linspace(0.0, 1.0, 33)
        rows.append(
            InsideAt(field.bounds, np.repeat(outer, len(t)), np.tile(basis(t), (len(outer), 1)))
        )
    clear, t = field.obstacles.closest(control)
    segment, obstacle = np.nonzero(clear < -AIM)
    if len(segment):
        weights = basis(t[segment, obstacle])
        rows.append(ClearanceAt(field.obstacles, segment, obstacle, weights))
    return rows
