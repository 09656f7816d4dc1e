"""How shortest paths leave points of a field whose tangent graph is known.

From a point the shortest path leads straight to the goal, or along a tangent to a disc; the tangent
graph stores the remaining distance at each of its nodes. Tangents are tried in the order of a lower
bound on the length of the path, so that few of them are tested for collisions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.scene import Scene, View, comes_within, is_clear, view
from ferguson_gym.shortest_paths.shapes import Records, Shapes, is_disc, nearest_feature, sweep
from ferguson_gym.shortest_paths.tangent_graph import GOAL, Tracks, following
from ferguson_gym.shortest_paths.tangents import (
    angle,
    arc_length,
    tangent,
    tangent_from,
    tangent_to_shape,
)

STRAIGHT, NOWHERE = -1, -2
"""Values used instead of a track's index: straight to the goal, and no path."""


class Departure(NamedTuple):
    """How a path leaves a point."""

    distance: float
    """Length of the path to the goal [m]."""
    ux: float
    """Unit direction in which it leaves."""
    uy: float
    track: int
    """The track that it reaches first, STRAIGHT or NOWHERE."""
    at: float
    """Angle at which it reaches that [rad]."""
    line: float
    """Length of its first line [m]."""


@compiled
def _view_of_discs(
    discs: Records, box: Array, margin: float, x: float, y: float, tolerance: float
) -> tuple[bool, Records]:
    """As `point_view`, where every obstacle is a disc."""
    slack = tolerance - margin
    free = box[0, 0] - slack <= x <= box[1, 0] + slack
    free = free and box[0, 1] - slack <= y <= box[1, 1] + slack
    copied = False
    for k in range(len(discs)):
        disc = discs[k]
        distance = np.sqrt((disc.x - x) ** 2 + (disc.y - y) ** 2)
        if distance < disc.radius - tolerance:
            free = False
        elif distance < disc.radius:
            if not copied:
                discs, copied = discs.copy(), True
            discs[k].reach = min(disc.reach, distance - margin)
    return free, discs


