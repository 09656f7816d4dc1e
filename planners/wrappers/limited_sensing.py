"""A limited sensing range: a planner that knows only the obstacles sensed so far.

Its decisions are optimistic: unknown space counts as free. When an obstacle is sensed, the planner
gets a new field, in which it recomputes the cost-to-go and certifies the rest of its plan again.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np

from ferguson_gym.curves.splines import evaluate, subdivide
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, fly_segment, is_feasible
from planners.interface import Decision, Knowledge, Replanner, State
from planners.rollout import StepByStep


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensing(StepByStep):
    """A planner that knows the obstacles within a range of the path flown.

    A range of at least the longest segment makes every decision safe: no point of the next segment
    is farther away than that, so that every obstacle it could cut into is known. Later segments of
    a window may lead into unknown space; they are decided again. A segment that ends so close to
    unknown space that the vehicle could not turn around is split into two slower halves if both are
    feasible.

    Raises:
        ValueError: a range that is not positive; `decide` refuses one below the longest segment.
    """

    knows: ClassVar[Knowledge] = Knowledge.NEARBY

    planner: Replanner
    """Decides among the known obstacles."""
    reach: float
    """The sensing range [m], from the path flown to an obstacle's boundary."""

    def __post_init__(self) -> None:
        if not self.reach > 0.0:
            raise ValueError(f"a sensing range must be above 0 m, got {self.reach:g} m")

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and tentative further ones, among known obstacles.

        Raises:
            ValueError: a range below the longest segment of the field.
        """
        began = time.perf_counter()
        check_range(self.reach, field)
        seen = known_field(field, state, self.reach)
        decision = self.planner.decide(seen, state, seed)
        chain = decision.chain
        if chain is not None and not self._leaves_room(seen, chain[0]):
            halves = _halved(chain[0])
            flown = fly_segment(seen, state.vehicle, halves[0]).flown
            if flown and is_feasible(halves[1], seen):
                chain = np.concatenate([halves, chain[1:]])
        report = replace(decision.report, seconds=time.perf_counter() - began)
        # the planner's certificate holds among known obstacles: the rollout certifies in the field
        return replace(decision, chain=chain, report=report, known=seen, first_step=None)

    def _leaves_room(self, field: Field, segment: Array) -> bool:
        """Whether there is room to turn between the end of a segment (4, 2) and unknown space.

        A cubic that starts with derivative v and returns to its start with derivative zero
        overshoots by 4/27 |v|.
        """
        start, end, _, derivative = segment
        if np.array_equal(end, field.goal):
            return True
        room = self.reach - float(np.linalg.norm(end - start))
        return room >= 0.5 * field.limits.shortest + 4.0 / 27.0 * float(np.linalg.norm(derivative))


def check_range(reach: float, field: Field) -> None:
    """Refuse a sensing range [m] that is too short for a field.

    Raises:
        ValueError: a range below the longest segment.
    """
    if not reach >= field.limits.longest:
        raise ValueError(
            "a sensing range must be at least the longest segment, "
            f"{field.limits.longest:g} m in field {field.name}, got {reach:g} m"
        )


def _halved(segment: Array) -> Array:
    """Two segments (2, 4, 2) nearly along one (4, 2), about half as long and half as fast."""
    t = np.linspace(0.0, 1.0, 33)
    steps = np.linalg.norm(np.diff(evaluate(segment, t), axis=0), axis=-1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    middle = float(np.interp(0.5 * way[-1], way, t))
    first, second = subdivide(segment, middle)
    # the derivatives at both ends of the segment are kept, so that the chain stays C1
    first[2], second[2], second[3] = segment[2], first[3], segment[3]
    return np.stack([first, second])


def known_field(field: Field, state: State, reach: float) -> Field:
    """The field with only those obstacles within a range [m] of the vehicle or of its path.

    Distances are certified: an obstacle counts at most 1e-7 m before it is in range. The result is
    the same object until another obstacle comes into range.
    """
    near = field.obstacles.signed_distance(state.vehicle.position) <= reach
    clearance, _ = field.obstacles.closest(state.flown)
    return _only(field, (near | (clearance <= reach).any(axis=0)).tobytes())


@lru_cache(maxsize=2)
def _only(field: Field, mask: bytes) -> Field:
    return replace(field, obstacles=field.obstacles.only(np.frombuffer(mask, dtype=np.bool_)))
