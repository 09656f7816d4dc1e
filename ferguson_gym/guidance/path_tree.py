"""The tree of all shortest paths to the goal, and points ahead on them, compiled.

Of a tangent graph it keeps the nodes at which shortest paths leave their tracks, and walls: a tenth
of the memory. A query looks at all discs without a branch, which the processor does for several at
a time, instead of sorting them.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np

from ferguson_gym.guidance.margins import Solids, outside
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place, unowned
from ferguson_gym.shortest_paths.departures import NOWHERE, STRAIGHT
from ferguson_gym.shortest_paths.scene import Scene
from ferguson_gym.shortest_paths.shapes import (
    TWO_PI,
    Integers,
    Records,
    Shapes,
    along_boundary,
    corner_at,
    enters,
    is_disc,
    nearest_feature,
    straight_parts,
    sweep,
)
from ferguson_gym.shortest_paths.tangent_graph import GOAL, WALL, Tracks
from ferguson_gym.shortest_paths.tangents import Touch, angle, tangent, tangent_to_shape

NODE = np.dtype(
    [
        ("angle", np.float64),  # in the track's sense [rad]
        ("togo", np.float64),  # distance to the goal [m]; infinite for a wall
        ("line", np.float64),  # length of the tangent that leaves here [m]
        ("at", np.float64),  # angle at which it reaches the next track [rad]
        ("track", np.int32),  # the next track, or STRAIGHT for the goal
        ("next", np.int32),  # the node at which the path leaves that
    ]
)


_Departure: TypeAlias = tuple[float, float, float, int, float, float]
"""Length of a path [m], unit direction in which it leaves, the track that it reaches (STRAIGHT or
NOWHERE), the angle there [rad], and the length of its first line [m]."""


class PathTree(NamedTuple):
    """The shortest paths to the goal among n obstacles."""

    discs: Array
    """(4, n) x, y and radius, and the distance below which a point counts as inside [m], of discs
    or, for obstacles of other shapes, of the discs that bound them."""
    frame: Array
    """(4, 2) bounds within which a point may lie, the goal, and the field's unit and the clearance
    given to a point that is moved out of an obstacle [m]."""
    first: Integers
    """(2 n + 1,) index of the first node of each track."""
    least: Array
    """(2, n) least distance to the goal of the nodes of each sense's track [m]."""
    nodes: Records
    """(m,) of NODE, in the order of their tracks and angles."""
    shapes: Shapes
    """What the discs bound; empty where every obstacle is a disc."""


@compiled
def path_tree(
    scene: Scene, tracks: Tracks, goal: Array, tolerance: float, unit: float, clearance: float
) -> PathTree:
    """The tree of a tangent graph.

    Args:
        scene: its obstacles.
        tracks: the graph.
        goal: (2,) [m].
        tolerance: by which a point may lie outside the bounds [m].
        unit: of the field [m].
        clearance: given to a point that is moved out of an obstacle [m].
    """
    n, m = len(scene.discs), len(tracks.angle)
    discs, frame, least = np.empty((4, n)), np.empty((4, 2)), np.empty((2, n))
    for k in range(n):
        disc = scene.discs[k]
        discs[0, k], discs[1, k], discs[2, k], discs[3, k] = disc.x, disc.y, disc.radius, disc.reach
        least[0, k], least[1, k] = tracks.least[2 * k], tracks.least[2 * k + 1]
    slack = tolerance - scene.margin
    for d in range(2):
        frame[0, d], frame[1, d] = scene.box[0, d] - slack, scene.box[1, d] + slack
        frame[2, d] = goal[d]
    frame[3, 0], frame[3, 1] = unit, clearance
    place, count = np.full(m, -1), 0
    first = np.zeros(2 * n + 1, dtype=np.int64)
    for track in range(2 * n):
        first[track] = count
        for node in range(tracks.first[track], tracks.first[track + 1]):
            leaves = tracks.leave[node] == node and tracks.togo[node] < np.inf
            if leaves or tracks.other[node] == WALL:
                place[node] = count
                count += 1
    first[2 * n] = count
    nodes = np.empty(count, dtype=NODE)
    for node in range(m):
        if place[node] < 0:
            continue
        kept = nodes[place[node]]
        kept.angle, kept.togo, kept.line = tracks.angle[node], tracks.togo[node], tracks.line[node]
        kept.at, kept.track, kept.next = 0.0, STRAIGHT, -1
        other = tracks.other[node]
        if other not in (GOAL, WALL):
            kept.at, kept.track = tracks.angle[other], tracks.track[other]
            kept.next = place[tracks.leave[other]]
    return PathTree(discs, frame, first, least, nodes, scene.shapes)


