"""What a vehicle observes of an obstacle whose core is no point: its nearest point, and ranges."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.convex_core import Cores, has_core, nearest_on_core, outward_normal
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place

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
    best2, at_x, at_y = np.inf, 0.0, 0.0
    inside = end - first > 2
    off_x, off_y = x - corners[0, end - 1], y - corners[1, end - 1]
    for corner in range(first, end):  # from the last edge on, which ends at the first corner
        next_x, next_y = x - corners[0, corner], y - corners[1, corner]
        edge_x, edge_y = off_x - next_x, off_y - next_y
        apart2 = next_x * next_x + next_y * next_y
        if apart2 < best2:
            best2, at_x, at_y = apart2, next_x, next_y
        beyond = off_x * edge_y - off_y * edge_x
        along, size2 = off_x * edge_x + off_y * edge_y, edge_x * edge_x + edge_y * edge_y
        if 0.0 < along < size2 and beyond * beyond < best2 * size2:
            best2 = beyond * beyond / size2
            at_x, at_y = beyond / size2 * edge_y, -beyond / size2 * edge_x
        inside = inside and beyond <= 0.0
        off_x, off_y = next_x, next_y
    if inside:  # the edge whose line is nearest
        distance = nearest_on_core((x, y), corners, first, end, (0, 1)).distance
    else:
        distance = np.sqrt(best2)
    return x - at_x, y - at_y, distance - cores.radii[k]


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


@compiled_in_place
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
    crack, is_outside = _CRACK * view, False
    before_x = corners[0, first] - corners[0, end - 1]
    before_y = corners[1, first] - corners[1, end - 1]
    at_x, at_y = corners[0, first] - x, corners[1, first] - y
    faced_before = _is_faced(at_x, at_y, before_x, before_y, radius)
    for corner in range(first, end):
        after = corner + 1 if corner + 1 < end else first
        edge_x, edge_y = (
            corners[0, after] - corners[0, corner],
            corners[1, after] - corners[1, corner],
        )
        is_faced = _is_faced(at_x, at_y, edge_x, edge_y, radius)
        along = at_x * edge_x + at_y * edge_y
        if radius > 0.0:
            away = np.sqrt(at_x * at_x + at_y * at_y)
            beside = along >= 0.0 and at_x * before_x + at_y * before_y <= 0.0 and away > radius
            is_outside |= beside
            if (beside or is_faced or faced_before) and away - radius < view:
                ahead = turn.real * at_x + turn.imag * at_y
                left = turn.real * at_y - turn.imag * at_x
                shorten_by_arc(ranges, directions, ahead, left, radius)
        if is_faced:
            is_outside = True
            size = np.sqrt(edge_x * edge_x + edge_y * edge_y)
            height = (at_y * edge_x - at_x * edge_y) / size - radius
            begin = along / size
            if height < view and begin < view and begin + size > -view:
                ahead = (turn.real * edge_x + turn.imag * edge_y) / size
                left = (turn.real * edge_y - turn.imag * edge_x) / size
                low, top = max(begin, -view) - crack, min(begin + size, view) + crack
                _shorten_by_edge(ranges, directions, ahead, left, height, low, top)
        at_x, at_y = corners[0, after] - x, corners[1, after] - y
        before_x, before_y, faced_before = edge_x, edge_y, is_faced
    if not is_outside:
        _shorten_inside(ranges, directions, x, y, turn, cores, k)


@compiled
def _is_faced(at_x: float, at_y: float, edge_x: float, edge_y: float, radius: float) -> bool:
    """Whether a vehicle is outside of an edge that is moved out, from one of its ends there."""
    beyond = at_y * edge_x - at_x * edge_y  # the core lies to the left of its edges
    square = edge_x * edge_x + edge_y * edge_y
    return bool(beyond > 0.0 and beyond * beyond > radius * radius * square)


@compiled
def _shorten_inside(
    ranges: Ranges, directions: Ranges, x: float, y: float, turn: complex, cores: Cores, k: int
) -> None:
    """Shorten to zero those ranges (R,) along which obstacle k is deeper than at (x, y)."""
    first, end = cores.first[k], cores.first[k + 1]
    near, normal = nearest_on_core((x, y), cores.corners, first, end, (0, 1)), np.empty(2)
    outward_normal((x, y), near, cores.corners, first, end, (0, 1), normal)
    ahead = np.float32(turn.real * normal[0] + turn.imag * normal[1])
    left = np.float32(turn.real * normal[1] - turn.imag * normal[0])
    zero = np.float32(0.0)
    for j in range(len(ranges)):
        inward = directions[0, j] * ahead + directions[1, j] * left < zero
        ranges[j] = zero if inward else ranges[j]
