"""The objective of guided windows: their length plus the exact cost-to-go of their end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ferguson_gym.runtime.arrays import Array, GenericArray
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.departures import Departure, shortest_departure
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.goal_search.queries import departure
from ferguson_gym.shortest_paths.goal_search.search import GoalSearch
from ferguson_gym.shortest_paths.scene import Scene
from ferguson_gym.shortest_paths.shapes import is_disc, nearest_feature
from ferguson_gym.shortest_paths.tangent_graph import Tracks

_WHOLE, _NONE = np.empty(0, np.int64), np.empty(0)
NO_TRACKS = Tracks(_WHOLE, _WHOLE, _NONE, _WHOLE, _NONE, _NONE, _WHOLE, _NONE)
"""In the place of the tangent graph, where a search from the goal is used instead."""
_OUTSIDE = 1e-6
"""Clearance given to a point that is moved out of an obstacle [m]."""
_MIN_RADIUS = 0.5
"""Lower bound on the radius of curvature of the distance's level lines [m]."""
_NO_PATH = 1e3
"""The least cost-to-go assumed where no path leads to the goal [m]."""
_MAX_MOVES = 8
"""Maximum number of moves of a point out of obstacles that overlap."""


@dataclass(frozen=True, slots=True, eq=False)
class ToGoObjective:
    """l + D(P): the chain's length, plus that of the shortest path from its end to the goal [m].

    The end of an infeasible chain may lie in an obstacle or outside the bounds. It is then moved
    out, and D is the distance moved plus the cost-to-go from there; the derivatives are those of D
    at the moved point, an approximation. If no path is found, D is 1000 m, or five times the
    field's straight distance if that is more, with zero derivatives. Where two paths are equally
    short D has a kink, and the derivatives are those of one of them.
    """

    togo: DistanceToGoal

    @property
    def kink(self) -> None:
        """None: near the goal the final window is used instead."""

    def value(self, length: GenericArray, end: GenericArray) -> GenericArray:
        """F for a length () and a point (2,), real."""
        return length + self.expand(0.0, end)[0]

    def expand(self, length: float, end: Array) -> tuple[float, Array, Array]:
        """F, its gradient (3,) and Hessian (3, 3) with respect to (l, P)."""
        togo, x, y = self.togo, float(end[0]), float(end[1])
        if togo.tracks is None and not togo.field.obstacles.are_discs:
            return self._expand_by_parts(length, x, y)
        search, tracks = (togo.borrow(), NO_TRACKS) if togo.tracks is None else (None, togo.tracks)
        goal, tolerance = np.array(togo.field.goal), togo.tolerance
        after, value, slope, curvature = expand_togo(
            length, x, y, togo.scene, tracks, search, goal, tolerance, self.blocked
        )
        if after is not None:
            togo.searches.append(after)
        return value, slope, curvature

    def _expand_by_parts(self, length: float, x: float, y: float) -> tuple[float, Array, Array]:
        """As `expand`, from graphs of a part of the obstacles."""
        near_x, near_y = x, y
        way = self.togo.departure(x, y)
        for _ in range(_MAX_MOVES):
            if way.distance < np.inf:
                break
            near_x, near_y = _out_of_obstacles(self.togo.scene, near_x, near_y)
            way = self.togo.departure(near_x, near_y)
        return _expand(length, x, y, near_x, near_y, way, self.blocked)

    @property
    def blocked(self) -> float:
        """D where no path is found [m]."""
        return max(_NO_PATH, 5.0 * self.togo.field.distance)


@compiled
def _out_of_obstacles(scene: Scene, x: float, y: float) -> tuple[float, float]:
    """The point itself or, if obstacles hold it, the nearest point outside of the deepest one."""
    discs, box, shapes = scene.discs, scene.box, scene.shapes
    x, y = min(max(x, box[0, 0]), box[1, 0]), min(max(y, box[0, 1]), box[1, 1])
    deepest, depth = -1, 0.0
    for k in range(len(discs)):
        disc = discs[k]
        inside = disc.radius - np.sqrt((disc.x - x) ** 2 + (disc.y - y) ** 2)
        if inside > depth and not is_disc(shapes, k):
            inside = shapes.radii[k] - nearest_feature(shapes, k, x, y).distance
        if inside > depth:
            deepest, depth = k, inside
    if deepest < 0:
        return x, y
    disc = discs[deepest]
    center_x, center_y, radius = disc.x, disc.y, disc.radius
    if not is_disc(shapes, deepest):
        near, radius = nearest_feature(shapes, deepest, x, y), shapes.radii[deepest]
        corner = shapes.corners[near.corner]
        center_x, center_y = corner.x, corner.y
        if near.is_edge:
            return x + (depth + _OUTSIDE) * corner.nx, y + (depth + _OUTSIDE) * corner.ny
    dx, dy = x - center_x, y - center_y
    stretch = (radius + _OUTSIDE) / max(np.sqrt(dx * dx + dy * dy), _OUTSIDE)
    return center_x + stretch * dx, center_y + stretch * dy


@compiled
def expand_togo(
    length: float,
    x: float,
    y: float,
    scene: Scene,
    tracks: Tracks,
    search: GoalSearch | None,
    goal: Array,
    tolerance: float,
    blocked: float,
) -> tuple[GoalSearch | None, float, Array, Array]:
    """F and its derivatives at (x, y), after the search from the goal, if there is one."""
    near_x, near_y, moves = x, y, 0
    after = search
    while True:
        if after is None or search is None:
            way = shortest_departure(scene, tracks, goal, near_x, near_y, tolerance)
        else:
            after, way = departure(after, near_x, near_y, tolerance)
        if way.distance < np.inf or moves == _MAX_MOVES:
            break
        near_x, near_y = _out_of_obstacles(scene, near_x, near_y)
        moves += 1
    value, slope, curvature = _expand(length, x, y, near_x, near_y, way, blocked)
    return after, value, slope, curvature


@compiled
def _expand(
    length: float,
    x: float,
    y: float,
    near_x: float,
    near_y: float,
    way: Departure,
    blocked: float,
) -> tuple[float, Array, Array]:
    """F and its derivatives at (x, y), given how a path leaves the point that it was moved to."""
    slope, curvature = np.zeros(3), np.zeros((3, 3))
    slope[0] = 1.0
    if way.distance == np.inf:
        return length + blocked, slope, curvature
    slope[1], slope[2] = -way.ux, -way.uy
    # the end of the path's first line is the centre of curvature of D's level line
    bend = 1.0 / max(way.line, _MIN_RADIUS)
    curvature[1, 1] = bend * way.uy * way.uy
    curvature[1, 2] = curvature[2, 1] = -bend * way.ux * way.uy
    curvature[2, 2] = bend * way.ux * way.ux
    moved = np.sqrt((x - near_x) ** 2 + (y - near_y) ** 2)
    return length + way.distance + moved, slope, curvature
