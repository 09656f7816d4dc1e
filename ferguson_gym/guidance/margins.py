"""Margins by which obstacles are grown, so that the shortest path among them keeps a distance.

A margin is less where the whole one would close a passage.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ferguson_gym.curves.convex_core import Cores
from ferguson_gym.curves.core_pairs import cores_gap
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.shapes import (
    Shapes,
    is_disc,
    make_shapes,
    nearest_feature,
    no_shapes,
)
from ferguson_gym.world.field import Field, planar_obstacles
from ferguson_gym.world.obstacles import Obstacles

OUTSIDE = 1e-7
"""Clearance given to a point that is moved out of a grown obstacle [units of the field]."""
_SHARE = 0.45
"""Share of a gap by which each of the two obstacles beside it may be grown."""
_MAX_MOVES = 8
"""Maximum number of moves of a point out of grown obstacles that overlap."""
_PLANE = (0, 1)
"""The axes, for compiled functions."""


class Surroundings(NamedTuple):
    """A field whose obstacles are grown by their margins."""

    margins: Array
    """(n,) by which each obstacle is grown [m]."""
    togo: DistanceToGoal
    """The distance to the goal among the grown obstacles."""


class Solids(NamedTuple):
    """Obstacles that points are moved out of."""

    centers: Array
    """(2, n) of the discs that bound them, in columns [m]."""
    radii: Array
    """(n,) of these discs [m]."""
    shapes: Shapes
    """What the discs bound; empty where every obstacle is a disc."""


def solids(obstacles: Obstacles) -> Solids:
    """Planar obstacles as compiled functions need them."""
    centers, radii = obstacles.balls
    shapes = no_shapes()
    if not obstacles.are_discs:
        shapes = make_shapes(obstacles.points, obstacles.starts, obstacles.radii, 0.0)
    return Solids(np.ascontiguousarray(centers.T), radii, shapes)


@lru_cache(maxsize=2)
def surroundings(field: Field, margin: float, narrowest: float) -> Surroundings:
    """Grow a field's obstacles by a margin [m], or by less where that would close a passage.

    Passages narrower than `narrowest` [m] may close. Start and goal stay outside of the grown
    obstacles. Results are cached by the field's identity.

    Raises:
        ValueError: a field that is not planar.
    """
    obstacles = planar_obstacles(field)
    # wider gaps leave room for the whole margin
    widest = margin / _SHARE * (1.0 + 1e-9)
    nearest = least_gaps(*obstacles.balls, obstacles.cores, narrowest, widest)
    room = obstacles.signed_distance(np.stack([field.start, field.goal])).min(axis=0)
    most = np.minimum(_SHARE * nearest, room - OUTSIDE * field.limits.unit)
    margins = np.clip(most, 0.0, margin)
    return Surroundings(margins, DistanceToGoal(replace(field, obstacles=obstacles.grown(margins))))


@compiled
def least_gaps(
    centers: Array, radii: Array, cores: Cores, narrowest: float, widest: float
) -> Array:
    """Width (n,) of the narrowest gap beside each obstacle, of those in a range [m]; or infinity.

    Obstacles are swept in the order of their left ends, so that only those that the same vertical
    line nearly meets are compared. A gap narrower than the range is closed with or without a
    margin.

    Args:
        centers: (n, 2) of the balls that bound the obstacles [m].
        radii: (n,) of the balls [m].
        cores: of the obstacles.
        narrowest: least gap that counts [m].
        widest: greatest gap that matters [m].
    """
    left = centers[:, 0] - radii
    order = np.argsort(left)
    least = np.full(len(radii), np.inf)
    for place in range(len(order)):
        i = order[place]
        for k in range(place + 1, len(order)):
            j = order[k]
            if left[j] > centers[i, 0] + radii[i] + widest:
                break
            dx, dy = centers[i, 0] - centers[j, 0], centers[i, 1] - centers[j, 1]
            apart = np.sqrt(dx * dx + dy * dy)
            radius, other_radius = radii[i], radii[j]
            if len(cores.first) > 0:
                if apart - radius - other_radius > widest:
                    continue
                first, end = cores.first[i], cores.first[i + 1]
                begin, stop = cores.first[j], cores.first[j + 1]
                radius, other_radius = cores.radii[i], cores.radii[j]
                apart = cores_gap(cores.corners, first, end, cores.corners, begin, stop, _PLANE)
            # both orders of subtraction, whose rounding differs
            one, other = apart - radius - other_radius, apart - other_radius - radius
            if narrowest <= one < least[i]:
                least[i] = one
            if narrowest <= other < least[j]:
                least[j] = other
    return least


@compiled
def outside(x: float, y: float, solids: Solids, clearance: float) -> tuple[float, float, bool]:
    """A point outside of all obstacles near a point [m], and whether one was found.

    It moves out of the deepest obstacle by the shortest way, from a disc's centre to the right,
    until no obstacle holds it.

    Args:
        x: of the point.
        y: of the point.
        solids: the obstacles.
        clearance: given to a point that is moved out of an obstacle.
    """
    centers, radii, shapes = solids
    for _ in range(_MAX_MOVES):
        deepest, depth = -1, 0.0
        for k in range(len(radii)):
            dx, dy = x - centers[0, k], y - centers[1, k]
            distance = np.sqrt(dx * dx + dy * dy) - radii[k]
            if distance < depth and not is_disc(shapes, k):
                distance = nearest_feature(shapes, k, x, y).distance - shapes.radii[k]
            if distance < depth:
                deepest, depth = k, distance
        if deepest < 0:
            return x, y, True
        center_x, center_y, radius = centers[0, deepest], centers[1, deepest], radii[deepest]
        if not is_disc(shapes, deepest):
            near, radius = nearest_feature(shapes, deepest, x, y), shapes.radii[deepest]
            corner = shapes.corners[near.corner]
            center_x, center_y = corner.x, corner.y
            if near.is_edge or near.distance == 0.0:
                x, y = x + (clearance - depth) * corner.nx, y + (clearance - depth) * corner.ny
                continue
        dx, dy = x - center_x, y - center_y
        if dx == 0.0 and dy == 0.0:
            dx = 1.0
        longer = (radius + clearance) / np.sqrt(dx * dx + dy * dy)
        x, y = center_x + dx * longer, center_y + dy * longer
    return x, y, False
