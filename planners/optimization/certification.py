"""Certification of planned chains, and the result types of window solvers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, is_feasible, keeps_turn_radius
from planners.optimization.window import Window

TARGET_TOLERANCE = 1e-6
"""Greatest tolerance that planners aim for, in fields of the paper's scale [m]."""
MAX_SOLVES = 12
"""Maximum number of solves per window."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solution:
    """The result of one solve, before certification."""

    x: Array
    """Unknowns; finite."""
    objective: float
    """f(x)."""
    converged: bool
    """Whether the solver's own test for a local minimum passed."""
    status: str
    """The solver's message."""
    evaluations: int
    """Evaluations of the objective."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Certified:
    """A solution with its certificate."""

    solution: Solution
    """The result of the last solve."""
    control: Array
    """Its segments (n, 4, D)."""
    feasible: bool
    """Whether every segment is certified feasible to `target_tolerance`."""
    evaluations: int
    """Evaluations of the objective in all rounds."""
    rounds: int
    """Number of solves, 1 if the first solution was certified."""
    seconds: float
    """Time of all rounds, certification included."""


class WindowSolver(Protocol):
    """Finds certified local minima of a window."""

    def solve(
        self, window: Window, guesses: Sequence[Array], until: float = math.inf
    ) -> list[Certified]:
        """Solve a window from each guess (n, 4, D); guesses need not be feasible.

        At the time `until`, on the clock of `time.perf_counter` [s], the search stops and returns
        the best solutions so far.
        """


def target_tolerance(field: Field) -> float:
    """Tolerance that planners aim for [m]; the rest of the limits' covers float32 actions."""
    return min(TARGET_TOLERANCE, field.limits.tolerance / 10.0)


def certify(window: Window, control: Array) -> NDArray[np.bool_]:
    """Whether each chain (k, n, 4, D) is certified feasible to `target_tolerance`: (k,).

    A chain with a number that is not finite is infeasible.
    """
    feasible = np.asarray(np.isfinite(control).all(axis=(1, 2, 3)))
    sound, tolerance = control[feasible], target_tolerance(window.field)
    certified = is_feasible(sound, window.field, tolerance)
    if window.turn_radius > 0.0:
        certified &= keeps_turn_radius(sound, window.turn_radius, tolerance)
    feasible[feasible] = certified.all(axis=-1)
    return feasible
