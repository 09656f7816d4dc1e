"""The search from the goal among many discs, which is kept and continued for each query.

A* runs from the goal towards the point asked for and ends when no shorter path to that point can
be found. What it settled on the way are distances from the goal that hold for every point, since
the straight distance to a point is a consistent estimate. The next query, from another point, gives
the open ends of the search new estimates and goes on. So tangents are made where some query needed
them, and obstacles far from all shortest paths cost nothing.

A path to the goal is the path from the goal in reverse: the track that it follows is followed in
the other sense, and angles change sign.

Reference:
    Hart, Nilsson & Raphael (1968), A formal basis for the heuristic determination of minimum cost
    paths, IEEE Transactions on Systems Science and Cybernetics 4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.goal_search.disc_grid import make_grid
from ferguson_gym.shortest_paths.goal_search.sector_tangents import (
    EIGHTH,
    Exit,
    Site,
    add_exits,
    sector_of,
)
from ferguson_gym.shortest_paths.scene import DISC, Scene
from ferguson_gym.shortest_paths.shapes import TWO_PI, Integers, Records
from ferguson_gym.shortest_paths.tangent_graph import GOAL, WALL

_UNSETTLED = -2
"""The arrival of an exit whose end is not settled."""

_EXIT = np.dtype(
    [
        ("angle", np.float64),  # as those of `Exit`
        ("there", np.float64),
        ("line", np.float64),
        ("x", np.float64),
        ("y", np.float64),
        ("way", np.float64),  # length of the path from the goal to where the exit leaves [m]
        ("other", np.int32),
        ("came", np.int32),  # exit by which that path came to the track, -1 for the goal
        ("arrival", np.int32),  # the sector's arrival before this one, -1 for none, or _UNSETTLED
    ]
)
_SECTOR = np.dtype(
    [
        ("entry", np.float64),  # length of the path from the goal to where the sector begins [m]
        ("entered", np.int32),  # exit by which that path came to the track
        ("first", np.int32),  # first exit, -1 where they are not made yet
        ("end", np.int32),  # the exit behind the last one
        ("arrived", np.int32),  # the latest exit that ends here, -1 for none
    ]
)

_OPEN = np.dtype(
    [
        ("bound", np.float64),  # lower bound on the length of a path that goes on here [m]
        ("length", np.float64),  # length of the path so far [m]
        ("code", np.int64),  # an exit whose end is reached or, below zero, -1 - sector
    ]
)


class GoalSearch(NamedTuple):
    """A search from the goal, as far as it has come."""

    site: Site
    """The discs, the goal, and the point of the latest query."""
    sectors: Records
    """(16 (n + 2),) of _SECTOR; sector s = 8 track + eighth."""
    exits: Records
    """Array of _EXIT; the first `sizes[0]` are in use."""
    open: Records
    """Heap of _OPEN; the first `sizes[1]` are in use."""
    sizes: Integers
    """(3,) numbers of exits and of open ends, and the next stamp."""
    anchor: Array
    """(2,) the point for which the open ends have estimates [m]."""
    latest: Array
    """(3,) latest point from which a path was found, and its length, infinite before [m]."""
    seen: NDArray[np.int32]
    """(2 (n + 2),) scratch, -1: the line of the present query that touches a track."""


@compiled
def begin_search(scene: Scene, goal: Array, tolerance: float) -> tuple[GoalSearch, Integers]:
    """A search that has settled nothing yet, and the scene's disc for each of its discs.

    The tolerance [m] is that by which points may lie inside discs or outside the bounds.
    """
    site, order = _make_site(scene, goal, tolerance)
    n = len(order)
    sectors = np.empty(16 * (n + 2), dtype=_SECTOR)
    for s in range(len(sectors)):
        sectors[s].entry, sectors[s].entered, sectors[s].arrived = np.inf, -1, -1
        sectors[s].first, sectors[s].end = -1, -1
    begin = 16 * n
    sectors[begin].entry = 0.0
    opened, sizes = np.empty(1024, dtype=_OPEN), np.array([0, 1, 0])
    opened[0].bound, opened[0].length, opened[0].code = 0.0, 0.0, -1 - begin
    seen = np.full(2 * (n + 2), -1, dtype=np.int32)
    exits = np.empty(1024, dtype=_EXIT)
    latest = np.array([goal[0], goal[1], np.inf])
    return GoalSearch(site, sectors, exits, opened, sizes, goal.copy(), latest, seen), order


@compiled
def _make_site(scene: Scene, goal: Array, tolerance: float) -> tuple[Site, NDArray[np.int64]]:
    """The site of a search, and the scene's disc for each of its discs."""
    n, box = len(scene.discs), scene.box
    size = math.sqrt((box[1, 0] - box[0, 0]) * (box[1, 1] - box[0, 1]) / (n + 1))
    # neighbours in the plane are neighbours in memory
    columns = np.floor((scene.discs["x"] - box[0, 0]) / size)
    order = np.argsort(columns * (box[1, 1] - box[0, 1]) + (scene.discs["y"] - box[0, 1]))
    discs = np.empty(n + 2, dtype=DISC)
    for k in range(n):
        discs[k] = scene.discs[order[k]]
    for k, point in ((n, goal), (n + 1, goal)):
        discs[k].x, discs[k].y, discs[k].radius, discs[k].reach = point[0], point[1], 0.0, -1.0
    # a point beside a cell by the tolerance still lies in the discs that cover the cell
    grid = make_grid(discs[: n + 1], box, size, 3.0 * max(scene.margin, tolerance))
    return Site(discs, grid, box, scene.margin, np.full(n + 2, -1)), order


