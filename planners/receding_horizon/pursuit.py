"""Pursuit: segments of fixed length along the shortest path that keeps a margin from obstacles.

Nothing is optimised: a segment ends one stride (a fixed length) ahead on the path, along the path's
tangent. A decision is therefore a simple function of the state and changes little with it, so that
the planner can serve as an expert for imitation learning. From inside the margin it steers back
out.

Reference:
    After the idea of Coulter (1992), Implementation of the pure pursuit path tracking algorithm,
    CMU-RI-TR-92-01.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from ferguson_gym.guidance.margins import OUTSIDE, outside, solids, surroundings
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import DistanceToGoal, ShortestPath
from ferguson_gym.world import is_feasible, transition
from ferguson_gym.world.field import Field, planar_obstacles
from planners.interface import Decision, Knowledge, Replanner, State, WindowReport
from planners.receding_horizon.guided import Guided, is_tight
from planners.rescaling import decided_in_image
from planners.rollout import StepByStep

SPACING = 0.25
"""Distance between points on the path [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pursuit(StepByStep):
    """A planner that pursues the shortest path at a distance from obstacles.

    Lengths are those of fields of the paper's scale, see `planners.rescaling`.

    Raises:
        ValueError: a stride, a margin or a gap width that is not positive and finite.
    """

    knows: ClassVar[Knowledge] = Knowledge.WHOLE_FIELD

    margin: float = 0.8
    """Distance kept from each obstacle where its neighbours leave enough room [m]."""
    narrowest: float = 0.8
    """The margin never closes passages at least this wide [m]; obstacles beside them grow less."""
    stride: float = 7.0
    """Approximate length of segments [m]; a whole number of them ends on the goal."""
    others: tuple[float, ...] = (5.25, 9.0, 4.0)
    """Strides tried in turn if no feasible segment of the first stride is found [m]."""
    rescue: Replanner = field(default_factory=Guided)
    """Decides if no stride leads to a feasible segment."""

    def __post_init__(self) -> None:
        for name in ("margin", "narrowest", "stride"):
            if not 0.0 < (length := getattr(self, name)) < math.inf:
                raise ValueError(f"{name} must be a length above 0 m, got {length!r}")
        if not all(0.0 < length < math.inf for length in self.others):
            raise ValueError(f"others must be lengths above 0 m, got {self.others!r}")

    @decided_in_image
    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and a tentative second one; the seed has no effect.

        Raises:
            ValueError: a field that is not planar.
        """
        began = time.perf_counter()
        vehicle = state.vehicle
        for chain in self._chains(field, vehicle):
            if not is_feasible(chain, field).all():
                continue
            # certified as flown, since rounding to a float32 action changes the segment
            step = transition.fly_segment(field, vehicle, chain[0])
            if step.flown:
                report = WindowReport(step=vehicle.segments, seconds=time.perf_counter() - began)
                return Decision(chain, report, first_step=step)
        decision = self.rescue.decide(field, state, seed)
        report = replace(decision.report, seconds=time.perf_counter() - began)
        return replace(decision, report=report)

    def _chains(self, field: Field, vehicle: transition.State) -> Iterator[Array]:
        """Chains (1 or 2, 4, 2) on the path, one for each stride."""
        path = self._path(field, vehicle.position)
        if path is None:
            return
        if is_tight(field, vehicle, path.length):
            return
        points, left = path.points(SPACING), field.limits.segments - vehicle.segments
        for stride in (self.stride, *self.others):
            number = min(max(1, round(path.length / stride)), max(1, left))
            yield _along(vehicle, points, path.length / number, min(number, 2))

    def _path(self, field: Field, position: Array) -> ShortestPath | None:
        """The shortest path from the nearest point outside all margins; None if there is none."""
        margins, togo = surroundings(field, self.margin, self.narrowest)
        x, y = position.tolist()
        x, y, found = outside(x, y, solids(togo.field.obstacles), OUTSIDE)
        path = togo.path((x, y)) if found else None
        if path is not None:
            return path
        obstacles = planar_obstacles(field)
        room = np.clip(obstacles.signed_distance(position) - OUTSIDE, 0.0, margins)
        return DistanceToGoal(replace(field, obstacles=obstacles.grown(room))).path(position)


def _along(vehicle: transition.State, points: Array, stride: float, number: int) -> Array:
    """Segments (number, 4, 2) of one stride [m] along a route (m, 2) and its tangents."""
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(chords)])
    at = stride * np.arange(number + 1)
    knots, before, after = (
        np.column_stack([np.interp(at + shift, way, axis) for axis in points.T])
        for shift in (0.0, -2.0 * SPACING, 2.0 * SPACING)
    )
    slopes = after - before
    slopes *= stride / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), OUTSIDE)
    knots[0], slopes[0] = vehicle.position, vehicle.derivative
    return np.stack([knots[:-1], knots[1:], slopes[:-1], slopes[1:]], axis=1)
