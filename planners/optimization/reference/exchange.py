"""Solving until certified: rows join where the whole curve breaks a constraint.

Sampled constraints let a curve cut into a disc between samples, leave the bounds or turn a
corner. What certification finds joins the problem as a further row, and it is solved on
from where it stopped: the exchange method of semi-infinite programming.

Reference:
    Hettich & Kortanek (1993), Semi-infinite programming: theory, methods, and
    applications, SIAM Review 35(3).
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
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits
from planners.optimization.certification import AIM, Certified, Solution, certify
from planners.optimization.constraints import (
    ClearanceAt,
    Constraint,
    InsideAt,
    LengthBounds,
    SpeedAt,
)
from planners.optimization.nonlinear_program import Programme
from planners.optimization.quadrature import lengths
from planners.optimization.reference.slsqp import Slsqp
from planners.optimization.sqp.multi_start import ROUNDS
from planners.optimization.window import Window

HOPELESS = 1e-3
"""A solver that leaves its own rows broken by more [m] is not helped by further rows."""


@dataclass(frozen=True, slots=True)
class ByExchange:
    """A solver of programmes made to solve windows: sampled, then joined row by row."""

    solver: Solver = field(default_factory=Slsqp)

    def solve(
        self, window: Window, guesses: Sequence[Array], until: float = math.inf
    ) -> list[Certified]:
        """Certified local minima from guesses; the deadline counts between two solves."""
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
            if feasible or rounds == ROUNDS or not problem.c(x).min() >= -HOPELESS:
                break
            if time.perf_counter() > until:
                break
            problem = problem.joined_by(broken_rows(control, window.field, window.limits))
        return Certified(
            solution=solution,
            control=control,
            feasible=feasible,
            evaluations=evaluations,
            rounds=rounds,
            seconds=time.perf_counter() - began,
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


class Solver(Protocol):
    """Finds a local minimum of a programme."""

    def solve(self, programme: Programme, guess: Array) -> Solution:
        """Start at `guess` (unknowns,), which need not be feasible."""
