"""A safety margin: a planner that plans among obstacles grown by some metres.

Its decisions keep that clearance in the real field, so that a learner that imitates them inexactly
still avoids the obstacles. Where the grown obstacles leave no path, the margin shrinks, in the end
to zero.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ferguson_gym.world import Field, fly_segment
from planners.interface import Decision, Knowledge, Replanner, State, knowledge_of
from planners.rollout import StepByStep

MARGIN_FRACTIONS = (1.0, 0.4, 0.0)
"""Fractions of the margin, tried in turn."""
_OUTSIDE = 1e-6
"""Least distance of vehicle, start and goal from a grown obstacle [units of the field]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Margin(StepByStep):
    """A planner that keeps a distance from obstacles where it can.

    Raises:
        ValueError: a margin that is not positive and finite.
    """

    planner: Replanner
    """Decides among the grown obstacles."""
    margin: float
    """Distance to keep from obstacles [m]."""

    def __post_init__(self) -> None:
        if not 0.0 < self.margin < math.inf:
            raise ValueError(f"a margin must be above 0 m and finite, got {self.margin:g} m")

    @property
    def knows(self) -> Knowledge:
        """As much as the planner: growing obstacles shows it no others."""
        return knowledge_of(self.planner)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and tentative further ones."""
        began = time.perf_counter()
        for part in MARGIN_FRACTIONS:
            shown = grown_field(field, state, part * self.margin)
            decision = self.planner.decide(shown, state, seed)
            chain, step = decision.chain, decision.first_step
            if chain is not None and (step is None or shown is not field):
                # the planner's certificate holds among grown obstacles
                step = fly_segment(field, state.vehicle, chain[0])
            if step is not None and step.flown:
                break
        report = replace(decision.report, seconds=time.perf_counter() - began)
        return replace(decision, report=report, first_step=step)


def grown_field(field: Field, state: State, margin: float) -> Field:
    """The field with its obstacles grown by a margin [m].

    An obstacle grows by less where it would contain the vehicle, the start or the goal. The same
    margins return the same `Field` object, because planners cache results by the field's identity.
    """
    free = np.stack([state.vehicle.position, field.start, field.goal])
    room = field.obstacles.signed_distance(free).min(axis=0) - _OUTSIDE * field.limits.unit
    by = np.clip(room, 0.0, margin)
    return _grown(field, by.tobytes()) if by.any() else field


@lru_cache(maxsize=4)
def _grown(field: Field, by: bytes) -> Field:
    return replace(field, obstacles=field.obstacles.grown(np.frombuffer(by)))
