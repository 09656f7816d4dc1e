"""What planners of whole paths find first: a route, before it is fitted with segments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from ferguson_gym import flight
from ferguson_gym.arrays import Array
from ferguson_gym.fields import Field


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Route:
    """A way to the goal, clear of obstacles and inside the bounds."""

    points: Array
    """(n, 2) corners, or points on the curve, from the vehicle to the goal [m]."""
    length: float
    """Of the curve itself [m]; points on it may lie on shorter chords."""
    progress: Sequence[tuple[float, float]]
    """Seconds since planning began, and the length [m] that was reached: each time a shorter
    route was found, the first first."""
    evaluations: int = 0
    """Evaluations of an objective, for planners that have one."""


class Router(Protocol):
    """Finds routes."""

    def route(self, field: Field, vehicle: flight.State, seed: int) -> Route | None:
        """A route from a vehicle to the goal, None if none was found.

        Raises:
            CrashedError: what does the work crashed or did not answer.
        """


class CrashedError(RuntimeError):
    """A planner's library crashed or did not answer; the planner lives on."""
