"""What a window minimises: short pure functions of the chain, with exact gradients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ferguson_gym.arrays import Array, GenericArray
from planners.quadrature import length_gradients, lengths

_NOTHING = 1e-9
"""Distances below this [m] count as this."""


class Objective(Protocol):
    """A function of a chain's segments."""

    def value(self, control: GenericArray) -> GenericArray:
        """Value for segments (n, 4, D), real or complex."""

    def gradient(self, control: Array) -> Array:
        """Gradient with respect to every segment's control array: (n, 4, D)."""


def _distance(offset: GenericArray) -> GenericArray:
    # no conjugate, so that a complex step differentiates it
    distance: GenericArray = np.sqrt(np.sum(offset * offset))
    return distance


def _apart(distance: GenericArray) -> GenericArray:
    # a chain that ends where it starts is as bad as can be, yet its value must be a number
    return distance if distance.real > _NOTHING else np.asarray(_NOTHING)


@dataclass(frozen=True, slots=True, eq=False)
class HorizonObjective:
    """d (1 + alpha l / l_min): close to the goal, and directly [m].

    d is the distance from the last point to the goal, l the summed length of the
    segments and l_min the straight distance from the first point to the last.

    Reference:
        The paper, section III-C2 and equation (2).
    """

    goal: Array
    """(D,) [m]."""
    alpha: float
    """Weight of directness."""

    def value(self, control: GenericArray) -> GenericArray:
        """Value for segments (n, 4, D), real or complex."""
        d = _distance(self.goal - control[-1, 1])
        straight = _apart(_distance(control[-1, 1] - control[0, 0]))
        return np.asarray(d * (1.0 + self.alpha * np.sum(lengths(control)) / straight))

    def gradient(self, control: Array) -> Array:
        """Gradient with respect to every segment's control array: (n, 4, D)."""
        to_goal = control[-1, 1] - self.goal
        chord = control[-1, 1] - control[0, 0]
        d, straight = float(_distance(to_goal)), float(_apart(_distance(chord)))
        flown = float(np.sum(lengths(control)))
        gradient = d * self.alpha / straight * length_gradients(control)
        if d > 0.0:
            gradient[-1, 1] += (1.0 + self.alpha * flown / straight) * to_goal / d
        bend = d * self.alpha * flown / straight**3 * chord
        gradient[-1, 1] -= bend
        gradient[0, 0] += bend
        return gradient


@dataclass(frozen=True, slots=True, eq=False)
class LengthObjective:
    """Summed length of the segments [m], once the chain ends on the goal.

    Reference:
        The paper, section III-C4.
    """

    def value(self, control: GenericArray) -> GenericArray:
        """Value for segments (n, 4, D), real or complex."""
        return np.asarray(np.sum(lengths(control)))

    def gradient(self, control: Array) -> Array:
        """Gradient with respect to every segment's control array: (n, 4, D)."""
        return length_gradients(control)
