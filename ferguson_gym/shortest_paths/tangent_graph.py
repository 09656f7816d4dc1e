"""The tangent graph of a field with the shortest distance to the goal from every node, compiled.

A track is an obstacle's boundary with a direction, clockwise or counter-clockwise. Its nodes,
ordered along that direction, are the points where tangents leave or arrive, and walls: points in
the middle of parts that are covered by another obstacle or lie outside the bounds. Edges lead from
a node along the track to the next node, unless that is a wall, and along the tangent that leaves
there. A wall can be a single point, because tangents touch only parts of tracks that are uncovered
and inside the bounds: a path along a track that enters an obstacle or leaves the bounds can only
return past a wall. A node has at most two outgoing edges, so that Dijkstra's algorithm takes little
more time than sorting the nodes.

Every path through this graph is taut: it turns only along obstacles, hence is locally shortest. A
shortest path bends only on obstacles: the bounds are convex, and where two obstacles overlap, the
corner of the free space is convex, so that a path never bends there. Where three obstacles have a
common tangent, rounding decides whether the middle one is reached before or after the point where
it is left; the tangent past all three is also an edge.

Reference:
    Dijkstra (1959), A note on two problems in connexion with graphs, Numerische Mathematik 1.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, unowned
from ferguson_gym.shortest_paths.boundary import walls
from ferguson_gym.shortest_paths.common_tangents import Tangents, tangents
from ferguson_gym.shortest_paths.scene import Scene, is_clear, view
from ferguson_gym.shortest_paths.shapes import (
    TWO_PI,
    Integers,
    is_disc,
    passed,
    perimeter,
    sweep,
)
from ferguson_gym.shortest_paths.tangents import (
    angle,
    is_within,
    tangent,
    tangent_from,
)

GOAL, WALL = -1, -2
"""Values used instead of the index of a tangent's other node."""


class Tracks(NamedTuple):
    """Nodes (m,) in the order of their tracks, and the shortest path to the goal from each."""

    first: Integers
    """(2 n + 1,) index of the first node of each track; the last entry is m."""
    track: Integers
    """(m,) track of each node."""
    angle: Array
    """(m,) in the track's sense, in [0, 2 pi), increasing along a track [rad]."""
    other: Integers
    """(m,) the other end of the tangent, GOAL or WALL."""
    line: Array
    """(m,) length of the tangent that leaves here [m], -1 where none does."""
    togo: Array
    """(m,) distance to the goal [m]; infinite if there is no path."""
    leave: Integers
    """(m,) node at which the shortest path leaves the track."""
    least: Array
    """(2 n,) least `togo` of a track's nodes [m]."""


@compiled
def following(tracks: Tracks, track: int, at: float) -> int:
    """The first node of a track at or after an angle, or -1 if the track has none."""
    first, end = tracks.first[track], tracks.first[track + 1]
    if first == end:
        return -1
    node: int = first + np.searchsorted(tracks.angle[first:end], at)
    return node if node < end else first


