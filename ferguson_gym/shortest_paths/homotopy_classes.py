"""The best homotopy classes of paths from a point to the goal, each by its shortest path.

Among obstacles in the plane every homotopy class has exactly one taut path. Different routes
through the tangent graph are therefore shortest paths of different classes, except for routes that
differ only in a disc touched without turning; of these the tangent past the disc is kept. Routes
are extended best first (A*). The exact distance to the goal is known from every node and serves as
the heuristic, so that routes are completed in the order of their lengths.

Classes with loops are left out: a path whose lines cross, or that follows a part of a disc twice
in the same sense. Removing the loop would leave a shorter path of another class.

Reference:
    Hart, Nilsson & Raphael (1968), A formal basis for the heuristic determination of minimum cost
    paths, IEEE Transactions on Systems Science and Cybernetics 4.
"""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.runtime.arrays import Array, finite
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.distance_to_goal import (
    NOWHERE,
    STRAIGHT,
    DistanceToGoal,
    along_track,
    point_view,
    straight,
)
from ferguson_gym.shortest_paths.tangent_graph import WALL, Tracks, following, sweep
from ferguson_gym.shortest_paths.tangents import TWO_PI, Records, Scene, is_clear, view
from ferguson_gym.shortest_paths.taut_path import ShortestPath, trace
from ferguson_gym.world.field import Field

MIN_SWEEP = 1e-7
"""Arcs shorter than this angle [rad] count as touching; arcs within this angle of a full turn count
as loops."""


class Stage(NamedTuple):
    """A route up to the end of one of its lines."""

    parent: int
    """The preceding stage, -1 for the first line."""
    track: int
    """The track that is reached, STRAIGHT at the goal."""
    at: float
    """Angle at which it is reached [rad]."""
    turn: float
    """Sweep along the parent's track before the line [rad]."""
    length: float
    """Length of the route so far [m]."""
    x: float
    """Start of the line [m]."""
    y: float
    end_x: float
    """End of the line [m]."""
    end_y: float


