"""Margins by which discs are grown, so that the shortest path among them keeps a distance.

A margin is less where the whole one would close a passage.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.world.field import Field, planar_discs

OUTSIDE = 1e-7
"""Clearance given to a point that is moved out of a grown disc [units of the field]."""
_SHARE = 0.45
"""Share of a gap by which each of its two discs may be grown."""
_MAX_MOVES = 8
"""Maximum number of moves of a point out of grown discs that overlap."""


class Surroundings(NamedTuple):
    """A field whose discs are grown by their margins."""

    margins: Array
    """(n,) by which each disc is grown [m]."""
    togo: DistanceToGoal
    """The distance to the goal among the grown discs."""


@lru_cache(maxsize=2)
def surroundings(field: Field, margin: float, narrowest: float) -> Surroundings:
    """Grow a field's discs by a margin [m], or by less where that would close a passage.

    Passages narrower than `narrowest` [m] may close. Start and goal stay outside of the grown
    discs. Results are cached by the field's identity.

    Raises:
        TypeError: obstacles other than discs.
        ValueError: a field that is not planar.
    """
    discs = planar_discs(field)
    # wider gaps leave room for the whole margin
    nearest = least_gaps(discs.centers, discs.radii, narrowest, margin / _SHARE * (1.0 + 1e-9))
    room = discs.signed_distance(np.stack([field.start, field.goal])).min(axis=0)
    most = np.minimum(_SHARE * nearest, room - OUTSIDE * field.limits.unit)
    margins = np.clip(most, 0.0, margin)
    return Surroundings(margins, DistanceToGoal(replace(field, obstacles=discs.grown(margins))))


@compiled
def least_gaps(centers: Array, radii: Array, narrowest: float, widest: float) -> Array:
    """Width (n,) of the narrowest gap beside each disc, of those in a range [m]; or infinity.

    Discs are swept in the order of their left ends, so that only those that the same vertical line
    nearly meets are compared. A gap narrower than the range is closed with or without a margin.
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
            # both orders of subtraction, whose rounding differs
            one, other = apart - radii[i] - radii[j], apart - radii[j] - radii[i]
            if narrowest <= one < least[i]:
                least[i] = one
            if narrowest <= other < least[j]:
                least[j] = other
    return least


@compiled
def outside(
    x: float, y: float, centers: Array, radii: Array, clearance: float
) -> tuple[float, float, bool]:
    """A point outside of all discs near a point [m], and whether one was found.

    It moves away from the centre of the deepest disc, from the centre itself to the right, until no
    disc holds it.

    Args:
        x: of the point.
        y: of the point.
        centers: (2, n) of the discs, in columns.
        radii: (n,) of the discs.
        clearance: given to a point that is moved out of a disc.
    """
    for _ in range(_MAX_MOVES):
        deepest, depth = -1, 0.0
        for k in range(len(radii)):
            dx, dy = x - centers[0, k], y - centers[1, k]
            distance = np.sqrt(dx * dx + dy * dy) - radii[k]
            if distance < depth:
                deepest, depth = k, distance
        if deepest < 0:
            return x, y, True
        dx, dy = x - centers[0, deepest], y - centers[1, deepest]
        if dx == 0.0 and dy == 0.0:
            dx = 1.0
        longer = (radii[deepest] + clearance) / np.sqrt(dx * dx + dy * dy)
        x, y = centers[0, deepest] + dx * longer, centers[1, deepest] + dy * longer
    return x, y, False
