"""What the objective of windows comes close to: the cost-to-go and the turn into its path."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.world import Field
from planners.interface import State

_TURN = 0.1
"""Excess that the turn from the vehicle's heading into the shortest path needs, by measurement: in
multiples of |X'| (1 - cos of the angle)."""
_MOST_TURN = 0.04
"""Upper limit of this excess, relative to the shortest segment."""


class TurnBound(NamedTuple):
    """A bound that the objective of windows may come close to."""

    togo: float
    """The exact cost-to-go of the vehicle [m], which is a lower bound."""
    turn: float
    """Length [m] that the turn from the vehicle's heading into the shortest path needs."""

    @classmethod
    def of(cls, field: Field, state: State) -> TurnBound:
        """The bound in a state."""
        (togo,), (gradient,) = distance_to_go(field)(state.vehicle.position[None])
        derivative = state.vehicle.derivative
        turn = _TURN * float(np.linalg.norm(derivative) + derivative @ gradient)
        return cls(float(togo), min(turn, _MOST_TURN * field.limits.shortest))