@compiled
def _nodes(scene: Scene, lines: Tangents, goal: Array) -> Tracks:
    """Sort the ends of tangents and the walls onto the tracks."""
    scene = unowned(scene)  # the caller holds it
    n, m = len(scene.discs), len(lines.length)
    covered, middles = walls(scene)
    room = 4 * m + 2 * n + 2 * len(covered)
    track, at, line = np.empty(room, dtype=np.int64), np.empty(room), np.full(room, -1.0)
    other = np.full(room, WALL)
    for k in range(m):
        a, b = lines.angles[k]
        # both directions: leaving nodes are even, and the nodes of a pair differ in the last bit
        for node, where, there in (
            (4 * k, lines.leave[k], a),
            (4 * k + 1, lines.arrive[k], b),
            (4 * k + 2, lines.arrive[k] ^ 1, -b % TWO_PI),
            (4 * k + 3, lines.leave[k] ^ 1, -a % TWO_PI),
        ):
            track[node], at[node], other[node] = where, there, node ^ 1
            line[node] = lines.length[k] if node % 2 == 0 else -1.0
    count = 4 * m
    around = view(scene.discs, goal[0], goal[1])
    for place in range(2 * n):
        i, sense = place // 2, 1.0 - 2.0 * (place % 2)
        disc = scene.discs[i]
        if is_disc(scene.shapes, i):
            r = sense * disc.radius
            length, ux, uy = tangent(goal[0] - disc.x, goal[1] - disc.y, -r)
            x, y, far, there = disc.x + r * uy, disc.y - r * ux, length, angle(sense, ux, uy)
        else:
            # the line from the goal, reversed
            back = tangent_from(scene, place ^ 1, goal[0], goal[1])
            length, ux, uy, there = back.length, -back.ux, -back.uy, -back.at % TWO_PI
            x, y, far = goal[0] - length * ux, goal[1] - length * uy, length
        if is_within(scene.box, x, y) and is_clear(x, y, ux, uy, length, far, scene, around, i, i):
            track[count], at[count], other[count] = place, there, GOAL
            line[count] = length
            count += 1
    for k in range(len(covered)):
        for side in range(2):
            track[count] = 2 * covered[k] + side
            at[count] = (middles[k] if side == 0 else -middles[k]) % TWO_PI
            count += 1
    # sort by angle, then distribute to the tracks in that order
    first = np.zeros(2 * n + 1, dtype=np.int64)
    for node in range(count):
        first[track[node] + 1] += 1
    first = np.cumsum(first)
    end, order, place_of = first[:-1].copy(), track[:count].copy(), track[:count].copy()
    for node in np.argsort(at[:count]):
        place = end[track[node]]
        order[place], place_of[node], end[track[node]] = node, place, place + 1
    other = other[order]
    for node in range(count):
        if other[node] >= 0:
            other[node] = place_of[other[node]]
    return Tracks(
        first,
        track[order],
        at[order],
        other,
        line[order],
        np.full(count, np.inf),
        np.arange(count),
        np.full(2 * n, np.inf),
    )


@compiled
def _straight_parts(scene: Scene, tracks: Tracks) -> Array:
    """Length of the edges between each node and the next one of its track (m,) [m]."""
    scene = unowned(scene)  # the caller holds it
    straight = np.zeros(len(tracks.angle))
    for track in range(len(tracks.first) - 1):
        first, end = tracks.first[track], tracks.first[track + 1]
        if first == end or is_disc(scene.shapes, track // 2):
            continue
        around = perimeter(scene.shapes, track // 2)
        begin = passed(scene.shapes, track, tracks.angle[first])
        before = begin
        for node in range(first, end):
            after = begin + around
            if node + 1 < end:
                after = passed(scene.shapes, track, tracks.angle[node + 1])
            straight[node] = after - before
            before = after
    return straight


@compiled
def _search(scene: Scene, tracks: Tracks) -> None:
    """Dijkstra's algorithm from the goal backwards; fills togo, leave and least."""
    scene = unowned(scene)  # the caller holds it
    togo, discs, only_discs = tracks.togo, scene.discs, len(scene.shapes.first) == 0
    straight = np.empty(0)
    if not only_discs:
        straight = _straight_parts(scene, tracks)
    heap = [(0.0, 0) for _ in range(0)]
    for node in range(len(togo)):
        if tracks.other[node] == GOAL:
            togo[node] = tracks.line[node]
            heap.append((togo[node], node))
    heapq.heapify(heap)
    while len(heap) > 0:
        way, node = heapq.heappop(heap)
        if way > togo[node]:
            continue
        track, other = tracks.track[node], tracks.other[node]
        tracks.least[track] = min(tracks.least[track], way)
        if other >= 0 and tracks.line[node] < 0.0 and way + tracks.line[other] < togo[other]:
            togo[other], tracks.leave[other] = way + tracks.line[other], other
            heapq.heappush(heap, (togo[other], other))
        before = (node if node > tracks.first[track] else tracks.first[track + 1]) - 1
        if tracks.other[before] != WALL:
            turn = sweep(tracks.angle[before], tracks.angle[node])
            if only_discs:
                arc = discs[track // 2].radius * turn
            else:
                arc = scene.shapes.radii[track // 2] * turn + straight[before]
            if way + arc < togo[before]:
                togo[before], tracks.leave[before] = way + arc, tracks.leave[node]
                heapq.heappush(heap, (togo[before], before))


@compiled
def build(scene: Scene, goal: Array) -> Tracks:
    """The tangent graph of a scene with the shortest path from every node to a goal (2,)."""
    return with_lines(scene, tangents(scene, 0), goal)


@compiled
def with_lines(scene: Scene, lines: Tangents, goal: Array) -> Tracks:
    """As `build`, from all tangents of the scene."""
    tracks = _nodes(scene, lines, goal)
    _search(scene, tracks)
    return tracks
