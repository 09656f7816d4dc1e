"""The shortest line through a sequence of sides: the funnel algorithm.

Reference:
    Lee & Preparata (1984), Euclidean shortest paths in the presence of rectilinear barriers,
    Networks 14(3).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ferguson_gym.runtime.arrays import Array

_Point = tuple[float, float]


def taut_length(start: Array, sides: Sequence[Array], goal: Array) -> float:
    """The length [m] of the shortest line from start to goal that crosses all sides in turn.

    Args:
        start: (2,) [m].
        sides: ends (2, 2) of each [m], first the one to the right of what crosses it.
        goal: (2,) [m].
    """
    begin, end = (start[0], start[1]), (goal[0], goal[1])
    rights: list[_Point] = [begin, *((side[0, 0], side[0, 1]) for side in sides), end]
    lefts: list[_Point] = [begin, *((side[1, 0], side[1, 1]) for side in sides), end]
    length, apex, at = 0.0, begin, 0
    right = left = 0
    while at < len(rights) - 1:
        at += 1
        if _turn(apex, rights[right], rights[at]) >= 0.0:  # the right side narrows the funnel
            if rights[right] == apex or _turn(apex, lefts[left], rights[at]) < 0.0:
                right = at
            else:  # it crosses the left side, around which the line turns
                length += math.dist(apex, lefts[left])
                apex, at = lefts[left], left
                right = left = at
                rights[at] = lefts[at] = apex
                continue
        if _turn(apex, lefts[left], lefts[at]) <= 0.0:
            if lefts[left] == apex or _turn(apex, rights[right], lefts[at]) > 0.0:
                left = at
            else:
                length += math.dist(apex, rights[right])
                apex, at = rights[right], right
                right = left = at
                rights[at] = lefts[at] = apex
    return length + math.dist(apex, end)


def _turn(apex: _Point, one: _Point, other: _Point) -> float:
    """Above zero where the way from the apex to the other is to the left of that to the one."""
    return (one[0] - apex[0]) * (other[1] - apex[1]) - (one[1] - apex[1]) * (other[0] - apex[0])
