"""The objective of guided windows: length flown plus the exact distance to the goal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ferguson_gym.runtime.arrays import Array, GenericArray
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal, shortest_departure
from ferguson_gym.shortest_paths.tangent_graph import Tracks
from ferguson_gym.shortest_paths.tangents import Scene

_AWAY = 1e-6
"""Distance from a disc at which a point moved out of it is placed [m]."""
_NEAR = 0.5
"""Least radius of curvature of the distance's level lines [m]."""
_FAR = 1e3
"""The distance assumed where no path leads to the goal [m]."""
_TRIES = 8
"""Most moves of a point out of discs that overlap."""


@dataclass(frozen=True, slots=True, eq=False)
class ToGoObjective:
    """l + D(P): the length flown, plus that of the shortest path from its end to the goal [m].

    The end of an infeasible chain may lie in a disc; D is then the distance to the nearest point
    outside plus the distance from there. Where two paths are equally short D has a kink, and the
    derivatives are those of one of them.
    """

    togo: DistanceToGoal

    @property
    def kink(self) -> None:
        """None: chains that can reach the goal have a window of their own."""

    def value(self, length: GenericArray, end: GenericArray) -> GenericArray:
        """F for a length () and a point (2,), real."""
        return length + self.expand(0.0, end)[0]

    def expand(self, length: float, end: Array) -> tuple[float, Array, Array]:
        """F, its gradient (3,) and Hessian (3, 3) with respect to (l, P)."""
        togo = self.togo
        return _expand(
            length, end[0], end[1], togo.scene, togo.tracks, togo.field.goal, togo.tolerance
        )


@compiled
def _into_the_open(scene: Scene, x: float, y: float) -> tuple[float, float]:
    """The point itself or, if it lies in discs, the nearest point outside of the deepest one."""
    discs, box = scene.discs, scene.box
    x, y = min(max(x, box[0, 0]), box[1, 0]), min(max(y, box[0, 1]), box[1, 1])
    deepest, depth = -1, 0.0
    for k in range(len(discs)):
        disc = discs[k]
        inside = disc.radius - np.sqrt((disc.x - x) ** 2 + (disc.y - y) ** 2)
        if inside > depth:
            deepest, depth = k, inside
    if deepest < 0:
        return x, y
    disc = discs[deepest]
    dx, dy = x - disc.x, y - disc.y
    stretch = (disc.radius + _AWAY) / max(np.sqrt(dx * dx + dy * dy), _AWAY)
    return disc.x + stretch * dx, disc.y + stretch * dy


@compiled
def _expand(
    length: float, x: float, y: float, scene: Scene, tracks: Tracks, goal: Array, tolerance: float
) -> tuple[float, Array, Array]:
    near_x, near_y = x, y
    way = shortest_departure(scene, tracks, goal, x, y, tolerance)
    for _ in range(_TRIES):
        if way.distance < np.inf:
            break
        near_x, near_y = _into_the_open(scene, near_x, near_y)
        way = shortest_departure(scene, tracks, goal, near_x, near_y, tolerance)
    slope, curvature = np.zeros(3), np.zeros((3, 3))
    slope[0] = 1.0
    if way.distance == np.inf:
        return length + _FAR, slope, curvature
    slope[1], slope[2] = -way.ux, -way.uy
    # level lines of the distance are circles around the end of the path's first line
    bend = 1.0 / max(way.line, _NEAR)
    curvature[1, 1] = bend * way.uy * way.uy
    curvature[1, 2] = curvature[2, 1] = -bend * way.ux * way.uy
    curvature[2, 2] = bend * way.ux * way.ux
    moved = np.sqrt((x - near_x) ** 2 + (y - near_y) ** 2)
    return length + way.distance + moved, slope, curvature