@compiled
def _following(firsts: Integers, nodes: Records, track: int, at: float) -> int:
    """The first node of a track at or after an angle, or -1 if the track has none."""
    low, end = firsts[track], firsts[track + 1]
    first, high = low, end
    while low < high:
        middle = (low + high) // 2
        if nodes[middle].angle < at:
            low = middle + 1
        else:
            high = middle
    if low < end:
        return int(low)
    return int(first) if first < end else -1


@compiled
def _is_clear_of_discs(
    x: float, y: float, ux: float, uy: float, length: float, discs: Array, i: int
) -> bool:
    """Whether a line from (x, y) in a unit direction meets no disc except `i`, which it touches."""
    hits = 0
    for k in range(discs.shape[1]):
        dx, dy = discs[0, k] - x, discs[1, k] - y
        beside, along = dx * uy - dy * ux, dx * ux + dy * uy
        beyond = max(-along, along - length)
        beyond = beyond if beyond > 0.0 else 0.0
        hits += (beside * beside + beyond * beyond < discs[3, k] * discs[3, k]) & (k != i)
    return hits == 0


@compiled
def _is_clear_of_shapes(
    x: float,
    y: float,
    ux: float,
    uy: float,
    length: float,
    discs: Array,
    shapes: Shapes,
    i: int,
) -> bool:
    """As `_is_clear_of_discs`, where discs bound other shapes."""
    for k in range(discs.shape[1]):
        dx, dy = discs[0, k] - x, discs[1, k] - y
        beside, along = dx * uy - dy * ux, dx * ux + dy * uy
        beyond = max(-along, along - length, 0.0)
        near = beside * beside + beyond * beyond < discs[3, k] * discs[3, k] and k != i
        if near and (is_disc(shapes, k) or enters(x, y, ux, uy, length, shapes, k)):
            return False
    return True


@compiled_in_place
def _is_clear(
    x: float,
    y: float,
    ux: float,
    uy: float,
    length: float,
    discs: Array,
    shapes: Shapes,
    i: int,
) -> bool:
    """Whether a line from (x, y) in a unit direction meets no obstacle except `i`.

    The line touches that one.
    """
    clear = _is_clear_of_discs(x, y, ux, uy, length, discs, i)
    if not clear and len(shapes.first) > 0:
        clear = _is_clear_of_shapes(x, y, ux, uy, length, discs, shapes, i)
    return clear


@compiled
def _bound(discs: Array, least: Array, x: float, y: float, bounds: Array) -> int:
    """Fill bounds (2, n) of paths from a point by each track [m]; count discs that hold it."""
    within = 0
    for k in range(discs.shape[1]):
        dx, dy, radius = discs[0, k] - x, discs[1, k] - y, discs[2, k]
        square = dx * dx + dy * dy
        beyond = square - radius * radius
        tangential = np.sqrt(beyond if beyond > 0.0 else 0.0)
        bounds[0, k], bounds[1, k] = tangential + least[0, k], tangential + least[1, k]
        within += np.sqrt(square) < radius
    return within


