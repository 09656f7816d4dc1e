"""Line of sight: whether straight lines through a field are clear of obstacles of every shape."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.curves.convex_core import nearest_on_core
from ferguson_gym.curves.core_pairs import boundaries_apart
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.scene import MARGIN, scene
from ferguson_gym.world.field import Field, planar_obstacles

PLANE = (0, 1)
"""The axes, for compiled functions."""
Records = NDArray[np.void]
"""An array of BARRIER."""

BARRIER = np.dtype(
    [
        ("x", np.float64),  # centre of a ball around the core [m]
        ("y", np.float64),
        ("core", np.float64),  # radius of that ball [m], 0 for a disc
        ("radius", np.float64),  # by which the core is grown [m]
        ("reach", np.float64),  # signed distance from the core below which a point is inside [m]
        ("first", np.int64),  # corners of the core; none for a disc, whose core is the centre
        ("end", np.int64),
    ]
)


class Barriers(NamedTuple):
    """The obstacles that lines must avoid."""

    obstacles: Records
    """(n,)."""
    corners: Array
    """(2, c) of their cores [m]."""


class Sight(NamedTuple):
    """What lines must avoid."""

    barriers: Barriers
    box: Array
    """(2, 2) lower and upper bounds of the coordinates [m]."""
    margin: float
    """Of shortest paths [m], by which lines may cut into obstacles and leave the bounds."""
    kept: NDArray[np.int64]
    """(n,) which of the field's obstacles these are: not those outside the bounds, nor discs within
    other discs."""


def sight(field: Field) -> Sight:
    """What lines must avoid without touching it, not even by the margin.

    Raises:
        ValueError: a field that is not planar.
    """
    obstacles, (low, high) = planar_obstacles(field), field.bounds
    centers, radii = obstacles.balls
    if obstacles.are_discs:
        world, kept = scene(field)
        margin = world.margin
    else:
        beyond = np.maximum(np.maximum(low - centers, centers - high), 0.0)
        kept = np.flatnonzero(np.linalg.norm(beyond, axis=1) < radii)
        far = max((np.abs(centers).max(axis=1) + radii).max(), np.abs(field.bounds).max())
        margin = MARGIN * float((high - low).max()) + 1e-14 * float(far)
    records = np.zeros(len(kept), BARRIER)
    records["x"], records["y"] = centers[kept].T
    records["radius"] = records["reach"] = obstacles.radii[kept]
    records["core"] = radii[kept] - obstacles.radii[kept]
    if not obstacles.are_discs:
        records["first"], records["end"] = obstacles.starts[:-1][kept], obstacles.starts[1:][kept]
    barriers = Barriers(records, obstacles.cores.corners)
    return Sight(barriers, field.bounds, margin, kept)


def sight_from(field: Field, position: Array) -> Sight | None:
    """What lines from a vehicle must avoid; None if the vehicle itself collides.

    The vehicle (2,) may violate obstacles or bounds by at most the field's tolerance; then lines
    from it may violate them by the same amount, since a flight may touch obstacles and must be able
    to leave them.

    Raises:
        ValueError: a field that is not planar.
    """
    barriers, (low, high), margin, kept = sight(field)
    tolerance = field.limits.tolerance
    if (position < low - tolerance).any() or (position > high + tolerance).any():
        return None
    obstacles, distance = barriers.obstacles, core_distances(barriers, *position.tolist())
    if (distance < obstacles["radius"] - tolerance).any():
        return None
    touched = distance < obstacles["radius"]
    reach = obstacles["radius"] - margin
    obstacles["reach"] = np.where(touched, np.minimum(reach, distance - margin), reach)
    box = np.stack([np.minimum(low - margin, position), np.maximum(high + margin, position)])
    return Sight(barriers, box, margin, kept)


def lines_clear(around: Sight, starts: ArrayLike, ends: ArrayLike) -> NDArray[np.bool_]:
    """Whether straight lines enter no obstacle and stay inside the bounds: (n,).

    Starts and ends are (n, 2) each, or (2,) for all lines [m]; a line may have length zero. Exact
    up to the margin of `ferguson_gym.shortest_paths.scene`, as shortest paths are.
    """
    lines = np.array(np.broadcast_arrays(np.atleast_2d(starts), np.atleast_2d(ends)), np.float64)
    return _are_clear(around, lines[0], lines[1])


@compiled
def core_distances(barriers: Barriers, x: float, y: float) -> Array:
    """Signed distance of a point from each core (n,) [m]."""
    point, distance = np.array([x, y]), np.empty(len(barriers.obstacles))
    for k in range(len(distance)):
        one = barriers.obstacles[k]
        if one.first == one.end:
            distance[k] = np.sqrt((one.x - x) ** 2 + (one.y - y) ** 2)
        else:
            near = nearest_on_core(point, barriers.corners, one.first, one.end, PLANE)
            distance[k] = near.distance
    return distance


@compiled
def _are_clear(around: Sight, starts: Array, ends: Array) -> NDArray[np.bool_]:
    box = around.box
    clear = np.zeros(len(starts), dtype=np.bool_)
    for k in range(len(starts)):
        x, y = starts[k]
        end_x, end_y = ends[k]
        inside = box[0, 0] <= min(x, end_x) and max(x, end_x) <= box[1, 0]
        inside = inside and box[0, 1] <= min(y, end_y) and max(y, end_y) <= box[1, 1]
        clear[k] = inside and keeps_clear(
            x, y, end_x, end_y, around.barriers.obstacles, around.barriers.corners
        )
    return clear


@compiled
def keeps_clear(
    x: float, y: float, end_x: float, end_y: float, obstacles: Records, corners: Array
) -> bool:
    """Whether no point of a line from (x, y) is within reach of the core of an obstacle.

    A line of length zero is a point. The last two arguments are those of `Barriers`, apart because
    compiled functions take arrays faster.
    """
    dx, dy = end_x - x, end_y - y
    length = np.sqrt(dx * dx + dy * dy)
    ux, uy = (dx / length, dy / length) if length > 0.0 else (1.0, 0.0)
    for k in range(len(obstacles)):
        one = obstacles[k]
        around = one.core + one.reach
        off_x, off_y = one.x - x, one.y - y
        beside = off_x * uy - off_y * ux
        if abs(beside) >= around:
            continue
        along = off_x * ux + off_y * uy
        beyond = -along if along < 0.0 else max(along - length, 0.0)
        if beside * beside + beyond * beyond < around * around:
            if one.first == one.end:
                return False
            if _meets(x, y, end_x, end_y, corners, one.first, one.end, one.reach):
                return False
    return True


@compiled
def _meets(
    x: float,
    y: float,
    end_x: float,
    end_y: float,
    corners: Array,
    first: int,
    end: int,
    reach: float,
) -> bool:
    """Whether a point of a line has a signed distance below `reach` [m] from a core."""
    if end - first > 2:
        # the part of the line inside the polygon, at least as deep as a negative reach asks for
        depth, low, high = max(-reach, 0.0), 0.0, 1.0
        for k in range(first, end):
            after = k + 1 if k + 1 < end else first
            ex, ey = corners[0, after] - corners[0, k], corners[1, after] - corners[1, k]
            size = np.sqrt(ex * ex + ey * ey)
            left = ((x - corners[0, k]) * ey - (y - corners[1, k]) * ex) / size + depth
            right = ((end_x - corners[0, k]) * ey - (end_y - corners[1, k]) * ex) / size + depth
            if left >= 0.0 and right >= 0.0:
                high = -1.0
            elif left >= 0.0:
                low = max(low, left / (left - right))
            elif right >= 0.0:
                high = min(high, left / (left - right))
        if low < high:
            return True
    if reach <= 0.0:
        return False
    line = np.array([[x, end_x], [y, end_y]])
    return boundaries_apart(line, 0, 2, corners, first, end, PLANE) < reach
