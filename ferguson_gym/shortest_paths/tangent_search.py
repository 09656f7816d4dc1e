"""The shortest path between two points among many discs: A* on tangents made when it reaches them.

A track is cut into eight sectors, and the tangents that leave a sector are made when the search
first comes there, so that most tangents of a large field are never made. A first search weights
the straight distance that is left by more than one, and soon finds a path that is nearly shortest.
Its length bounds the second search, which is exact: what lies outside of the ellipse with the
start and the goal as foci that paths of this length reach is left out.

Reference:
    Hart, Nilsson & Raphael (1968), A formal basis for the heuristic determination of minimum cost
    paths, IEEE Transactions on Systems Science and Cybernetics 4.
"""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.disc_grid import make_grid
from ferguson_gym.shortest_paths.sector_tangents import EIGHTH, Exit, Site, add_exits, sector_of
from ferguson_gym.shortest_paths.tangent_graph import GOAL, WALL
from ferguson_gym.shortest_paths.tangents import DISC, Scene

_WEIGHT = 2.0
"""Of the straight distance to the goal in the first search."""
_SLACK = 1e-9
"""By how much the second search's bound exceeds the length found, relative to it."""


class Sectors(NamedTuple):
    """Sectors s = 8 track + eighth, (16 (n + 2),)."""

    first: NDArray[np.int32]
    """First exit, -1 where they are not made yet."""
    end: NDArray[np.int32]
    """The exit behind the last one."""