@compiled
def _bound_shapes(
    discs: Array, least: Array, shapes: Shapes, x: float, y: float, bounds: Array
) -> int:
    """Correct bounds where discs bound other shapes; count those that hold it outside these."""
    free = 0
    for k in range(len(shapes.first) - 1):
        if is_disc(shapes, k):
            continue
        dx, dy, radius = discs[0, k] - x, discs[1, k] - y, discs[2, k]
        apart = np.sqrt(dx * dx + dy * dy)
        beside = max(apart - radius, 0.0)
        bounds[0, k], bounds[1, k] = beside + least[0, k], beside + least[1, k]
        if apart < radius and nearest_feature(shapes, k, x, y).distance >= shapes.radii[k]:
            free += 1
    return free


@compiled_in_place
def _prepare(tree: PathTree, x: float, y: float, bounds: Array) -> int:
    """Fill bounds (2, n) of paths from a point by each track [m]; count obstacles that hold it."""
    within = _bound(tree.discs, tree.least, x, y, bounds)
    if len(tree.shapes.first) > 0:
        within -= _bound_shapes(tree.discs, tree.least, tree.shapes, x, y, bounds)
    return within


@compiled_in_place
def _by_track(
    tree: PathTree, x: float, y: float, side: int, i: int, best: _Departure
) -> _Departure:
    """The path around an obstacle on one side, if it is free and shorter than the best so far."""
    if is_disc(tree.shapes, i):
        sense = 1.0 - 2.0 * side
        line, ux, uy = tangent(tree.discs[0, i] - x, tree.discs[1, i] - y, sense * tree.discs[2, i])
        touch = Touch(line, ux, uy, angle(sense, ux, uy))
    else:
        margin = tree.shapes.radii[i] - tree.shapes.reach[i]
        touch = tangent_to_shape(tree.shapes, margin, 2 * i + side, x, y)
    node = _following(tree.first, tree.nodes, 2 * i + side, touch.at)
    length = np.inf
    if node >= 0:
        there = tree.nodes[node]
        length = touch.length + _arc(tree, 2 * i + side, touch.at, there.angle) + there.togo
    if length < best[0] and _is_clear(
        x, y, touch.ux, touch.uy, touch.length, tree.discs, tree.shapes, i
    ):
        best = (length, touch.ux, touch.uy, 2 * i + side, touch.at, touch.length)
    return best


@compiled_in_place
def _arc(tree: PathTree, track: int, before: float, after: float) -> float:
    """Length of a track between two angles [m]."""
    i, turn = track // 2, sweep(before, after)
    if is_disc(tree.shapes, i):
        return float(tree.discs[2, i] * turn)
    straight = straight_parts(tree.shapes, track, before, after)
    return float(tree.shapes.radii[i] * turn + straight)


@compiled
def _departure(tree: PathTree, x: float, y: float, bounds: Array) -> _Departure:
    """How the shortest path from a point in no obstacle to the goal leaves it.

    As `ferguson_gym.shortest_paths.departures.shortest_departure`, with what `_prepare` has filled.
    Sides of obstacles are tried in the order of their bounds until one leads to the goal, then all
    whose bound is less than the best length: a search for the least bound would take longer.
    """
    discs, frame = tree.discs, tree.frame
    best = (np.inf, 0.0, 0.0, NOWHERE, 0.0, 0.0)
    if not (frame[0, 0] <= x <= frame[1, 0] and frame[0, 1] <= y <= frame[1, 1]):
        return best
    dx, dy = frame[2, 0] - x, frame[2, 1] - y
    distance = np.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return 0.0, 0.0, 0.0, STRAIGHT, 0.0, 0.0
    if _is_clear(x, y, dx / distance, dy / distance, distance, discs, tree.shapes, -1):
        return distance, dx / distance, dy / distance, STRAIGHT, 0.0, distance
    while best[0] == np.inf:
        bound, side, i = np.inf, -1, -1
        for s in range(2):
            for k in range(discs.shape[1]):
                if bounds[s, k] < bound:
                    bound, side, i = bounds[s, k], s, k
        if side < 0:
            return best
        bounds[side, i] = np.inf
        best = _by_track(tree, x, y, side, i, best)
    for s in range(2):
        for k in range(discs.shape[1]):
            if bounds[s, k] < best[0]:
                best = _by_track(tree, x, y, s, k, best)
    return best


