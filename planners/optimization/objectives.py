"""Objectives of windows: functions of a chain's length and its end point.

With l the summed length of a chain's segments and P its last point, an objective is F(l, P);
derivatives with respect to the unknowns follow by the chain rule from those of l and P.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ferguson_gym.runtime.arrays import Array, GenericArray
from ferguson_gym.runtime.jit import compiled

_LEAST = 1e-9
"""Lower limit of distances [m]: a chain that ends at its start has a value and derivatives."""


class Objective(Protocol):
    """A function F(l, P) of a chain's length and its end point [m]."""

    @property
    def kink(self) -> Array | None:
        """The point (D,), the goal, at which F has a cone-shaped minimum for any length.

        A solver can end the chain there. None if there is no such point.
        """

    def value(self, length: GenericArray, end: GenericArray) -> GenericArray:
        """F for a length () and a point (D,), real or complex."""

    def expand(self, length: float, end: Array) -> tuple[float, Array, Array]:
        """F, its gradient (1 + D,) and Hessian (1 + D, 1 + D) with respect to (l, P)."""


def _distance(offset: GenericArray) -> GenericArray:
    # no conjugate, so that a complex step differentiates it
    return np.sqrt(np.sum(offset * offset) + _LEAST**2)  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True, eq=False)
class HorizonObjective:
    """d (1 + alpha l / l_min): rewards ending close to the goal, and a direct path [m].

    d is the distance from the last point to the goal, l the summed length of the
    segments and l_min the straight distance from the first point to the last.

    Reference:
        The paper, section III-C2 and equation (2).
    """

    start: Array
    """(D,) [m]."""
    goal: Array
    """(D,) [m]."""
    alpha: float
    """Weight of directness."""

    @property
    def kink(self) -> Array:
        """The goal, where the distance to it is not differentiable."""
        return self.goal

    def value(self, length: GenericArray, end: GenericArray) -> GenericArray:
        """F for a length () and a point (D,), real or complex."""
        straight = _distance(end - self.start)
        return _distance(self.goal - end) * (1.0 + self.alpha * length / straight)

    def expand(self, length: float, end: Array) -> tuple[float, Array, Array]:
        """F, its gradient (1 + D,) and Hessian (1 + D, 1 + D) with respect to (l, P)."""
        return expand_horizon(length, end, self.start, self.goal, self.alpha)


@compiled
def expand_horizon(
    length: float, end: Array, start: Array, goal: Array, alpha: float
) -> tuple[float, Array, Array]:
    """As `HorizonObjective.expand`."""
    dimension = len(end)
    toward, away = end - goal, end - start
    d = np.sqrt(np.sum(toward * toward) + _LEAST**2)
    straight = np.sqrt(np.sum(away * away) + _LEAST**2)
    u, v = toward / d, away / straight
    # F = d q with q = 1 + alpha l / l_min
    share = alpha / straight
    q = 1.0 + share * length
    slope, curvature = np.empty(1 + dimension), np.zeros((1 + dimension, 1 + dimension))
    slope[0] = d * share
    for i in range(dimension):
        slope[1 + i] = q * u[i] - d * share * length / straight * v[i]
        curvature[0, 1 + i] = share * (u[i] - d / straight * v[i])
        curvature[1 + i, 0] = curvature[0, 1 + i]
        for j in range(dimension):
            same = 1.0 if i == j else 0.0
            turn_d = (same - u[i] * u[j]) / d
            turn_straight = (3.0 * v[i] * v[j] - same) / straight
            curvature[1 + i, 1 + j] = q * turn_d + share * length / straight * (
                d * turn_straight - u[i] * v[j] - v[i] * u[j]
            )
    return d * q, slope, curvature


@dataclass(frozen=True, slots=True, eq=False)
class LengthObjective:
    """The chain's length [m], for windows whose end is fixed at the goal.

    Reference:
        The paper, section III-C4.
    """

    @property
    def kink(self) -> None:
        """None: F is smooth."""

    def value(self, length: GenericArray, end: GenericArray) -> GenericArray:
        """F for a length () and a point (D,), real or complex."""
        return length

    def expand(self, length: float, end: Array) -> tuple[float, Array, Array]:
        """F, its gradient (1 + D,) and Hessian (1 + D, 1 + D) with respect to (l, P)."""
        slope = np.zeros(1 + len(end))
        slope[0] = 1.0
        return length, slope, np.zeros((len(slope), len(slope)))
