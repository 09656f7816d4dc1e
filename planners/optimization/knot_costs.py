"""Costs of segments between knots on a route, and the cheapest chain of them, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.convex_core import Cores, nearest_on_core
from ferguson_gym.curves.core_crossings import crosses, line_exit
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, unowned

Integers = NDArray[np.int64]

DEPTH_PRICE = 2.0
"""Price of the greatest depth of a segment in obstacles, relative to its length."""
_DEEP_PRICE = 60.0
"""Price of the square of that depth, relative to the length and the shortest segment."""
_WORST, _WORST_START = 0.3, 6.0
"""Costs of a segment, relative to the shortest one, beyond which it is not used: of any, and of
those at the start, whose derivative may point away from the route."""
_SLOWEST, _FASTEST = 0.5, 1.8
"""Bounds on the lengths of derivatives, relative to the length of their segment."""


class Shapes(NamedTuple):
    """Obstacles."""

    centers: Array
    """(n, 2) of balls that contain them; discs are these [m]."""
    radii: Array
    """(n,) of the balls [m]."""
    cores: Cores
    """Empty if all are discs."""


class Grid(NamedTuple):
    """Knots on a route and the points halfway between them: point 2 k is knot k."""

    points: Array
    """(2 knots - 1, 2) [m]."""
    tangents: Array
    """(2 knots - 1, 2) unit vectors."""
    way: Array
    """(2 knots - 1,) length of the chords up to each point [m]."""
    near: Integers
    """(2 knots - 1, most) obstacles near each point, then -1."""
    shapes: Shapes
    """The obstacles."""
    few: int
    """Intervals between knots in a shortest segment."""
    many: int
    """Intervals in a longest segment."""


@compiled
def _cost(
    start: Array,
    end: Array,
    leave: Array,
    arrive: Array,
    near: Integers,
    shapes: Shapes,
    samples: int,
    route: float,
    depth_price: float,
    shortest: float,
    worst: float,
    longest: float,
) -> float:
    """Length of a segment beyond the route's [m] and the price of its depth.

    Infinite if it is too high, or if the segment is longer than `longest` or, with that finite,
    shorter than `shortest`.

    near (samples + 1, most) are obstacles at each parameter, or (1, most) the same at all.
    """
    length, depth, deep, worst = 0.0, 0.0, _DEEP_PRICE / shortest, worst * shortest
    before_x, before_y, shaped = start[0], start[1], len(shapes.cores.first) > 0
    for sample in range(1, samples + 1):
        t = sample / samples
        blend = t * t * (3.0 - 2.0 * t)
        first, last = t * (1.0 - t) * (1.0 - t), t * t * (t - 1.0)
        x = start[0] + blend * (end[0] - start[0]) + first * leave[0] + last * arrive[0]
        y = start[1] + blend * (end[1] - start[1]) + first * leave[1] + last * arrive[1]
        step = np.sqrt((x - before_x) ** 2 + (y - before_y) ** 2)
        length += step
        row = sample if len(near) > 1 else 0
        for k in range(near.shape[1]):
            one = near[row, k]
            if one < 0:
                break
            radius = shapes.radii[one]
            dx, dy = x - shapes.centers[one, 0], y - shapes.centers[one, 1]
            square = dx * dx + dy * dy
            if shaped and shapes.cores.first[one + 1] - shapes.cores.first[one] > 1:
                if square < (radius + step) ** 2:
                    within = _depth(before_x, before_y, x, y, shapes.cores, one)
                    depth = max(depth, within)
            elif square < radius * radius:
                depth = max(depth, radius - np.sqrt(square))
        before_x, before_y = x, y
        if depth * (depth_price + deep * depth) > worst:
            return np.inf
    if longest < np.inf and not shortest <= length <= longest:
        return np.inf
    cost = max(0.0, length - route) + depth * (depth_price + deep * depth)
    return cost if cost <= worst else np.inf


@compiled
def _depth(before_x: float, before_y: float, x: float, y: float, cores: Cores, one: int) -> float:
    """Depth of a line in the core that it crosses, or of its second end in the obstacle [m]."""
    first, end, radius = cores.first[one], cores.first[one + 1], cores.radii[one]
    vx, vy = x - before_x, y - before_y
    if vx * vx + vy * vy > 0.0 and crosses(before_x, before_y, vx, vy, cores.corners, first, end):
        return float(radius + line_exit(x, y, vx, vy, cores.corners, first, end).depth)
    if radius == 0.0:
        return 0.0
    point = np.array([x, y])
    return float(radius - nearest_on_core(point, cores.corners, first, end, (0, 1)).distance)


@compiled
def costs(grid: Grid, departure: Array, speeds: Array, shortest: float) -> Array:
    """Costs (knots, widths, speeds, speeds) [m] of segments that start at each knot.

    The second index counts their intervals, from `few`; the others are the speeds, lengths of
    derivatives, at start and end. Knot 0 has the derivative `departure`, listed as speed 0.
    """
    grid = unowned(grid)  # the caller holds it
    points, tangents, near = grid.points, grid.tangents, grid.near
    knots, number = (len(points) + 1) // 2, len(speeds)
    cost = np.full((knots, grid.many - grid.few + 1, number, number), np.inf)
    leave, arrive = np.empty(2), np.empty(2)
    for i in range(knots):
        for wide in range(grid.few, min(grid.many, knots - 1 - i) + 1):
            j = i + wide
            length = grid.way[2 * j] - grid.way[2 * i]
            for a in range(1 if i == 0 else number):
                if i == 0:
                    leave[:] = departure
                elif _SLOWEST * length <= speeds[a] <= _FASTEST * length:
                    leave[:] = speeds[a] * tangents[2 * i]
                else:
                    continue
                for b in range(number):
                    if not _SLOWEST * length <= speeds[b] <= _FASTEST * length:
                        continue
                    arrive[:] = speeds[b] * tangents[2 * j]
                    cost[i, wide - grid.few, a, b] = _cost(
                        points[2 * i],
                        points[2 * j],
                        leave,
                        arrive,
                        near[2 * i : 2 * j + 1],
                        grid.shapes,
                        2 * wide,
                        length,
                        DEPTH_PRICE,
                        shortest,
                        _WORST_START if i == 0 else _WORST,
                        np.inf,
                    )
    return cost


@compiled
def entries(
    grid: Grid,
    departure: Array,
    offsets: Array,
    angles: Array,
    speeds: Array,
    local: Integers,
    depth_price: float,
    shortest: float,
    longest: float,
) -> tuple[Integers, Array, Array]:
    """First knots beside a route: the knot beside which each lies, the entry and its cost [m].

    Entries (n, 2, 2) are points, at all distances `offsets` [m] to the left, and derivatives, at
    all `angles` [rad] to the route and of all `speeds`. local (m,) are the obstacles around, and
    then -1.
    """
    grid = unowned(grid)  # the caller holds it
    points, last = grid.points, min(grid.many, len(grid.points) // 2)
    room = (last + 1) * len(offsets) * len(angles) * len(speeds)
    knot, entry, cost = np.empty(room, np.int64), np.empty((room, 2, 2)), np.empty(room)
    count, end, arrive, around = 0, np.empty(2), np.empty(2), local.reshape(1, -1)
    for j in range(last + 1):
        ux, uy = grid.tangents[2 * j]
        for offset in offsets:
            end[0], end[1] = points[2 * j, 0] - offset * uy, points[2 * j, 1] + offset * ux
            for angle in angles:
                along, across = np.cos(angle), np.sin(angle)
                for speed in speeds:
                    arrive[0] = speed * (along * ux - across * uy)
                    arrive[1] = speed * (across * ux + along * uy)
                    found = _cost(
                        points[0],
                        end,
                        departure,
                        arrive,
                        around,
                        grid.shapes,
                        max(2 * j, 2 * grid.few),
                        grid.way[2 * j],
                        depth_price,
                        shortest,
                        _WORST_START,
                        longest,
                    )
                    if found < np.inf:
                        knot[count], cost[count] = j, found
                        entry[count, 0], entry[count, 1] = end, arrive
                        count += 1
    return knot[:count], entry[:count], cost[:count]


@compiled
def costs_by_entry(
    grid: Grid, knot: Integers, entry: Array, cost: Array, speeds: Array, shortest: float
) -> tuple[Array, Integers]:
    """Least costs (knots, speeds) [m] of two segments by way of an entry, and which it is."""
    grid = unowned(grid)  # the caller holds it
    points, tangents, near = grid.points, grid.tangents, grid.near
    knots = (len(points) + 1) // 2
    best = np.full((knots, len(speeds)), np.inf)
    which = np.zeros((knots, len(speeds)), np.int64)
    arrive = np.empty(2)
    for e in range(len(knot)):
        i = knot[e]
        for j in range(i + grid.few, min(i + grid.many, knots - 1) + 1):
            length = grid.way[2 * j] - grid.way[2 * i]
            for b in range(len(speeds)):
                if best[j, b] <= cost[e]:
                    continue
                if not _SLOWEST * length <= speeds[b] <= _FASTEST * length:
                    continue
                arrive[:] = speeds[b] * tangents[2 * j]
                total = cost[e] + _cost(
                    entry[e, 0],
                    points[2 * j],
                    entry[e, 1],
                    arrive,
                    near[2 * i : 2 * j + 1],
                    grid.shapes,
                    2 * (j - i),
                    length,
                    DEPTH_PRICE,
                    shortest,
                    _WORST_START,
                    np.inf,
                )
                if total < best[j, b]:
                    best[j, b], which[j, b] = total, e
    return best, which


@compiled
def cheapest(
    cost: Array, second: Array, few: int, segments: int, price: float
) -> tuple[Integers, Integers]:
    """Knots and speeds (n + 1,) of the cheapest chain to the last knot; empty if there is none.

    Args:
        cost: (knots, widths, speeds, speeds) of segments [m], as from `costs`.
        second: (knots, speeds) cost of two first segments by way of an entry [m]; where they are
            used, the knot 0 stands for the entry.
        few: intervals of the first of the widths.
        segments: maximum number of segments n.
        price: of each segment [m].
    """
    knots, widths, number, _ = cost.shape
    best = np.full((segments + 1, knots, number), np.inf)
    before = np.zeros((segments + 1, knots, number, 2), np.int64)
    best[0, 0, 0] = 0.0
    for layer in range(segments):
        for i in range(knots):
            for a in range(number):
                so_far = best[layer, i, a] + price
                if so_far == np.inf:
                    continue
                for wide in range(min(widths, knots - i - few)):
                    j = i + few + wide
                    for b in range(number):
                        total = so_far + cost[i, wide, a, b]
                        if total < best[layer + 1, j, b]:
                            best[layer + 1, j, b] = total
                            before[layer + 1, j, b, 0], before[layer + 1, j, b, 1] = i, a
        if layer == 1:
            for i in range(knots):
                for a in range(number):
                    total = second[i, a] + 2.0 * price
                    if total < best[2, i, a]:
                        best[2, i, a] = total
                        before[2, i, a, 0], before[2, i, a, 1] = 0, 0
    layer, speed, least = 0, 0, np.inf
    for count in range(1, segments + 1):
        for b in range(number):
            if best[count, knots - 1, b] < least:
                least, layer, speed = best[count, knots - 1, b], count, b
    where, speeds = np.empty(layer + 1, np.int64), np.empty(layer + 1, np.int64)
    knot = knots - 1
    for count in range(layer, -1, -1):
        where[count], speeds[count] = knot, speed
        knot, speed = before[count, knot, speed, 0], before[count, knot, speed, 1]
    return (where, speeds) if layer > 0 else (where[:0], speeds[:0])
