"""The shortest path through a field of discs, and its length, by which others are measured."""

from __future__ import annotations

from ferguson_gym.fields import Field
from ferguson_gym.obstacles import Discs
from planners.distance import DistanceToGo
from planners.pieces import ShortestPath


def shortest_path(field: Field) -> ShortestPath | None:
    """The shortest path from start to goal through no open disc and inside the bounds.

    Exact but for the margin of `planners.tangents`; None if there is no path.

    Raises:
        TypeError: obstacles other than discs in the plane.
    """
    return DistanceToGo(field).path(field.start)


def exact_length(field: Field) -> float | None:
    """Length of the shortest path [m]; None if there is none, or obstacles are no plane discs."""
    if not isinstance(field.obstacles, Discs) or field.obstacles.dimension != 2:
        return None
    path = shortest_path(field)
    return None if path is None else path.length
