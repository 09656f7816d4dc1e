"""Boundaries of convex obstacles, traversed by the angle of their outward normal, compiled.

An obstacle is the hull of its corners grown by a radius. Going round it counter-clockwise, its
outward normal turns from 0 to a full turn: each corner is an arc on which the normal turns, and
each edge, moved out by the radius, is a straight part on which it does not. A position on the
boundary is therefore an angle. A disc is the case of one corner and no edges.

Each corner has the range of angles that its two edges leave it. Ranges of neighbours are kept apart
by `_STEP`, so that an angle says which end of an edge is meant, with room for a wall in between. No
range begins at angle zero, where angles start again.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, unowned

Integers = NDArray[np.int64]
Records = NDArray[np.void]
"""A structured array."""

TWO_PI = 2.0 * math.pi
_STEP = 2.0**-46
"""Angle between an edge's end and a wall on it [rad]: far above rounding, and far below what a
corner turns by."""
_ROUNDING = 1e-9
"""An angle closer to a full turn than this is a rounded zero [rad]."""

CORNER = np.dtype(
    [
        ("x", np.float64),  # [m]
        ("y", np.float64),
        ("begin", np.float64),  # least angle of the corner's range, increasing [rad]
        ("along", np.float64),  # length of the edges from angle zero to the corner [m]
        ("nx", np.float64),  # unit outward normal of the edge that ends at the corner
        ("ny", np.float64),
        ("size", np.float64),  # length of that edge [m]
    ]
)


class Shapes(NamedTuple):
    """Obstacles as their boundaries; all arrays are empty where every obstacle is a disc."""

    first: Integers
    """(n + 1,) index of the first corner of each obstacle."""
    corners: Records
    """(c,) of CORNER, counter-clockwise."""
    radii: Array
    """(n,) by which obstacles are grown [m]."""
    reach: Array
    """(n,) signed distance from the core below which a point counts as inside [m]."""


class Feature(NamedTuple):
    """What of a core is nearest to a point."""

    distance: float
    """Signed distance from the core [m]."""
    corner: int
    """The nearest corner, or the one where the nearest edge ends."""
    is_edge: bool


@compiled
def no_shapes() -> Shapes:
    """The shapes of a scene in which every obstacle is a disc."""
    return Shapes(np.empty(0, dtype=np.int64), np.empty(0, dtype=CORNER), np.empty(0), np.empty(0))


@compiled
def make_shapes(points: Array, first: Integers, radii: Array, margin: float) -> Shapes:
    """The shapes of obstacles; their reach is the radius less a margin [m].

    Args:
        points: (c, 2) corners, polygons counter-clockwise [m].
        first: (n + 1,) index of the first corner of each.
        radii: (n,) by which cores are grown [m].
        margin: [m].
    """
    corners = np.empty(len(points), dtype=CORNER)
    for k in range(len(radii)):
        begin, number = first[k], first[k + 1] - first[k]
        angles, least = np.zeros(number), 0
        for c in range(number):
            if number == 1:
                break
            before = points[begin + (c - 1) % number]
            ex, ey = points[begin + c, 0] - before[0], points[begin + c, 1] - before[1]
            angle = math.atan2(-ex, ey) % TWO_PI
            if not 4.0 * _STEP <= angle <= TWO_PI - 4.0 * _STEP:
                angle = 4.0 * _STEP
            angles[c] = angle
            least = c if angle < angles[least] else least
        along = 0.0
        for place in range(number):
            c = (least + place) % number
            corner, point = corners[begin + place], points[begin + c]
            before = points[begin + (c - 1) % number]
            ex, ey = point[0] - before[0], point[1] - before[1]
            size = np.sqrt(ex * ex + ey * ey)
            along += size
            corner.x, corner.y, corner.begin, corner.along = point[0], point[1], angles[c], along
            corner.size = size
            corner.nx, corner.ny = (ey / size, -ex / size) if number > 1 else (0.0, 0.0)
    return Shapes(first.copy(), corners, radii.copy(), radii - margin)


@compiled
def only_these(shapes: Shapes, which: Integers) -> Shapes:
    """The obstacles with these indices (m,), in this order."""
    first = np.zeros(len(which) + 1, dtype=np.int64)
    for place, k in enumerate(which):
        first[place + 1] = first[place] + shapes.first[k + 1] - shapes.first[k]
    corners = np.empty(first[-1], dtype=CORNER)
    for place, k in enumerate(which):
        corners[first[place] : first[place + 1]] = shapes.corners[
            shapes.first[k] : shapes.first[k + 1]
        ]
    return Shapes(first, corners, shapes.radii[which], shapes.reach[which])


@compiled
def is_disc(shapes: Shapes, i: int) -> bool:
    """Whether obstacle i is a disc."""
    return len(shapes.first) == 0 or shapes.first[i + 1] - shapes.first[i] == 1


@compiled
def corner_at(shapes: Shapes, i: int, angle: float) -> int:
    """The corner of obstacle i whose range holds a counter-clockwise angle in [0, 2 pi]."""
    shapes = unowned(shapes)  # the caller holds it
    first, end = shapes.first[i], shapes.first[i + 1]
    low, high = first, end
    while low < high:
        middle = (low + high) // 2
        if shapes.corners[middle].begin > angle + 0.5 * _STEP:
            high = middle
        else:
            low = middle + 1
    return int(low - 1 if low > first else end - 1)


@compiled
def next_corner(shapes: Shapes, i: int, corner: int) -> int:
    """The corner of obstacle i behind another one, counter-clockwise."""
    return int(corner + 1 if corner + 1 < shapes.first[i + 1] else shapes.first[i])


@compiled
def last_corner(shapes: Shapes, i: int, corner: int) -> int:
    """The corner of obstacle i before another one, counter-clockwise."""
    return int(corner - 1 if corner > shapes.first[i] else shapes.first[i + 1] - 1)


@compiled
def end_of(shapes: Shapes, i: int, corner: int) -> float:
    """The greatest angle of a corner's range [rad]; below `begin` where zero lies between."""
    return float(shapes.corners[next_corner(shapes, i, corner)].begin - 2.0 * _STEP)


