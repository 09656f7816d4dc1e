"""The shortest path through a field, and its length, the reference for all flights."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles


def shortest_path(field: Field) -> ShortestPath | None:
    """The shortest path from start to goal, outside the open obstacles and inside the bounds.

    Exact up to the margin of `ferguson_gym.shortest_paths.scene`; None if there is no path.

    Raises:
        TypeError: a field that is not planar.
    """
    return path_from(field, field.start)


def path_from(field: Field, point: ArrayLike) -> ShortestPath | None:
    """The shortest path from a point (2,) [m] to the goal; None if there is none.

    For many points of one field see `DistanceToGoal`, which says where a point may lie.

    Raises:
        TypeError: a field that is not planar.
        ValueError: a point of another shape, NaN or infinity.
    """
    return DistanceToGoal(field, for_few_queries=True).path(point)


def exact_length(field: Field) -> float | None:
    """Length of the shortest path [m]; None without a path, or in other spaces than the plane.

    The results of the last 4096 fields are cached, by the content of the field.

    Example:
        >>> from ferguson_gym.world.field_names import get_field
        >>> round(exact_length(get_field("paper:2")), 3)
        144.338
    """
    obstacles = field.obstacles
    if obstacles.dimension != 2:
        return None
    cores = (obstacles.points, obstacles.starts, obstacles.radii)
    arrays = (*cores, field.start, field.goal, field.bounds)
    # by content, since every flight that a worker process returns has its own copy of the field
    return _exact_length(*(array.tobytes() for array in arrays))


def reference_length(field: Field) -> float | None:
    """The exact length [m] that flights through a field are compared with.

    None as for `exact_length`, and where it is below the gate: the start is then as good as on the
    goal, and every flight is many times longer.
    """
    length = exact_length(field)
    return None if length is None or length < field.limits.gate else length


def gap(length: float, exact: float) -> float:
    """Relative excess of a length over that of the shortest path: length / exact - 1."""
    return length / exact - 1.0


@lru_cache(maxsize=4096)
def _exact_length(
    points: bytes, first: bytes, radii: bytes, start: bytes, goal: bytes, bounds: bytes
) -> float | None:
    field = Field(
        name="cached copy",
        obstacles=Obstacles(
            np.frombuffer(points).reshape(-1, 2),
            np.frombuffer(radii),
            np.frombuffer(first, np.int64),
        ),
        start=np.frombuffer(start),
        goal=np.frombuffer(goal),
        bounds=np.frombuffer(bounds).reshape(2, 2),
    )
    path = shortest_path(field)
    return None if path is None else path.length
