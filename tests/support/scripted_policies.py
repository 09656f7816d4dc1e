"""Policies that fly by a simple rule: well, badly, or not at all."""

from __future__ import annotations

import numpy as np

from agents.policies.registry import make_policy
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.world import transition
from ferguson_gym.world.actions import Action, encode
from ferguson_gym.world.field import Field


class Always:
    """The same action in every state; None gives up."""

    def __init__(self, *action: float) -> None:
        self._action = np.array(action, np.float32) if action else None
        self.asked: list[transition.State] = []

    def begin(self, field: Field, seed: int) -> None:
        self.asked = []

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        self.asked.append(vehicle)
        return self._action


class Straight:
    """Towards the goal in segments of the same length, whatever stands in the way."""

    def __init__(self, stride: float = 11.0) -> None:
        self._stride = stride

    def begin(self, field: Field, seed: int) -> None:
        self._goal = field.goal

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        way = self._goal - vehicle.position
        distance = float(np.linalg.norm(way))
        end = vehicle.position + way * min(1.0, self._stride / distance)
        slope = 5.0 * way / distance
        segment = np.array([vehicle.position, end, vehicle.derivative, slope])
        return encode(segment, vehicle.position, vehicle.derivative)


class Noisy:
    """A planner whose actions are disturbed."""

    def __init__(self, planner: str = "guided", noise: float = 0.05) -> None:
        self._planner, self._noise = make_policy(planner), noise

    def begin(self, field: Field, seed: int) -> None:
        self._planner.begin(field, seed)
        self._seed = seed

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        action = self._planner.act(observation, vehicle)
        if action is None:
            return None
        stream = np.random.default_rng([self._seed, vehicle.segments])
        noisy: Action = np.clip(action + self._noise * stream.normal(size=4), -1.0, 1.0).astype(
            np.float32
        )
        return noisy


CIRCLING = (-0.2, 0.5, 0.0, 0.0)
"""Turns left on and on."""
COLLIDING = (-1.0, 0.0, 0.0, 0.0)
"""Ends behind the vehicle: refused in every state."""