@compiled
def _on_line(
    x: float,
    y: float,
    ux: float,
    uy: float,
    begin: float,
    end: float,
    unit: float,
    distances: Array,
    places: Array,
    number: int,
) -> int:
    """Write the places between two distances that lie on a line; returns how many are written."""
    while number < len(distances) and unit * distances[number] <= end:
        ahead = unit * distances[number] - begin
        places[number, 0], places[number, 1] = x + ahead * ux, y + ahead * uy
        number += 1
    return number


@compiled
def look(tree: PathTree, from_x: float, from_y: float, distances: Array, places: Array) -> float:
    """As `look_ahead`, from one point; returns the length of the path [m]."""
    discs, frame, shapes = tree.discs, tree.frame, tree.shapes
    unit = frame[3, 0]
    bounds = np.empty((2, discs.shape[1]))
    x, y = from_x, from_y
    if _prepare(tree, x, y, bounds) > 0:
        x, y, _ = outside(x, y, Solids(discs[:2], discs[2], shapes), frame[3, 1])
        if _prepare(tree, x, y, bounds) > 0:
            return np.inf
    length, ux, uy, track, at, line = _departure(tree, x, y, bounds)
    if length == np.inf:
        return np.inf
    moved = np.sqrt((x - from_x) ** 2 + (y - from_y) ** 2)
    number = 0
    if moved > 0.0:
        way_x, way_y = (x - from_x) / moved, (y - from_y) / moved
        number = _on_line(from_x, from_y, way_x, way_y, 0.0, moved, unit, distances, places, number)
    end = moved + line
    number = _on_line(x, y, ux, uy, moved, end, unit, distances, places, number)
    node = _following(tree.first, tree.nodes, track, at) if track >= 0 else -1
    while node >= 0 and number < len(distances):
        leave, begin = tree.nodes[node], end
        i, sense = track // 2, 1.0 - 2.0 * (track % 2)
        x, y, radius = discs[0, i], discs[1, i], discs[2, i]
        end = begin + _arc(tree, track, at, leave.angle)
        while number < len(distances) and unit * distances[number] <= end:
            ahead = unit * distances[number] - begin
            if is_disc(shapes, i):
                there = at + ahead / radius
                places[number, 0] = x + radius * math.cos(there)
                places[number, 1] = y + sense * radius * math.sin(there)
            else:
                places[number, 0], places[number, 1] = along_boundary(shapes, track, at, ahead)
            number += 1
        if not is_disc(shapes, i):
            c = corner_at(shapes, i, leave.angle if sense > 0.0 else TWO_PI - leave.angle)
            x, y, radius = shapes.corners[c].x, shapes.corners[c].y, shapes.radii[i]
        cos, sin = math.cos(leave.angle), math.sin(leave.angle)
        x, y, begin, end = x + radius * cos, y + sense * radius * sin, end, end + leave.line
        number = _on_line(x, y, -sin, sense * cos, begin, end, unit, distances, places, number)
        at, track, node = leave.at, int(leave.track), int(leave.next)
    while number < len(distances):
        places[number, 0], places[number, 1] = frame[2, 0], frame[2, 1]
        number += 1
    return float(moved + length)


@compiled
def look_ahead(tree: PathTree, points: Array, distances: Array, places: Array, togo: Array) -> None:
    """Points ahead on the shortest paths from some points, and the paths' lengths.

    A point within an obstacle is moved out of it first, and the way there counts.

    Args:
        tree: of the field.
        points: (m, 2) [m].
        distances: (m, n) along a path, increasing, or (1, n) for all points [units of the field].
        places: (m, n, 2), filled [m]; those beyond the goal are on it.
        togo: (m,), filled [m]; infinite where there is no path, and places mean nothing then.
    """
    tree = unowned(tree)  # the caller holds it
    for i in range(len(points)):
        along = distances[i % len(distances)]
        togo[i] = look(tree, points[i, 0], points[i, 1], along, places[i])
