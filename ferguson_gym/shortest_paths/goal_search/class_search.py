"""The best homotopy classes among many discs, found with a search from the goal that is kept.

As in `homotopy_classes`, routes from the point are extended best first. The distance to the goal
from the end of a route is known where the search from the goal has settled it. Elsewhere there is a
lower bound, and the search goes on when a route with such a bound is the best one.
"""

from __future__ import annotations

import heapq

import numpy as np

from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.departures import STRAIGHT
from ferguson_gym.shortest_paths.goal_search.queries import lines_from, shortest_leave
from ferguson_gym.shortest_paths.goal_search.search import (
    GoalSearch,
    advance,
    length_to,
    reverse,
    set_anchor,
    with_sector,
)
from ferguson_gym.shortest_paths.goal_search.sector_tangents import EIGHTH, sector_of
from ferguson_gym.shortest_paths.routes import MIN_SWEEP, Stage, has_loop
from ferguson_gym.shortest_paths.shapes import TWO_PI, Records, no_shapes, sweep
from ferguson_gym.shortest_paths.tangent_graph import GOAL, WALL

LONGEST = 1.25
"""Classes longer than this multiple of the shortest path are left out."""
_END = -1
"""Stands for the end of a route's last line, where an eighth of a turn behind it could stand."""


@compiled
def find_classes(
    search: GoalSearch, x: float, y: float, tolerance: float, k: int
) -> tuple[GoalSearch, list[tuple[float, int]], list[tuple[int, float, float]]]:
    """The shortest paths of the k best classes from a point to the goal, as far as they exist.

    Returns:
        The search; length [m] and number of turns of each path; and the turns of all of them: track
        and the angles where each begins and ends.
    """
    found, turns = [(0.0, 0) for _ in range(0)], [(0, 0.0, 0.0) for _ in range(0)]
    search, shortest = shortest_leave(search, x, y, tolerance)
    if shortest.distance == np.inf:
        return search, found, turns
    most = LONGEST * shortest.distance
    site = search.site
    discs, goal = site.discs, site.discs[len(site.discs) - 2]
    set_anchor(search, x, y)
    # bound on the length of routes that go on here, the stage, and what comes next: the end of its
    # line, or an eighth of the track that it reaches
    heap = [(0.0, 0, 0) for _ in range(0)]
    stages = [Stage(-1, STRAIGHT, 0.0, 0.0, 0.0, x, y, x, y) for _ in range(0)]
    if goal.x == x and goal.y == y:
        found.append((0.0, 0))
        return search, found, turns
    for line in lines_from(search, x, y, most):
        track = STRAIGHT if line.other == GOAL else line.other
        stage = Stage(-1, track, line.there, 0.0, line.line, x, y, line.x, line.y)
        heap.append((line.line + _to_go(search, stage)[0], len(stages), _END))
        stages.append(stage)
    heapq.heapify(heap)
    while len(heap) > 0 and len(found) < k:
        bound, index, eighth = heapq.heappop(heap)
        if bound > most:
            break
        stage = stages[index]
        if eighth == _END:
            if has_loop(stages, index, discs, no_shapes(), site.margin):
                continue
            # the goal's search goes on while this route remains the best one
            least = min(most, heap[0][0]) if len(heap) > 0 else most
            ahead, known = _to_go(search, stage)
            while not known and stage.length + ahead <= least:
                search, _ = advance(search)
                ahead, known = _to_go(search, stage)
            if stage.length + ahead > least:
                heapq.heappush(heap, (stage.length + ahead, index, _END))
                continue
            if stage.track == STRAIGHT:
                count = len(turns)
                while stages[index].parent >= 0:
                    before, turn = stages[stages[index].parent], stages[index].turn
                    turns.append((before.track, before.at, before.at + turn))
                    index = stages[index].parent
                found.append((stage.length, len(turns) - count))
                continue
            eighth = 0
        track, first = stage.track, sector_of(stage.at)
        sector = 8 * track + (first + eighth) % 8
        search = with_sector(search, sector)
        disc, ended = discs[track // 2], False
        for leave in range(search.sectors[sector].first, search.sectors[sector].end):
            way = search.exits[leave]
            # the first eighth is looked at twice, from where it is reached and up to there
            if (eighth == 0 and way.angle < stage.at) or (eighth == 8 and way.angle >= stage.at):
                continue
            if way.other == WALL:
                ended = True
                break
            turn = sweep(stage.at, way.angle)
            if not MIN_SWEEP <= turn <= TWO_PI - MIN_SWEEP:
                continue
            length = stage.length + turn * disc.radius + way.line
            px, py = _point_of(discs, track, way.angle)
            other = STRAIGHT if way.other == GOAL else int(way.other)
            following = Stage(index, other, way.there, turn, length, px, py, way.x, way.y)
            total = length + _to_go(search, following)[0]
            if total <= most:
                heapq.heappush(heap, (total, len(stages), _END))
                stages.append(following)
        if ended or eighth == 8:
            continue
        until = (first + eighth) % 8 + 1.0
        turn = (first + eighth + 1.0) * EIGHTH - stage.at
        px, py = _point_of(discs, track, until * EIGHTH)
        total = stage.length + turn * disc.radius + np.hypot(goal.x - px, goal.y - py)
        if total <= most:
            heapq.heappush(heap, (total, index, eighth + 1))
    return search, found, turns


@compiled
def _point_of(discs: Records, track: int, at: float) -> tuple[float, float]:
    """The point of a track at an angle."""
    disc, sense = discs[track // 2], 1.0 - 2.0 * (track % 2)
    return disc.x + disc.radius * np.cos(at), disc.y + sense * disc.radius * np.sin(at)


@compiled
def _to_go(search: GoalSearch, stage: Stage) -> tuple[float, bool]:
    """A lower bound on the distance to the goal from a stage's end [m], and whether it is exact.

    The search's open ends must have estimates for the start of the route.
    """
    if stage.track == STRAIGHT:
        return 0.0, True
    track, at = reverse(stage.track, stage.at)
    known, _ = length_to(search, track, at)
    # a shorter path from the goal would lead past an open end
    apart = np.hypot(stage.end_x - search.anchor[0], stage.end_y - search.anchor[1])
    unknown = search.open[0].bound - apart if search.sizes[1] > 0 else np.inf
    if known <= unknown:
        return known, True
    discs = search.site.discs
    goal = discs[len(discs) - 2]
    straight = np.hypot(goal.x - stage.end_x, goal.y - stage.end_y)
    return max(unknown, straight), False
