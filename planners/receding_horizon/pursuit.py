"""Pursuit: segments of one stride on the shortest path that keeps a margin from obstacles.

Nothing is optimised: a segment ends a stride ahead on that path, along its tangent. So what is
decided is a simple function of the state, and what flies it with small errors survives them: an
expert to learn from. From inside the margin it steers back out.

Reference:
    Coulter (1992), Implementation of the pure pursuit path tracking algorithm, CMU-RI-TR-92-01:
    aims at a point of the path some way ahead.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field, planar_discs
from ferguson_gym.world.limits import PAPER_LIMITS, Limits
from ferguson_gym.world.obstacles import Discs
from planners.interface import Decision, Plan, Replanner, State, WindowReport
from planners.receding_horizon.guided import Guided
from planners.rollout import roll_out

SPACING = 0.25
"""Of points on the path [m]."""
_HAIR = 1e-7
"""How far outside a grown disc a point is put that lay in it [m]."""
_TRIES = 8
"""How often a point is moved out of grown discs that overlap."""


class Surroundings(NamedTuple):
    """A field whose discs are grown by their margins."""

    margins: Array
    """(n,) of the discs [m]."""
    togo: DistanceToGoal
    """Among the grown discs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pursuit:
    """A planner that pursues the shortest path at a distance from obstacles.

    Raises:
        ValueError: a stride, a margin or a gap that is not a length above 0.
    """

    margin: float = 0.8
    """Distance kept from a disc where its neighbours leave room [m]."""
    narrowest: float = 0.8
    """Gaps from this width on stay open: what borders them takes a smaller margin [m]."""
    stride: float = 7.0
    """Length of segments, as nearly as a whole number of them ends on the goal [m]."""
    others: tuple[float, ...] = (5.25, 9.0, 4.0)
    """Strides tried where that leads to nothing [m]."""
    rescue: Replanner = field(default_factory=Guided)
    """Decides where none of them does."""
    limits: Limits = PAPER_LIMITS

    def __post_init__(self) -> None:
        for name in ("margin", "narrowest", "stride"):
            if not 0.0 < (length := getattr(self, name)) < math.inf:
                raise ValueError(f"{name} must be a length above 0 m, got {length!r}")
        if not all(0.0 < length < math.inf for length in self.others):
            raise ValueError(f"others must be lengths above 0 m, got {self.others!r}")

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal; the seed changes nothing.

        Raises:
            TypeError: obstacles other than discs.
            ValueError: a field that is not planar.
        """
        return roll_out(self, field, state, seed)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Decide the next segment, and the one that is meant to follow it.

        Raises:
            TypeError: obstacles other than discs.
            ValueError: a field that is not planar.
        """
        began = time.perf_counter()
        vehicle = state.vehicle
        for chain in self._chains(field, vehicle):
            if not is_feasible(chain, field, self.limits).all():
                continue
            if transition.fly_segment(field, vehicle, chain[0], self.limits).flown:
                seconds = time.perf_counter() - began
                return Decision(chain, WindowReport(step=vehicle.segments, seconds=seconds))
        decision = self.rescue.decide(field, state, seed)
        report = replace(decision.report, seconds=time.perf_counter() - began)
        return replace(decision, report=report)

    def _chains(self, field: Field, vehicle: transition.State) -> Iterator[Array]:
        """One or two segments on the path, of one stride after the other."""
        path = self._path(field, vehicle.position)
        if path is None:
            return
        points = path.points(SPACING)
        for stride in (self.stride, *self.others):
            number = max(1, round(path.length / stride))
            yield _along(vehicle, points, path.length / number, min(number, 2))

    def _path(self, field: Field, position: Array) -> ShortestPath | None:
        """The shortest path from the nearest point outside all margins; None without one."""
        margins, togo = surroundings(field, self.margin, self.narrowest)
        outside = _outside(togo.field, position)
        path = None if outside is None else togo.path(outside)
        if path is not None:
            return path
        discs = planar_discs(field)
        room = np.clip(discs.signed_distance(position) - _HAIR, 0.0, margins)
        return DistanceToGoal(replace(field, obstacles=discs.grown(room))).path(position)


@lru_cache(maxsize=2)
def surroundings(field: Field, margin: float, narrowest: float) -> Surroundings:
    """A field with discs grown by a margin [m], less where gaps as wide as `narrowest` would close.

    Start and goal stay outside. Fields are known by identity.

    Raises:
        TypeError: obstacles other than discs.
        ValueError: a field that is not planar.
    """
    discs = planar_discs(field)
    apart = np.linalg.norm(discs.centers[:, None] - discs.centers, axis=-1)
    gaps = apart - discs.radii[:, None] - discs.radii
    np.fill_diagonal(gaps, np.inf)
    gaps[gaps < narrowest] = np.inf  # they are walls, margin or not
    room = discs.signed_distance(np.stack([field.start, field.goal])).min(axis=0)
    most = np.minimum(0.45 * gaps.min(axis=1, initial=np.inf), room - _HAIR)
    margins = np.clip(most, 0.0, margin)
    return Surroundings(margins, DistanceToGoal(replace(field, obstacles=discs.grown(margins))))


def _outside(field: Field, position: Array) -> Array | None:
    """The point itself or, out of the discs it lies in, one nearby; None where none is found."""
    discs, point = field.obstacles, position.copy()
    assert isinstance(discs, Discs)
    for _ in range(_TRIES):
        depth = discs.signed_distance(point)
        if len(depth) == 0 or depth.min() >= 0.0:
            return point
        k = int(depth.argmin())
        away = point - discs.centers[k]
        point = discs.centers[k] + away * ((discs.radii[k] + _HAIR) / np.linalg.norm(away))
    return None


def _along(vehicle: transition.State, points: Array, stride: float, number: int) -> Array:
    """Segments (number, 4, 2) of one stride [m] on a route (m, 2), along its tangents."""
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(chords)])
    at = stride * np.arange(number + 1)
    knots, before, after = (
        np.column_stack([np.interp(at + shift, way, axis) for axis in points.T])
        for shift in (0.0, -2.0 * SPACING, 2.0 * SPACING)
    )
    slopes = after - before
    slopes *= stride / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), _HAIR)
    knots[0], slopes[0] = vehicle.position, vehicle.derivative
    return np.stack([knots[:-1], knots[1:], slopes[:-1], slopes[1:]], axis=1)