@compiled
def wall_on_edge(shapes: Shapes, corner: int) -> float:
    """The angle that stands for a wall on the edge that ends at a corner [rad]."""
    return float(shapes.corners[corner].begin - _STEP)


@compiled
def within_range(shapes: Shapes, i: int, corner: int, angle: float) -> float:
    """The counter-clockwise angle itself, or the nearer end of a corner's range [rad]."""
    begin, end = shapes.corners[corner].begin, end_of(shapes, i, corner)
    behind, wide = (angle - begin) % TWO_PI, (end - begin) % TWO_PI
    if behind <= wide:
        return angle
    return end if behind - wide < TWO_PI - behind else begin


@compiled
def sweep(before: float, after: float) -> float:
    """Angle from one direction to another, measured upwards [rad]: in [0, 2 pi)."""
    turn = after - before
    return turn if turn >= 0.0 else turn + TWO_PI


@compiled
def perimeter(shapes: Shapes, i: int) -> float:
    """Length of the edges of obstacle i, which is no disc [m]."""
    return float(shapes.corners[shapes.first[i + 1] - 1].along)


@compiled
def passed(shapes: Shapes, track: int, at: float) -> float:
    """Length of the edges of a track from its angle zero to an angle [m]."""
    i, clockwise = track // 2, track % 2 == 1
    angle = TWO_PI - at if clockwise else at
    first, end = shapes.first[i], shapes.first[i + 1]
    length = 0.0
    if angle >= shapes.corners[first].begin - 0.5 * _STEP:
        length = shapes.corners[corner_at(shapes, i, angle)].along
    return shapes.corners[end - 1].along - length if clockwise else length


