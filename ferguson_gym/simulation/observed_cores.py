"""What a vehicle observes of an obstacle whose core is no point: its nearest point, and ranges."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.convex_core import Cores, has_core, nearest_on_core
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled

Ranges: TypeAlias = NDArray[np.float32]
Integers: TypeAlias = NDArray[np.int64]

_CRACK = 4e-7
"""Share of the view by which edges are longer than they are, so that single precision leaves no
crack between two edges through which a ray would pass."""


@compiled
def nearest_outline_point(x: float, y: float, cores: Cores, k: int) -> tuple[float, float, float]:
    """The point of core k's outline that is nearest to a point [m], both coordinates.

    The third number is the signed distance of the point from the grown core [m].
    """
    corners, first, end = cores.corners, cores.first[k], cores.first[k + 1]
    near = nearest_on_core((x, y), corners, first, end, (0, 1))
    corner, share = near.corner, near.share
    after = corner + 1 if corner + 1 < end else first
    at_x, at_y = corners[0, corner], corners[1, corner]
    along_x, along_y = corners[0, after] - at_x, corners[1, after] - at_y
    if near.distance <= 0.0 and share > 0.0:  # inside of a polygon, of which only the edge is known
        share = (x - at_x) * along_x + (y - at_y) * along_y
        share /= along_x * along_x + along_y * along_y
    distance = near.distance - cores.radii[k]
    return at_x + share * along_x, at_y + share * along_y, distance


@compiled
def keep_within(
    view: float, x: float, y: float, cores: Cores, number: int, found: Integers, near: Array
) -> int:
    """Keep those obstacles of which not only the ball is within view of a point; count them.

    Args:
        view: [m].
        x: of the point [m].
        y: of the point [m].
        cores: of the obstacles.
        number: of obstacles whose ball is within view.
        found: their indices first; those of the obstacles that are kept afterwards.
        near: distances of their balls [m]; those of the obstacles that are kept afterwards.
    """
    kept = 0
    for m in range(number):
        k, distance = found[m], near[m]
        stays = True  # a disc, which is its ball
        if has_core(cores, k):
            distance = nearest_outline_point(x, y, cores, k)[2]
            stays = distance < view
        found[kept], near[kept] = k, distance
        kept += stays
    return kept


@compiled
def shorten_by_arc(
    ranges: Ranges, directions: Ranges, ahead: float, left: float, size: float
) -> None:
    """Shorten ranges (R,) [m] along directions (2, R) to a disc with this centre and radius.

    A loop without branches, in single precision, becomes vector instructions; results are of
    single precision anyway.
    """
    zero = np.float32(0.0)
    center_x, center_y, radius = np.float32(ahead), np.float32(left), np.float32(size)
    for j in range(len(ranges)):
        along = directions[0, j] * center_x + directions[1, j] * center_y
        across = directions[0, j] * center_y - directions[1, j] * center_x
        # (r - a)(r + a): r^2 - a^2 would cancel for a disc so large that it is like a wall
        half2 = (radius - across) * (radius + across)
        reach = along - np.sqrt(half2 if half2 > zero else zero)
        reach = reach if reach > zero else zero
        hit = half2 > zero and along > zero and reach < ranges[j]
        ranges[j] = reach if hit else ranges[j]


@compiled
def _shorten_by_edge(
    ranges: Ranges,
    directions: Ranges,
    ahead: float,
    left: float,
    height: float,
    begin: float,
    end: float,
) -> None:
    """Shorten ranges (R,) [m] along directions (2, R) to an edge.

    The edge runs in the direction (ahead, left) and lies to the left of the vehicle by `height`,
    seen along it, from `begin` to `end`, measured from the foot of the perpendicular [m].
    """
    zero, tiny = np.float32(0.0), np.float32(1e-30)
    along_x, along_y, high = np.float32(ahead), np.float32(left), np.float32(height)
    low, top = np.float32(begin), np.float32(end)
    for j in range(len(ranges)):
        toward = along_x * directions[1, j] - along_y * directions[0, j]
        reach = high / (toward if toward > tiny else tiny)
        place = reach * (directions[0, j] * along_x + directions[1, j] * along_y)
        hit = toward > zero and place >= low and place <= top and reach < ranges[j]
        ranges[j] = reach if hit else ranges[j]


@compiled
def shorten_by_core(
    ranges: Ranges,
    directions: Ranges,
    x: float,
    y: float,
    turn: complex,
    view: float,
    cores: Cores,
    k: int,
) -> None:
    """Shorten ranges (R,) [m] along directions (2, R) to obstacle k, from the point (x, y).

    Its boundary consists of the core's edges, moved out by the radius, and of arcs around the
    corners. From within it, as the tolerance allows, ranges into it are zero.

    Args:
        ranges: (R,) [m], changed.
        directions: (2, R) unit vectors in the vehicle's frame.
        x: of the vehicle [m].
        y: of the vehicle [m].
        turn: unit complex number in the direction in which the vehicle is heading.
        view: largest range [m].
        cores: of the obstacles.
        k: index of the obstacle.
    """
    corners, first, end, radius = cores.corners, cores.first[k], cores.first[k + 1], cores.radii[k]
    crack = _CRACK * view
    outside, out_x, out_y = -np.inf, 0.0, 0.0  # signed distance, and the normal there
    before_x = corners[0, first] - corners[0, end - 1]
    before_y = corners[1, first] - corners[1, end - 1]
    size = np.sqrt(before_x * before_x + before_y * before_y)
    before_x, before_y = before_x / size, before_y / size
    at_x, at_y = corners[0, first] - x, corners[1, first] - y
    height_before = at_y * before_x - at_x * before_y - radius
    for corner in range(first, end):
        after = corner + 1 if corner + 1 < end else first
        next_x, next_y = corners[0, after] - x, corners[1, after] - y
        along_x, along_y = next_x - at_x, next_y - at_y
        size = np.sqrt(along_x * along_x + along_y * along_y)
        along_x, along_y = along_x / size, along_y / size
        # the core lies to the left of its edges, the vehicle to the right of those it faces
        height = at_y * along_x - at_x * along_y - radius
        begin = at_x * along_x + at_y * along_y
        away = np.sqrt(at_x * at_x + at_y * at_y)
        if begin <= 0.0 <= begin + size and height > outside:
            outside, out_x, out_y = height, along_y, -along_x
        beside = begin >= 0.0 and at_x * before_x + at_y * before_y <= 0.0
        if beside and away > 0.0 and away - radius > outside:
            outside, out_x, out_y = away - radius, -at_x / away, -at_y / away
        is_seen = height > 0.0 or height_before > 0.0 or (beside and away > radius)
        if radius > 0.0 and is_seen and away - radius < view:
            ahead, left = turn.real * at_x + turn.imag * at_y, turn.real * at_y - turn.imag * at_x
            shorten_by_arc(ranges, directions, ahead, left, radius)
        if 0.0 < height < view and begin < view and begin + size > -view:
            ahead = turn.real * along_x + turn.imag * along_y
            left = turn.real * along_y - turn.imag * along_x
            low, top = max(begin, -view) - crack, min(begin + size, view) + crack
            _shorten_by_edge(ranges, directions, ahead, left, height, low, top)
        at_x, at_y, before_x, before_y, height_before = next_x, next_y, along_x, along_y, height
    if outside <= 0.0:
        ahead = np.float32(turn.real * out_x + turn.imag * out_y)
        left = np.float32(turn.real * out_y - turn.imag * out_x)
        for j in range(len(ranges)):
            inward = directions[0, j] * ahead + directions[1, j] * left < np.float32(0.0)
            ranges[j] = np.float32(0.0) if inward else ranges[j]
