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
from numpy.typing import NDArray

from ferguson_gym.arc_length import length
from ferguson_gym.arrays import Array
from ferguson_gym.clearance import least_speed
from ferguson_gym.feasibility import is_feasible
from ferguson_gym.fields import Field
from ferguson_gym.limits import Limits
from ferguson_gym.splines import basis, extent
from ferguson_gym.turn_radius import keeps_turn_radius
from planners.constraints import ClearanceAt, Constraint, InsideAt, LengthBounds, SpeedAt
from planners.quadrature import lengths
from planners.solvers import Slsqp, Solution, Solver
from planners.window import Window

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
    seconds: float
    """Time of all rounds, certification included."""


class WindowSolver(Protocol):
    """Finds certified local minima of a window."""

    def solve(
        self, window: Window, guesses: Sequence[Array], until: float = math.inf
    ) -> list[Certified]:
        """Start at each of some guesses (n, 4, D), which need not be feasible.

        Args:
            window: what is planned.
            guesses: segments (n, 4, D) each.
            until: when to stop with the best found so far, on the clock of
                `time.perf_counter` [s].
        """


def certify(window: Window, control: Array) -> NDArray[np.bool_]:
    """Whether each of some chains (k, n, 4, D) is certified feasible to `AIM`: (k,).

    One in which a search lost its way among numbers out of range, to NaN, is not.
    """
    feasible = np.asarray(np.isfinite(control).all(axis=(1, 2, 3)))
    sound = control[feasible]
    certified = is_feasible(sound, window.field, window.limits, AIM)
    if window.turn_radius > 0.0:
        certified &= keeps_turn_radius(sound, window.turn_radius, AIM)
    feasible[feasible] = certified.all(axis=-1)
    return feasible


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