@compiled
def find_route(
    scene: Scene, start: Array, goal: Array, tolerance: float
) -> tuple[float, list[tuple[int, float, float]]]:
    """Length of the shortest path [m] and its turns: track, and angles where they begin and end.

    Without a path, the length is infinite. A start (2,) [m] may lie inside discs or outside the
    bounds by the tolerance [m]; whether it does is not tested.
    """
    site, order = _make_site(scene, start, goal, tolerance)
    number = 16 * (len(order) + 2)
    sectors = Sectors(np.full(number, -1, dtype=np.int32), np.zeros(number, dtype=np.int32))
    exits = [Exit(0.0, 0, 0.0, 0.0, 0.0) for _ in range(0)]
    turns = [(0, 0.0, 0.0) for _ in range(0)]
    length, last, came = _search(site, sectors, exits, _WEIGHT, np.inf)
    if length == np.inf:
        return length, turns
    bound = length * (1.0 + _SLACK)
    length, last, came = _search(_within(site, bound), sectors, exits, 1.0, bound)
    while came[last] >= 0:
        before = exits[came[last]]
        track = 2 * order[before.other // 2] + before.other % 2
        turns.append((track, before.there, exits[last].angle))
        last = came[last]
    return length, turns[::-1]


@compiled
def _make_site(
    scene: Scene, start: Array, goal: Array, tolerance: float
) -> tuple[Site, NDArray[np.int64]]:
    """The site of a search, and the scene's disc for each of its discs."""
    n, box = len(scene.discs), scene.box
    size = math.sqrt((box[1, 0] - box[0, 0]) * (box[1, 1] - box[0, 1]) / (n + 1))
    # neighbours in the plane are neighbours in memory
    columns = np.floor((scene.discs["x"] - box[0, 0]) / size)
    order = np.argsort(columns * (box[1, 1] - box[0, 1]) + (scene.discs["y"] - box[0, 1]))
    discs = np.empty(n + 2, dtype=DISC)
    for k in range(n):
        discs[k] = scene.discs[order[k]]
    for k, point in ((n, goal), (n + 1, start)):
        discs[k].x, discs[k].y, discs[k].radius, discs[k].reach = point[0], point[1], 0.0, -1.0
    grid = make_grid(discs[: n + 1], box, size, max(scene.margin, tolerance))
    stamp, dead = np.full(n + 2, -1), np.zeros(grid.columns * grid.rows, dtype=np.bool_)
    return Site(discs, grid, box, scene.margin, stamp, dead), order


@compiled
def _within(site: Site, bound: float) -> Site:
    """A site without the cells that no path from start to goal of a length reaches [m]."""
    grid, discs = site.grid, site.discs
    goal, start = discs[len(discs) - 2], discs[len(discs) - 1]
    across = math.sqrt(2.0) * grid.size
    dead = np.empty(len(site.dead), dtype=np.bool_)
    for column in range(grid.columns):
        x = grid.x + grid.size * (column + 0.5)
        for row in range(grid.rows):
            y = grid.y + grid.size * (row + 0.5)
            least = np.hypot(x - start.x, y - start.y) + np.hypot(x - goal.x, y - goal.y) - across
            dead[column * grid.rows + row] = least > bound
    return Site(discs, grid, site.box, site.margin, site.stamp, dead)


@compiled
def _search(
    site: Site, sectors: Sectors, exits: list[Exit], weight: float, bound: float
) -> tuple[float, int, NDArray[np.int32]]:
    """Search for a path no longer than a bound [m].

    Returns:
        Length of the path [m], infinite without one, its last exit, and for each exit the one by
        which the path to it came to the track, -1 from the start.
    """
    discs = site.discs
    n = len(discs) - 2
    # length of the path to where each exit leaves its track [m]
    way = np.full(max(1024, len(exits)), np.inf)
    came = np.full(len(way), -1, dtype=np.int32)
    # the same for where each sector begins
    entry = np.full(len(sectors.first), np.inf)
    entered = np.full(len(entry), -1, dtype=np.int32)
    mark = site.stamp.max() + 1
    # f, length of the path, and where it ends: at an exit's end or, below zero, where sector
    # -1 - code begins; the start is a track of radius zero
    begin = 16 * (n + 1)
    entry[begin] = 0.0
    heap = [(0.0, 0.0, -1 - begin)]
    while len(heap) > 0:
        _, length, code = heapq.heappop(heap)
        if code >= 0:
            reached = exits[code]
            if length > way[code] + reached.line:
                continue
            if reached.other == GOAL:
                return length, code, came
            track, at, origin = reached.other, reached.there, code
            sector = 8 * track + sector_of(at)
        else:
            sector = -1 - code
            if length > entry[sector]:
                continue
            track, at, origin = sector // 8, (sector % 8) * EIGHTH, int(entered[sector])
        if sectors.first[sector] < 0:
            sectors.first[sector] = len(exits)
            add_exits(site, track, sector % 8, bound, mark, exits)
            mark += 2
            sectors.end[sector] = len(exits)
            while len(exits) > len(way):
                way = np.append(way, np.full(len(way), np.inf))
                came = np.append(came, np.full(len(came), -1, dtype=np.int32))
        disc = discs[track // 2]
        leave, end = _following(exits, sectors.first[sector], sectors.end[sector], at)
        while leave < end:
            reached = exits[leave]
            there = length + disc.radius * (reached.angle - at)
            # a path that came to this exit before, and is no longer, goes on like this one
            if reached.other == WALL or there >= way[leave]:
                break
            way[leave], came[leave] = there, origin
            there += reached.line
            if there + reached.ahead <= bound:
                heapq.heappush(heap, (there + weight * reached.ahead, there, leave))
            leave += 1
        if leave < end:
            continue
        # on to the next sector
        until = (sector % 8 + 1) * EIGHTH
        there = length + disc.radius * (until - at)
        following = 8 * track + (sector + 1) % 8
        if there < entry[following]:
            entry[following], entered[following] = there, origin
            sense = 1.0 - 2.0 * (track % 2)
            x = disc.x + disc.radius * math.cos(until)
            y = disc.y + sense * disc.radius * math.sin(until)
            ahead = np.hypot(discs[n].x - x, discs[n].y - y)
            if there + ahead <= bound:
                heapq.heappush(heap, (there + weight * ahead, there, -1 - following))
    return np.inf, -1, came


@compiled
def _following(exits: list[Exit], low: int, end: int, at: float) -> tuple[int, int]:
    """The first exit of a sector at an angle or behind it, and the sector's end."""
    high = end
    while low < high:
        middle = (low + high) // 2
        if exits[middle].angle < at:
            low = middle + 1
        else:
            high = middle
    return low, end
