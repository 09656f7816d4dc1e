"""Queries of a search from the goal: how the shortest path from a point leaves it, and its turns.

The lines on which a path can leave a point are made within an ellipse: that with the point and the
goal as foci which a guess of the path's length reaches. The search then goes on until no shorter
path can be found. If the path found is longer than the guess, its length is the next guess.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.departures import NOWHERE, STRAIGHT, Departure
from ferguson_gym.shortest_paths.goal_search.disc_grid import cell_at
from ferguson_gym.shortest_paths.goal_search.search import (
    GoalSearch,
    advance,
    length_to,
    reverse,
    set_anchor,
)
from ferguson_gym.shortest_paths.goal_search.sector_tangents import Exit, Site, add_exits
from ferguson_gym.shortest_paths.tangent_graph import GOAL

SLACK = 1e-9
"""By how much a bound exceeds the length for which it is set, relative to it."""
_WIDER = 2.0
"""Factor of a bound that proves too small."""


class Leave(NamedTuple):
    """How the shortest path leaves a point."""

    distance: float
    """Length of the path to the goal [m], infinite without one."""
    exit: Exit
    """Its first line."""
    origin: int
    """The exit whose end begins the path's first arc, seen from the goal; -1 without an arc."""


@compiled
def is_free(site: Site, x: float, y: float, tolerance: float) -> bool:
    """Whether a point violates discs and bounds by no more than a tolerance [m]."""
    box, grid = site.box, site.grid
    slack = tolerance - site.margin
    if not (box[0, 0] - slack <= x <= box[1, 0] + slack):
        return False
    if not (box[0, 1] - slack <= y <= box[1, 1] + slack):
        return False
    cell = cell_at(grid, x, y)
    if grid.covered[cell]:
        return False
    for place in range(grid.first[cell], grid.first[cell + 1]):
        disc = site.discs[grid.member[place]]
        if np.sqrt((disc.x - x) ** 2 + (disc.y - y) ** 2) < disc.radius - tolerance:
            return False
    return True


@compiled
def _shortest(
    search: GoalSearch, lines: list[Exit], x: float, y: float, bound: float
) -> tuple[GoalSearch, Leave]:
    """Continue until the shortest path that begins with one of some lines from a point is known.

    A path longer than the bound [m] need not be the shortest.
    """
    seen, sizes, anchor = search.seen, search.sizes, search.anchor
    best = Leave(np.inf, Exit(0.0, GOAL, 0.0, 0.0, x, y), -1)
    for k, line in enumerate(lines):
        length, origin = 0.0, -1
        if line.other != GOAL:
            track, at = reverse(line.other, line.there)
            seen[track] = k
            length, origin = length_to(search, track, at)
        if length + line.line < best.distance:
            best = Leave(length + line.line, line, origin)
    apart = np.hypot(anchor[0] - x, anchor[1] - y)
    while sizes[1] > 0 and search.open[0].bound - apart < min(best.distance, bound):
        if apart > 0.0:
            set_anchor(search, x, y)
            apart = 0.0
            continue
        search, track = advance(search)
        if track >= 0 and seen[track] >= 0:
            line = lines[seen[track]]
            length, origin = length_to(search, track, reverse(line.other, line.there)[1])
            if length + line.line < best.distance:
                best = Leave(length + line.line, line, origin)
    for line in lines:
        if line.other != GOAL:
            seen[line.other ^ 1] = -1
    return search, best


@compiled
def lines_from(search: GoalSearch, x: float, y: float, bound: float) -> list[Exit]:
    """The free tangents from a point that paths to the goal of at most a length [m] begin with."""
    site, sizes = search.site, search.sizes
    last = len(site.discs) - 1
    site.discs[last].x, site.discs[last].y = x, y
    lines = [Exit(0.0, 0, 0.0, 0.0, 0.0, 0.0) for _ in range(0)]
    for sector in range(8):
        add_exits(site, 2 * last, sector, bound, sizes[2], lines)
        sizes[2] += 2
    return lines


@compiled
def shortest_leave(
    search: GoalSearch, x: float, y: float, tolerance: float
) -> tuple[GoalSearch, Leave]:
    """How the shortest path from a point [m] to the goal leaves it; continues the search for it.

    The point may lie inside discs or outside the bounds by the tolerance [m].
    """
    discs, latest = search.site.discs, search.latest
    goal = discs[len(discs) - 2]
    straight = np.hypot(goal.x - x, goal.y - y)
    if straight == 0.0 or not is_free(search.site, x, y, tolerance):
        distance = 0.0 if straight == 0.0 else np.inf
        return search, Leave(distance, Exit(0.0, GOAL, 0.0, 0.0, x, y), -1)
    # right if the straight line from the latest point is free; a wrong guess only costs time
    bound = latest[2] + np.hypot(latest[0] - x, latest[1] - y)
    bound = (1.0 + SLACK) * (bound if bound < np.inf else straight)
    while True:
        lines = lines_from(search, x, y, bound)
        search, leave = _shortest(search, lines, x, y, bound)
        if leave.distance <= bound or bound == np.inf:
            break
        # a path that is known bounds the shortest one
        if leave.distance < np.inf:
            bound = (1.0 + SLACK) * leave.distance
        else:
            bound = _WIDER * bound if search.sizes[1] > 0 else np.inf
    if leave.distance < np.inf:
        latest[0], latest[1], latest[2] = x, y, leave.distance
    return search, leave


@compiled
def departure(
    search: GoalSearch, x: float, y: float, tolerance: float
) -> tuple[GoalSearch, Departure]:
    """As `shortest_leave`, with the direction in which the path leaves."""
    search, leave = shortest_leave(search, x, y, tolerance)
    line, track, at = leave.exit.line, leave.exit.other, leave.exit.there
    ux, uy = 0.0, 0.0
    if leave.distance == np.inf:
        track = NOWHERE
    elif track == GOAL:
        track = STRAIGHT
        if line > 0.0:
            ux, uy = (leave.exit.x - x) / line, (leave.exit.y - y) / line
    else:
        # from the angle, since a line may have no length
        ux, uy = -math.sin(at), (1.0 - 2.0 * (track % 2)) * math.cos(at)
    return search, Departure(leave.distance, ux, uy, track, at, line)


@compiled
def turns_of(search: GoalSearch, leave: Leave) -> list[tuple[int, float, float]]:
    """The turns of a path to the goal: track, and angles where each begins and ends.

    Both angles lie between zero and a full turn.
    """
    turns = [(0, 0.0, 0.0) for _ in range(0)]
    if leave.exit.other == GOAL:
        return turns
    track, at, origin = leave.exit.other, leave.exit.there, leave.origin
    while True:
        turns.append((track, at, reverse(track, search.exits[origin].there)[1]))
        before = search.exits[origin]
        if before.came < 0:
            return turns
        # the line's other end lies on the track that it leaves, seen from the goal
        track, at = reverse(int(search.exits[before.came].other), before.angle)
        origin = int(before.came)