@compiled
def _point(discs: Records, track: int, at: float) -> tuple[float, float]:
    """The point of a track at an angle."""
    disc, sense = discs[track // 2], 1.0 - 2.0 * (track % 2)
    return disc.x + disc.radius * np.cos(at), disc.y + sense * disc.radius * np.sin(at)


@compiled
def _line_length(stage: Stage) -> float:
    """Length of a stage's line [m]."""
    long: float = np.hypot(stage.end_x - stage.x, stage.end_y - stage.y)
    return long


@compiled
def _separated(one: Stage, other: Stage, least: float) -> bool:
    """Whether the ends of one line lie on different sides of another, `least` [m] away or more."""
    dx, dy = other.end_x - other.x, other.end_y - other.y
    least *= _line_length(other)
    start = dx * (one.y - other.y) - dy * (one.x - other.x)
    end = dx * (one.end_y - other.y) - dy * (one.end_x - other.x)
    separated: bool = min(start, end) < -least and max(start, end) > least
    return separated


@compiled
def _has_loop(stages: list[Stage], index: int, discs: Records, margin: float) -> bool:
    """Whether a stage's last arc or line meets an earlier part of its route."""
    last = stages[index]
    if last.parent < 0:
        return False
    arc = stages[last.parent]
    # beyond half a turn, the tangents at an arc's ends meet in front of the disc
    ahead = discs[arc.track // 2].radius * math.tan(0.5 * (TWO_PI - last.turn))
    if last.turn > 0.5 * TWO_PI and min(_line_length(last), _line_length(arc)) > ahead:
        return True
    least = 1e-3 * margin  # lines that touch do not cross
    before, turn = arc.parent, arc.turn
    while before >= 0:
        stage = stages[before]
        if _separated(last, stage, least) and _separated(stage, last, least):
            return True
        # this stage's track is left after `turn`
        if stage.track == arc.track and (
            sweep(stage.at, arc.at) <= turn or sweep(arc.at, stage.at) <= last.turn
        ):
            return True
        before, turn = stage.parent, stage.turn
    return False


@compiled
def _search(
    scene: Scene, tracks: Tracks, goal: Array, x: float, y: float, tolerance: float, k: int
) -> tuple[list[Stage], list[int]]:
    """All stages of the search, and the indices of the last stages of the k best routes."""
    stages = [Stage(-1, STRAIGHT, 0.0, 0.0, 0.0, x, y, x, y) for _ in range(0)]
    ends = [0 for _ in range(0)]
    heap = [(0.0, 0) for _ in range(0)]
    free, discs = point_view(scene, x, y, tolerance)
    if not free:
        return stages, ends
    around = view(discs, x, y)
    way = straight(discs, around, x, y, goal)
    if way.track != NOWHERE:
        heap.append((way.distance, 0))
        stages.append(Stage(-1, STRAIGHT, 0.0, 0.0, way.line, x, y, goal[0], goal[1]))
    for track in range(len(tracks.least)):
        way = along_track(discs, tracks, track, x, y)
        i = track // 2
        if way.distance < np.inf and is_clear(
            x, y, way.ux, way.uy, way.line, way.line, discs, around, i, i
        ):
            end_x, end_y = _point(discs, track, way.at)
            heap.append((way.distance, len(stages)))
            stages.append(Stage(-1, track, way.at, 0.0, way.line, x, y, end_x, end_y))
    heapq.heapify(heap)
    while len(heap) > 0 and len(ends) < k:
        index = heapq.heappop(heap)[1]
        if _has_loop(stages, index, discs, scene.margin):
            continue
        stage = stages[index]
        track = stage.track
        if track == STRAIGHT:
            ends.append(index)
            continue
        node = following(tracks, track, stage.at)
        for _ in range(tracks.first[track + 1] - tracks.first[track]):
            if tracks.other[node] == WALL:
                break
            other = tracks.other[node]
            togo = tracks.togo[other] if other >= 0 else 0.0
            turn = sweep(stage.at, tracks.angle[node])
            if (
                tracks.line[node] >= 0.0
                and togo < np.inf
                and MIN_SWEEP <= turn <= TWO_PI - MIN_SWEEP
            ):
                px, py = _point(discs, track, tracks.angle[node])
                length = stage.length + turn * discs[track // 2].radius + tracks.line[node]
                heapq.heappush(heap, (length + togo, len(stages)))
                if other >= 0:
                    there, at = tracks.track[other], tracks.angle[other]
                    qx, qy = _point(discs, there, at)
                    stages.append(Stage(index, there, at, turn, length, px, py, qx, qy))
                else:
                    stages.append(
                        Stage(index, STRAIGHT, 0.0, turn, length, px, py, goal[0], goal[1])
                    )
            node = node + 1 if node + 1 < tracks.first[track + 1] else tracks.first[track]
    return stages, ends


def classes(distance: DistanceToGoal, point: ArrayLike, k: int) -> list[ShortestPath]:
    """As `best_classes`, for a field whose distance to the goal is known."""
    x, y = finite("point", point, (2,))
    if k < 1:
        raise ValueError(f"at least 1 class must be asked for, got {k}")
    stages, ends = _search(
        distance.scene, distance.tracks, distance.field.goal, x, y, distance.tolerance, k
    )
    paths = []
    for end in ends:
        turns = []
        stage = stages[end]
        while stage.parent >= 0:
            parent = stages[stage.parent]
            turns.append((parent.track, parent.at, parent.at + stage.turn))
            stage = parent
        paths.append(
            trace(
                distance.field,
                distance.kept,
                (x, y),
                turns[::-1],
                stages[end].length,
                distance.scene.margin,
            )
        )
    # sorted, since the last digit of a length depends on the order of its summands
    return sorted(paths, key=lambda path: path.length)


def best_classes(field: Field, point: ArrayLike, k: int) -> list[ShortestPath]:
    """The best homotopy classes of paths from a point to a field's goal.

    Args:
        field: of discs in the plane.
        point: (2,) [m], free as in `DistanceToGoal`.
        k: number of classes.

    Returns:
        The shortest path of each class, the shortest class first; fewer than k if there are
        no more without loops, and an empty list if there is no path.

    Raises:
        TypeError: obstacles other than discs in the plane.
        ValueError: a point of another shape, NaN or infinity; k below 1.
    """
    return classes(DistanceToGoal(field), point, k)