@compiled
def _replaced(search: GoalSearch, exits: Records, opened: Records) -> GoalSearch:
    """The search with other memory for exits and open ends."""
    site, sectors, _, _, sizes, anchor, latest, seen = search
    return GoalSearch(site, sectors, exits, opened, sizes, anchor, latest, seen)


@compiled
def with_sector(search: GoalSearch, sector: int) -> GoalSearch:
    """The search with the exits of a sector made, and with room for as many open ends."""
    sectors, sizes = search.sectors, search.sizes
    if sectors[sector].first < 0:
        made = [Exit(0.0, 0, 0.0, 0.0, 0.0, 0.0) for _ in range(0)]
        add_exits(search.site, sector // 8, sector % 8, np.inf, sizes[2], made)
        sizes[2] += 2
        exits = search.exits
        if sizes[0] + len(made) > len(exits):
            exits = np.empty(2 * (len(exits) + len(made)), dtype=_EXIT)
            for k in range(sizes[0]):
                exits[k] = search.exits[k]
            search = _replaced(search, exits, search.open)
        sectors[sector].first = sizes[0]
        for way in made:
            one = exits[sizes[0]]
            one.angle, one.there, one.line, one.x, one.y = (
                way.angle,
                way.there,
                way.line,
                way.x,
                way.y,
            )
            one.way, one.other, one.came, one.arrival = np.inf, way.other, -1, _UNSETTLED
            sizes[0] += 1
        sectors[sector].end = sizes[0]
    room = sizes[1] + 1 + sectors[sector].end - sectors[sector].first
    if room > len(search.open):
        opened = np.empty(2 * room, dtype=_OPEN)
        for k in range(sizes[1]):
            opened[k] = search.open[k]
        search = _replaced(search, search.exits, opened)
    return search


@compiled
def advance(search: GoalSearch) -> tuple[GoalSearch, int]:
    """Settle the open end with the least bound, of which there must be one.

    Returns:
        The search, and the track on which distances may have become less; -1 for none.
    """
    sectors, sizes = search.sectors, search.sizes
    discs, exits, ends = search.site.discs, search.exits, search.open
    length, code = ends[0].length, ends[0].code
    _pop(ends, sizes)
    if code >= 0:
        reached = exits[code]
        if length > reached.way + reached.line:
            return search, -1
        track, at, origin = int(reached.other), reached.there, code
        sector = 8 * track + sector_of(at)
        if reached.arrival == _UNSETTLED:
            reached.arrival = sectors[sector].arrived
            sectors[sector].arrived = code
    else:
        sector = -1 - code
        if length > sectors[sector].entry:
            return search, -1
        track, at = sector // 8, (sector % 8) * EIGHTH
        origin = int(sectors[sector].entered)
    room = sizes[1] + 1 + sectors[sector].end - sectors[sector].first
    if sectors[sector].first < 0 or room > len(ends):
        search = with_sector(search, sector)
        exits, ends = search.exits, search.open
    x, y = search.anchor
    disc = discs[track // 2]
    leave, end = _following(exits, sectors[sector].first, sectors[sector].end, at)
    while leave < end:
        way = exits[leave]
        there = length + disc.radius * (way.angle - at)
        # a path that came to this exit before, and is no longer, goes on like this one
        if way.other == WALL or there >= way.way:
            break
        way.way, way.came = there, origin
        # what comes back to the goal is of no use
        if way.other != GOAL:
            there += way.line
            _push(ends, sizes, there + np.hypot(way.x - x, way.y - y), there, leave)
        leave += 1
    if leave < end:
        return search, track
    until = (sector % 8 + 1) * EIGHTH
    there = length + disc.radius * (until - at)
    following = 8 * track + (sector + 1) % 8
    if there < sectors[following].entry:
        sectors[following].entry, sectors[following].entered = there, origin
        at_x, at_y = _begin_of(discs, following)
        _push(ends, sizes, there + np.hypot(at_x - x, at_y - y), there, -1 - following)
    return search, track


@compiled
def _begin_of(discs: Records, sector: int) -> tuple[float, float]:
    """The point where a sector begins [m]."""
    disc, at = discs[sector // 16], (sector % 8) * EIGHTH
    sense = 1.0 - 2.0 * (sector // 8 % 2)
    return disc.x + disc.radius * math.cos(at), disc.y + sense * disc.radius * math.sin(at)


@compiled
def _following(exits: Records, low: int, end: int, at: float) -> tuple[int, int]:
    """The first exit of a sector at an angle or behind it, and the sector's end."""
    high = end
    while low < high:
        middle = (low + high) // 2
        if exits[middle].angle < at:
            low = middle + 1
        else:
            high = middle
    return low, end


@compiled
def set_anchor(search: GoalSearch, x: float, y: float) -> None:
    """Give the open ends estimates for a point [m]."""
    ends, exits, sectors, sizes = search.open, search.exits, search.sectors, search.sizes
    kept = 0
    for k in range(sizes[1]):
        length, code = ends[k].length, ends[k].code
        if code >= 0:
            stale = length > exits[code].way + exits[code].line
            at_x, at_y = exits[code].x, exits[code].y
        else:
            stale = length > sectors[-1 - code].entry
            at_x, at_y = _begin_of(search.site.discs, -1 - code)
        if stale:
            continue
        ends[kept].bound = length + np.hypot(at_x - x, at_y - y)
        ends[kept].length, ends[kept].code = length, code
        kept += 1
    sizes[1] = kept
    _restore(ends, sizes)
    search.anchor[0], search.anchor[1] = x, y


@compiled
def length_to(search: GoalSearch, track: int, at: float) -> tuple[float, int]:
    """Length of a path from the goal to a point of a track [m], and where the last arc begins.

    It is that of the shortest such path if no open end can lead to a shorter one.

    Returns:
        The length, infinite if none is known, and the exit that ends where the arc begins.
    """
    sector = 8 * track + sector_of(at)
    here, exits = search.sectors[sector], search.exits
    if here.first < 0:
        return np.inf, -1
    wall = -1.0
    for k in range(here.first, here.end):
        if exits[k].angle > at:
            break
        if exits[k].other == WALL:
            wall = exits[k].angle
    radius = search.site.discs[track // 2].radius
    best, origin = np.inf, -1
    if wall < 0.0:
        best, origin = here.entry + radius * (at - sector % 8 * EIGHTH), int(here.entered)
    arrival = int(here.arrived)
    while arrival >= 0:
        one = exits[arrival]
        if wall < one.there <= at:
            length = one.way + one.line + radius * (at - one.there)
            if length < best:
                best, origin = length, arrival
        arrival = int(one.arrival)
    return best, origin


@compiled
def reverse(track: int, at: float) -> tuple[int, float]:
    """A point of a track as one of the track in the other sense: that track, and the angle."""
    return track ^ 1, -at % TWO_PI


@compiled
def _push(heap: Records, sizes: Integers, bound: float, length: float, code: int) -> None:
    """Add an open end to those in use, `sizes[1]` of them; there must be room."""
    place = sizes[1]
    sizes[1] += 1
    while place > 0:
        parent = (place - 1) // 2
        if heap[parent].bound <= bound:
            break
        heap[place] = heap[parent]
        place = parent
    heap[place].bound, heap[place].length, heap[place].code = bound, length, code


@compiled
def _pop(heap: Records, sizes: Integers) -> None:
    """Remove the open end with the least bound, which is the first."""
    sizes[1] -= 1
    if sizes[1] > 0:
        last = heap[sizes[1]]
        _sink(heap, sizes[1], 0, last.bound, last.length, last.code)


@compiled
def _restore(heap: Records, sizes: Integers) -> None:
    """Turn open ends in any order into a heap."""
    for place in range(sizes[1] // 2 - 1, -1, -1):
        one = heap[place]
        _sink(heap, sizes[1], place, one.bound, one.length, one.code)


@compiled
def _sink(heap: Records, size: int, place: int, bound: float, length: float, code: int) -> None:
    """Put an open end in a place or below, so that none above it has a greater bound."""
    child = 2 * place + 1
    while child < size:
        if child + 1 < size and heap[child + 1].bound < heap[child].bound:
            child += 1
        if heap[child].bound >= bound:
            break
        heap[place] = heap[child]
        place, child = child, 2 * child + 1
    heap[place].bound, heap[place].length, heap[place].code = bound, length, code
