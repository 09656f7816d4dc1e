"""Initial guesses whose segments follow the turns of a route, found by dynamic programming.

Evenly spaced knots suit routes with few turns. In a slalom, a segment between two of them may have
to follow three turns, which no cubic does. Here the knots lie on a grid along the route, and the
chain is tangent to it; of all these chains the cheapest is found, by length and by depth in
obstacles. Where the state's derivative points away from the route, the first knot may lie beside
it.

Reference:
    Bellman (1961), On the approximation of curves by line segments using dynamic programming,
    Communications of the ACM 4.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Limits, State
from ferguson_gym.world.obstacles import Obstacles
from planners.optimization.knot_costs import (
    DEPTH_PRICE,
    Grid,
    Integers,
    Shapes,
    cheapest,
    costs,
    costs_by_entry,
    entries,
)

_INTERVALS = 6
"""Intervals of the grid in a shortest segment."""
_SPEEDS = 6
"""Number of lengths of derivatives, from the shortest to the longest segment."""
_SEGMENT_PRICE = 0.003
"""Price of a segment, relative to the shortest one."""
_ENTRIES_TRIED = ((DEPTH_PRICE, 0.6, 5), (30.0, 0.6, 5), (100.0, np.pi, 13))
"""Searches for entries, from lenient to strict: price of the depth of the first segment, and
greatest angle [rad] and number of angles to the route. Close to an obstacle, the optimiser can
repair some depths and not others; a segment that heads into it may have to turn on the spot."""
_OFFSETS = np.array([-0.4, -0.2, -0.1, 0.0, 0.1, 0.2, 0.4])
"""Distances of entries from the route, relative to the shortest segment."""
_ENTRY_SPEEDS = 9
"""Number of lengths of derivatives of entries."""
_FASTEST = 3.0
"""Greatest derivative of an entry, relative to the longest segment."""
_BLOCK = 32
"""Number of neighbouring points whose obstacles are looked up together."""
_ENTRIES = 200
"""Number of entries kept."""


def turn_aligned(
    state: State, points: Array, obstacles: Obstacles, limits: Limits, segments: int
) -> Iterator[Array]:
    """Chains (n, 4, 2) along a route whose segments end where it is best to follow its turns.

    Args:
        state: from which the chains start.
        points: (m, 2) of the route [m]; they begin at the state.
        obstacles: which the chains avoid as well as cubics between such knots can.
        limits: of segments; their lengths are kept along the route.
        segments: maximum number n of segments.

    Yields:
        Up to four different chains, which need not be feasible: with all knots on the route, then
        with a first knot that may lie beside it. There are none if the route is shorter than a
        segment or has no chain of so many segments near it.
    """
    grid = _grid(points, obstacles, limits)
    last = len(grid.points) // 2
    if last < grid.few or grid.many < grid.few:
        return
    speeds = np.geomspace(limits.shortest, limits.longest, _SPEEDS)
    most = min(segments, last // grid.few)
    price = _SEGMENT_PRICE * limits.shortest
    # a copy, since a field's start is read-only, which kernels would be compiled for once more
    state = replace(state, derivative=np.array(state.derivative))
    cost = costs(grid, state.derivative, speeds, limits.shortest)
    seen: list[Array] = []
    for search in (None, *_ENTRIES_TRIED):
        entry = np.empty((0, 2, 2))
        second, which = np.full((last + 1, len(speeds)), np.inf), np.zeros((0, 0), np.int64)
        if search is not None:
            entry, second, which = _by_entry(grid, state, obstacles, limits, speeds, *search)
        knots, speed = cheapest(cost, second, grid.few, most, price)
        if len(knots) == 0:
            continue
        where = grid.points[2 * knots]
        slope = speeds[speed, None] * grid.tangents[2 * knots]
        where[0], slope[0] = state.position, state.derivative
        if knots[1] == 0:  # the first knot is an entry
            where[1], slope[1] = entry[which[knots[2], speed[2]]]
        chain = np.stack([where[:-1], where[1:], slope[:-1], slope[1:]], axis=1)
        if not any(np.array_equal(chain, other) for other in seen):
            seen.append(chain)
            yield chain


def _grid(points: Array, obstacles: Obstacles, limits: Limits) -> Grid:
    """Knots and the points halfway between them, on a route (m, 2), with the obstacles nearby."""
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(chords)])
    intervals = max(1, round(float(way[-1]) * _INTERVALS / limits.shortest))
    at = np.linspace(0.0, way[-1], 2 * intervals + 1)
    fine = np.column_stack([np.interp(at, way, axis) for axis in points.T])
    tangent = np.gradient(fine, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1), 1e-12)[:, None]
    interval = max(2.0 * float(at[1]), 1e-9)
    cut = np.linalg.norm(np.diff(fine, axis=0), axis=1)
    return Grid(
        points=fine,
        tangents=tangent,
        way=np.concatenate([[0.0], np.cumsum(cut)]),
        near=_near(fine, obstacles, limits.shortest),
        shapes=Shapes(*obstacles.balls, obstacles.cores),
        few=math.ceil(limits.shortest / interval - 1e-6),
        many=math.floor(limits.longest / interval + 1e-6),
    )


def _near(points: Array, obstacles: Obstacles, reach: float) -> Integers:
    """Obstacles (points, most) at most `reach` [m] from each point, then -1."""
    blocks: list[Integers] = []
    for first in range(0, len(points), _BLOCK):
        block = points[first : first + _BLOCK]
        middle = 0.5 * (block.min(axis=0) + block.max(axis=0))
        far = float(np.linalg.norm(block - middle, axis=1).max())
        around = obstacles.which_near(middle, far + reach)
        close = obstacles.only_these(around).signed_distance(block) <= reach
        number = close.sum(axis=1)
        near = np.full((len(block), int(number.max(initial=0))), -1)
        point, one = np.nonzero(close)
        place = np.arange(len(point)) - np.repeat(np.cumsum(number) - number, number)
        near[point, place] = around[one]
        blocks.append(near)
    most = max(1, *(near.shape[1] for near in blocks))
    out = np.full((len(points), most), -1)
    for k, near in enumerate(blocks):
        out[k * _BLOCK : k * _BLOCK + len(near), : near.shape[1]] = near
    return out


def _by_entry(
    grid: Grid,
    state: State,
    obstacles: Obstacles,
    limits: Limits,
    speeds: Array,
    price: float,
    angle: float,
    angles: int,
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Entries (n, 2, 2), point and derivative; and the cost of two segments by way of the best.

    The cost is that to a knot and a speed, (knots, speeds), followed by the entry's index.
    """
    around = obstacles.which_near(state.position, limits.longest)
    fast = np.geomspace(limits.shortest, _FASTEST * limits.longest, _ENTRY_SPEEDS)
    offsets = limits.shortest * _OFFSETS
    knot, entry, cost = entries(
        grid,
        state.derivative,
        offsets,
        np.linspace(-angle, angle, angles),
        fast,
        np.append(around, -1),
        price,
        limits.shortest,
        limits.longest,
    )
    best = np.argsort(cost, kind="stable")[:_ENTRIES]
    knot, entry, cost = knot[best], entry[best], cost[best]
    second, which = costs_by_entry(grid, knot, entry, cost, speeds, limits.shortest)
    return entry, second, which