@compiled
def straight_parts(shapes: Shapes, track: int, before: float, after: float) -> float:
    """Length of the edges that a track passes between two angles in [0, 2 pi] [m]."""
    if is_disc(shapes, track // 2):
        return 0.0
    length: float = passed(shapes, track, after) - passed(shapes, track, before)
    return length if after >= before else length + perimeter(shapes, track // 2)


@compiled
def along_boundary(shapes: Shapes, track: int, at: float, distance: float) -> tuple[float, float]:
    """The point of a track at a distance [m] ahead of an angle in [0, 2 pi)."""
    i, sense = track // 2, 1.0 - 2.0 * (track % 2)
    radius, angle = shapes.radii[i], at if sense > 0.0 else TWO_PI - at
    c = corner_at(shapes, i, angle)
    for _ in range(2 * (shapes.first[i + 1] - shapes.first[i]) + 1):
        corner = shapes.corners[c]
        ahead = end_of(shapes, i, c) if sense > 0.0 else corner.begin
        turn = sense * (ahead - angle) % TWO_PI
        turn = turn if turn < TWO_PI - _ROUNDING else 0.0
        if distance < radius * turn:
            there = angle + sense * distance / radius
            return corner.x + radius * math.cos(there), corner.y + radius * math.sin(there)
        distance -= radius * turn
        other = next_corner(shapes, i, c) if sense > 0.0 else last_corner(shapes, i, c)
        edge = shapes.corners[other if sense > 0.0 else c]
        if distance < edge.size:
            ahead = sense * distance
            return (
                corner.x + radius * edge.nx - ahead * edge.ny,
                corner.y + radius * edge.ny + ahead * edge.nx,
            )
        distance -= edge.size
        c = other
        angle = shapes.corners[c].begin if sense > 0.0 else end_of(shapes, i, c)
    return shapes.corners[c].x, shapes.corners[c].y


@compiled
def nearest_feature(shapes: Shapes, i: int, x: float, y: float) -> Feature:
    """The nearest corner or edge of the core of obstacle i, and the signed distance.

    Inside a polygon it is the edge whose line is nearest.
    """
    shapes = unowned(shapes)  # the caller holds it
    first, end = shapes.first[i], shapes.first[i + 1]
    best, corner, is_edge = np.inf, first, False
    deepest, wall = -np.inf, first
    for c in range(first, end):
        q = shapes.corners[c]
        dx, dy = x - q.x, y - q.y
        square = dx * dx + dy * dy
        if square < best:
            best, corner, is_edge = square, c, False
        if end - first == 1:
            continue
        beyond, along = dx * q.nx + dy * q.ny, dy * q.nx - dx * q.ny
        if beyond > deepest:
            deepest, wall = beyond, c
        if -q.size < along < 0.0 and beyond >= 0.0 and beyond * beyond < best:
            best, corner, is_edge = beyond * beyond, c, True
    if end - first > 2 and deepest <= 0.0:
        return Feature(deepest, wall, True)
    return Feature(np.sqrt(best), corner, is_edge)


@compiled
def enters(x: float, y: float, ux: float, uy: float, length: float, shapes: Shapes, i: int) -> bool:
    """Whether a line from (x, y) in a unit direction has points inside obstacle i."""
    shapes = unowned(shapes)  # the caller holds it
    first, end, reach = shapes.first[i], shapes.first[i + 1], shapes.reach[i]
    low, high, begin, until = np.inf, -np.inf, np.inf, -np.inf
    before = shapes.corners[end - 1]
    side = (before.x - x) * uy - (before.y - y) * ux
    behind = (before.x - x) * ux + (before.y - y) * uy
    for c in range(first, end):
        corner = shapes.corners[c]
        dx, dy = corner.x - x, corner.y - y
        beside, along = dx * uy - dy * ux, dx * ux + dy * uy
        if reach > 0.0:
            beyond = -along if along < 0.0 else max(along - length, 0.0)
            if beside * beside + beyond * beyond < reach * reach:
                return True
        low, high = min(low, beside), max(high, beside)
        if beside == 0.0:
            begin, until = min(begin, along), max(until, along)
        elif beside * side < 0.0:
            cross = (behind * beside - along * side) / (beside - side)
            begin, until = min(begin, cross), max(until, cross)
        side, behind = beside, along
    if low >= reach or high <= -reach:
        return False
    if reach > 0.0:
        # through the core or, without passing a corner or the core, from an end beside an edge
        if begin <= until and begin <= length and until >= 0.0:
            return True
        if nearest_feature(shapes, i, x, y).distance < reach:
            return True
        far = nearest_feature(shapes, i, x + length * ux, y + length * uy)
        return bool(far.distance < reach)
    if length == 0.0:
        return bool(nearest_feature(shapes, i, x, y).distance < reach)
    if begin >= length or until <= 0.0:
        return False
    begin, until = 0.0, length
    for c in range(first, end):
        corner = shapes.corners[c]
        beyond = (x - corner.x) * corner.nx + (y - corner.y) * corner.ny - reach
        slope = ux * corner.nx + uy * corner.ny
        if slope > 0.0:
            until = min(until, -beyond / slope)
        elif slope < 0.0:
            begin = max(begin, -beyond / slope)
        elif beyond >= 0.0:
            return False
    return begin < until