@compiled
def _departure_among_discs(
    discs: Records,
    box: Array,
    margin: float,
    tracks: Tracks,
    goal: Array,
    x: float,
    y: float,
    tolerance: float,
) -> Departure:
    best = Departure(np.inf, 0.0, 0.0, NOWHERE, 0.0, 0.0)
    free, discs = _view_of_discs(discs, box, margin, x, y, tolerance)
    if not free:
        return best
    near = np.empty(len(discs))
    bounds = np.empty(2 * len(discs))
    for k in range(len(discs)):
        disc = discs[k]
        square = (disc.x - x) ** 2 + (disc.y - y) ** 2
        near[k] = np.sqrt(square) - disc.radius
        line = np.sqrt(max(square - disc.radius**2, 0.0))
        bounds[2 * k], bounds[2 * k + 1] = (
            line + tracks.least[2 * k],
            line + tracks.least[2 * k + 1],
        )
    dx, dy = goal[0] - x, goal[1] - y
    distance = np.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return Departure(0.0, 0.0, 0.0, STRAIGHT, 0.0, 0.0)
    ux, uy = dx / distance, dy / distance
    if _is_free(x, y, ux, uy, distance, discs, near, -1):
        best = Departure(distance, ux, uy, STRAIGHT, 0.0, distance)
    # few are tried: sorting all of them, or the discs, takes longer
    while len(bounds) > 0:
        track = int(np.argmin(bounds))
        if bounds[track] >= best.distance:
            break
        bounds[track] = np.inf
        disc, sense = discs[track // 2], 1.0 - 2.0 * (track % 2)
        length, ux, uy = tangent(disc.x - x, disc.y - y, sense * disc.radius)
        at = angle(sense, ux, uy)
        node = following(tracks, track, at)
        distance = np.inf
        if node >= 0:
            distance = length + disc.radius * sweep(at, tracks.angle[node]) + tracks.togo[node]
        i = track // 2
        if distance < best.distance and _is_free(x, y, ux, uy, length, discs, near, i):
            best = Departure(distance, ux, uy, track, at, length)
    return best


@compiled
def _is_free(
    x: float, y: float, ux: float, uy: float, length: float, discs: Records, near: Array, one: int
) -> bool:
    """As `is_clear` among discs whose distances (n,) from (x, y) are in no order."""
    for k in range(len(discs)):
        if (
            near[k] < length
            and k != one
            and comes_within(discs[k].x - x, discs[k].y - y, discs[k].reach, ux, uy, length)
        ):
            return False
    return True


@compiled
def point_view(scene: Scene, x: float, y: float, tolerance: float) -> tuple[bool, Scene]:
    """Whether a point is free, and the scene that lines from the point must avoid.

    A point may lie inside an obstacle or outside the bounds by at most the tolerance [m]. A line
    from it may then enter that obstacle as deep as the point itself.
    """
    discs, box, shapes = scene.discs, scene.box, scene.shapes
    slack = tolerance - scene.margin
    free = box[0, 0] - slack <= x <= box[1, 0] + slack
    free = free and box[0, 1] - slack <= y <= box[1, 1] + slack
    copied = False
    for k in range(len(discs)):
        disc = discs[k]
        distance, radius = np.sqrt((disc.x - x) ** 2 + (disc.y - y) ** 2), disc.radius
        if distance >= radius:
            continue
        if not is_disc(shapes, k):
            distance, radius = nearest_feature(shapes, k, x, y).distance, shapes.radii[k]
        if distance < radius - tolerance:
            free = False
        elif distance < radius:
            if not copied:
                discs, copied = discs.copy(), True
                shapes = Shapes(shapes.first, shapes.corners, shapes.radii, shapes.reach.copy())
            if is_disc(shapes, k):
                discs[k].reach = min(disc.reach, distance - scene.margin)
            else:
                shapes.reach[k] = min(shapes.reach[k], distance - scene.margin)
    return free, Scene(discs, box, scene.margin, shapes)


@compiled
def straight(scene: Scene, around: View, x: float, y: float, goal: Array) -> Departure:
    """The straight line from a point to the goal, if it is free."""
    dx, dy = goal[0] - x, goal[1] - y
    distance = np.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return Departure(0.0, 0.0, 0.0, STRAIGHT, 0.0, 0.0)
    ux, uy = dx / distance, dy / distance
    if is_clear(x, y, ux, uy, distance, distance, scene, around, -1, -1):
        return Departure(distance, ux, uy, STRAIGHT, 0.0, distance)
    return Departure(np.inf, 0.0, 0.0, NOWHERE, 0.0, 0.0)


@compiled
def along_track(scene: Scene, tracks: Tracks, track: int, x: float, y: float) -> Departure:
    """The path from a point to the goal by a given track; collisions are not tested."""
    length, ux, uy, at = tangent_from(scene, track, x, y)
    node = following(tracks, track, at)
    distance = np.inf
    if node >= 0:
        distance = length + arc_length(scene, track, at, tracks.angle[node]) + tracks.togo[node]
    return Departure(distance, ux, uy, track, at, length)


@compiled
def shortest_departure(
    scene: Scene, tracks: Tracks, goal: Array, x: float, y: float, tolerance: float
) -> Departure:
    """How the shortest path from a point to the goal leaves the point."""
    if len(scene.shapes.first) == 0:
        return _departure_among_discs(
            scene.discs, scene.box, scene.margin, tracks, goal, x, y, tolerance
        )
    free, near = point_view(scene, x, y, tolerance)
    if not free:
        return Departure(np.inf, 0.0, 0.0, NOWHERE, 0.0, 0.0)
    discs, shapes = near.discs, near.shapes
    around = view(discs, x, y)
    best = straight(near, around, x, y, goal)
    bounds = np.empty(len(tracks.least))
    for track in range(len(bounds)):
        disc = discs[track // 2]
        square = (disc.x - x) ** 2 + (disc.y - y) ** 2 - disc.radius**2
        bounds[track] = np.sqrt(max(square, 0.0)) + tracks.least[track]
    for track in range(len(bounds) if len(shapes.first) > 0 else 0):
        if not is_disc(shapes, track // 2):
            bounds[track] = tracks.least[track]
            if tracks.least[track] < best.distance:
                bounds[track] += tangent_to_shape(shapes, near.margin, track, x, y).length
    for track in np.argsort(bounds):
        if bounds[track] >= best.distance:
            break
        way = along_track(near, tracks, track, x, y)
        i = track // 2
        if way.distance < best.distance and is_clear(
            x, y, way.ux, way.uy, way.line, way.line, near, around, i, i
        ):
            best = way
    return best


@compiled
def query(
    scene: Scene, tracks: Tracks, goal: Array, points: Array, tolerance: float
) -> tuple[Array, Array]:
    """Distance to the goal (n,) [m] and its gradient (n, 2) at points (n, 2)."""
    distance, gradient = np.empty(len(points)), np.empty(points.shape)
    for k in range(len(points)):
        way = shortest_departure(scene, tracks, goal, points[k, 0], points[k, 1], tolerance)
        distance[k] = way.distance
        gradient[k, 0], gradient[k, 1] = -way.ux, -way.uy
    return distance, gradient


@compiled
def turns_along(tracks: Tracks, way: Departure) -> list[tuple[int, float, float]]:
    """The turns of a path to the goal: track, and angles where each begins and ends."""
    turns = [(0, 0.0, 0.0) for _ in range(0)]
    track, at = way.track, way.at
    node = GOAL if track == STRAIGHT else following(tracks, track, at)
    while node != GOAL:
        node = tracks.leave[node]
        turns.append((track, at, at + sweep(at, tracks.angle[node])))
        node = tracks.other[node]
        if node != GOAL:
            track, at = tracks.track[node], tracks.angle[node]
    return turns
