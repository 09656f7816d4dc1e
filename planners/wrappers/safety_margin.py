"""A margin: a planner that is shown obstacles grown by some metres, and so keeps away from them.

What it decides there is feasible in the field as it is, with room to spare. Learners that copy it
with small errors survive them. Where no way is left between the grown obstacles, the margin
shrinks, and at last there is none.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits
from ferguson_gym.world.transition import fly_segment
from planners.interface import Decision, Plan, Replanner, State
from planners.rollout import roll_out

PARTS = (1.0, 0.4, 0.0)
"""Of the margin, tried one after the other."""
_HAIR = 1e-6
"""Distance [m] that is left between an obstacle grown and what must not lie in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Margin:
    """A planner that keeps a distance from obstacles where it can.

    Raises:
        ValueError: a margin that is not finite or not above 0.
    """

    planner: Replanner
    """Decides among the grown obstacles."""
    margin: float
    """Distance to keep [m]."""

    def __post_init__(self) -> None:
        if not 0.0 < self.margin < math.inf:
            raise ValueError(f"a margin must be above 0 m and finite, got {self.margin:g} m")

    @property
    def limits(self) -> Limits:
        """What a segment may be."""
        return self.planner.limits

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal."""
        return roll_out(self, field, state, seed)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Decide the next segment, and what is meant to follow it."""
        began = time.perf_counter()
        for part in PARTS:
            shown = grown(field, state, part * self.margin)
            decision = self.planner.decide(shown, state, seed)
            chain = decision.chain
            if chain is not None and fly_segment(field, state.vehicle, chain[0], self.limits).flown:
                break
        report = replace(decision.report, seconds=time.perf_counter() - began)
        return replace(decision, report=report)


def grown(field: Field, state: State, margin: float) -> Field:
    """The field with its obstacles grown by a margin [m].

    None grows so far that the vehicle, the start or the goal would lie in it. The same object
    as long as obstacles grow alike: planners may know a field by its identity.
    """
    free = np.stack([state.vehicle.position, field.start, field.goal])
    room = field.obstacles.signed_distance(free).min(axis=0) - _HAIR
    by = np.clip(room, 0.0, margin)
    return _grown(field, by.tobytes()) if by.any() else field


@lru_cache(maxsize=4)
def _grown(field: Field, by: bytes) -> Field:
    return replace(field, obstacles=field.obstacles.grown(np.frombuffer(by)))
