"""A limited sensing range: an agent that knows only the obstacles sensed so far.

As `planners.wrappers.limited_sensing` for planners: unknown space counts as free, and what was
sensed is remembered. The agent flies the field of known obstacles, whatever it makes of it: what
its network observes, the way that it is shown, and the rollouts that it simulates.
"""

from __future__ import annotations

import itertools
from typing import ClassVar

import numpy as np

from agents.policies.interface import Policy
from ferguson_gym.runtime import Array
from ferguson_gym.simulation import Observation
from ferguson_gym.world import Action, Field, transition
from planners.interface import Knowledge, State
from planners.wrappers.limited_sensing import check_range, known_field


class SensingPolicy:
    """A policy that knows the obstacles within a range of the path flown.

    Args:
        policy: makes its own observations of the field in which it begins, as agents do.
        reach: the sensing range [m], from the path flown to an obstacle's boundary.
    """

    knows: ClassVar[Knowledge] = Knowledge.NEARBY

    def __init__(self, policy: Policy, reach: float) -> None:
        self._policy, self._reach = policy, reach

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field.

        Raises:
            ValueError: a range below the longest segment of the field.
        """
        check_range(self._reach, field)
        self._field, self._seed = field, seed
        self._known: Field | None = None
        self._states: list[transition.State] = []

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        """The next action, chosen among known obstacles."""
        # a shield may have asked in a state ahead that the flight did not come to
        self._states = [one for one in self._states if one.segments < vehicle.segments]
        self._states.append(vehicle)
        flown = [_between(*pair) for pair in itertools.pairwise(self._states)]
        state = State(vehicle, flown=np.array(flown).reshape(-1, 4, 2))
        known = known_field(self._field, state, self._reach)
        if known is not self._known:
            self._known = known
            self._policy.begin(known, self._seed)
        return self._policy.act(observation, vehicle)


def _between(before: transition.State, after: transition.State) -> Array:
    """The segment (4, 2) from one state to the next one."""
    return np.stack([before.position, after.position, before.derivative, after.derivative])
