"""The exchange method: constraints are added where certification finds a curve infeasible.

A curve that satisfies sampled constraints may cut into a disc between the samples, leave the bounds
or have a cusp. Each violation that certification finds is added to the problem as a further
constraint, and the solver is started again from its last solution, as in semi-infinite programming.

Reference:
    Hettich & Kortanek (1993), Semi-infinite programming: theory, methods, and applications, SIAM
    Review 35(3).
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.clearance import least_speed
from ferguson_gym.curves.splines import basis, extent
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field
from planners.optimization.certification import (
    MAX_SOLVES,
    Certified,
    Solution,
    certify,
    target_tolerance,
)
from planners.optimization.nonlinear_program import Program
from planners.optimization.quadrature import lengths
from planners.optimization.reference.slsqp import Slsqp
from planners.optimization.sampled_constraints import (
    ClearanceAt,
    Constraint,
    InsideAt,
    LengthBounds,
    SpeedAt,
)
from planners.optimization.window import Window

MAX_VIOLATION = 1e-3
"""If the solver violates its own constraints by more [m], adding constraints is pointless."""


@dataclass(frozen=True, slots=True)
class ByExchange:
    """Solves windows with an NLP solver, samples first, then with violated constraints added."""

    solver: Solver = field(default_factory=Slsqp)

    def solve(
        self, window: Window, guesses: Sequence[Array], until: float = math.inf
    ) -> list[Certified]:
        """Find certified local minima from guesses; the deadline is checked between solves."""
        ends: list[Certified] = []
        for guess in guesses:
            if ends and time.perf_counter() > until:
                break
            ends.append(self._solve(window, guess, until))
        return ends

    def _solve(self, window: Window, guess: Array, until: float) -> Certified:
        began = time.perf_counter()
        problem, x = window.sampled(), window.chain.unknowns(guess)
        evaluations, rounds = 0, 0
        while True:
            solution = self.solver.solve(problem, x)
            evaluations, rounds = evaluations + solution.evaluations, rounds + 1
            x, control = solution.x, window.chain.control(solution.x)
            feasible = bool(certify(window, control[None])[0])
            if feasible or rounds == MAX_SOLVES or not problem.c(x).min() >= -MAX_VIOLATION:
                break
            if time.perf_counter() > until:
                break
            problem = problem.joined_by(broken_rows(control, window.field))
        return Certified(
            solution=solution,
            control=control,
            feasible=feasible,
            evaluations=evaluations,
            rounds=rounds,
            seconds=time.perf_counter() - began,
        )


def broken_rows(control: Array, field: Field) -> list[Constraint]:
    """Constraints for all limits that certification finds violated along segments (n, 4, D).

    Certification is repeated, since a row needs the parameter of the violation.
    """
    rows: list[Constraint] = []
    certified, limits, tolerance = length(control), field.limits, target_tolerance(field)
    if ((certified < limits.shortest - tolerance) | (certified > limits.longest + tolerance)).any():
        rows.append(LengthBounds(limits, certified - lengths(control)))
    speed, t = least_speed(control)
    if len(slow := np.flatnonzero(speed < limits.slowest - tolerance)):
        rows.append(SpeedAt(limits.slowest, slow, basis(t[slow], 1)))
    low, high = extent(control)
    outside = ((low < field.bounds[0] - tolerance) | (high > field.bounds[1] + tolerance)).any(
        axis=-1
    )
    if len(outer := np.flatnonzero(outside)):
        # at many parameters, since a coordinate has up to two extremes inside and two ends, which
        # move
        t = np.linspace(0.0, 1.0, 33)
        segment, weights = np.repeat(outer, len(t)), np.tile(basis(t), (len(outer), 1))
        rows.append(InsideAt(field.bounds, segment, weights))
    clear, t = field.obstacles.closest(control)
    segment, obstacle = np.nonzero(clear < -tolerance)
    if len(segment):
        rows.append(ClearanceAt(field.obstacles, segment, obstacle, basis(t[segment, obstacle])))
    return rows


class Solver(Protocol):
    """Finds a local minimum of a nonlinear program."""

    def solve(self, program: Program, guess: Array) -> Solution:
        """Start at `guess` (unknowns,), which need not be feasible."""
