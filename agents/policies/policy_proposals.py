"""Initial guesses for planners from the segments that a policy would fly."""

from __future__ import annotations

import numpy as np

from agents.policies.interface import Policy
from ferguson_gym.runtime import Array
from ferguson_gym.simulation import Settings, observe_one
from ferguson_gym.world import Field, decode, transition
from planners.interface import Knowledge, knowledge_of

_SEEN = Settings()
"""The default settings of the environment, in which policies fly."""


class PolicyProposer:
    """Proposes the segments that a policy would fly, feasible or not."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy

    @property
    def knows(self) -> Knowledge:
        """What its policy knows of a field."""
        return knowledge_of(self._policy)

    def propose(
        self, field: Field, state: transition.State, segments: int, seed: int
    ) -> list[Array]:
        """The chain (n, 4, 2) that the policy flies from a state; empty if it gives up at once.

        Obstacles are ignored; the chain ends early on the goal or where the policy gives up. The
        policy begins again in every state, so that replanning in the middle of a flight gives the
        rest of the whole flight.
        """
        self._policy.begin(field, seed)
        goal, limits = field.goal, field.limits
        chain: list[Array] = []
        while len(chain) < segments:
            action = self._policy.act(observe_one(field, state, _SEEN), state)
            if action is None:
                break
            control = decode(
                action, state.position, state.derivative, goal, limits.gate, limits.unit
            )
            chain.append(control)
            state = transition.State(control[1], control[3], state.segments + 1)
            if np.array_equal(state.position, field.goal):
                break
        return [np.stack(chain)] if chain else []
