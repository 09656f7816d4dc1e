"""Certification of planned chains, and what solvers of a window return."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.turn_radius import keeps_turn_radius
from planners.optimization.window import Window

AIM = 1e-6
"""Tolerance [m] that planners aim for; the rest of the limits' tolerance covers float32 actions."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solution:
    """Where a solver stopped. Whether it may be flown is certified elsewhere."""

    x: Array
    """Unknowns; finite."""
    objective: float
    """f(x)."""
    converged: bool
    """Whether the solver's own test for a local minimum passed."""
    status: str
    """The solver's word for how it ended."""
    evaluations: int
    """Evaluations of the objective."""


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
