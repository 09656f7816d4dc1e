"""The best homotopy classes of paths from a point to the goal, each by its shortest path.

Among obstacles in the plane every homotopy class has exactly one taut path. Different routes
through the tangent graph are therefore shortest paths of different classes, except for routes that
differ only in an obstacle touched without turning; of these the tangent past it is kept. Where
obstacles have a corner or a part of an edge in common, routes along one and the other are the same
path, and one of them is kept. Routes
are extended best first (A*). The exact distance to the goal is known from every node and serves as
the heuristic, so that routes are completed in the order of their lengths. Among many discs see
`goal_search.class_search`.

Classes with loops are left out: a path whose lines cross, or that follows a part of an obstacle
twice in the same sense. Removing the loop would leave a shorter path of another class.

Reference:
    Hart, Nilsson & Raphael (1968), A formal basis for the heuristic determination of minimum cost
    paths, IEEE Transactions on Systems Science and Cybernetics 4.
"""

from __future__ import annotations

import heapq
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.runtime.arrays import Array, finite
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.departures import (
    NOWHERE,
    STRAIGHT,
    along_track,
    point_view,
    straight,
)
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.goal_search.class_search import find_classes
from ferguson_gym.shortest_paths.partial_graph import PartialGraph
from ferguson_gym.shortest_paths.routes import MIN_SWEEP, Stage, has_loop
from ferguson_gym.shortest_paths.scene import Scene, is_clear, view
from ferguson_gym.shortest_paths.shapes import TWO_PI, sweep
from ferguson_gym.shortest_paths.tangent_graph import WALL, Tracks, following
from ferguson_gym.shortest_paths.tangents import arc_length, point_of
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world.field import Field

_Routes: TypeAlias = tuple[list[tuple[float, int]], list[tuple[int, float, float]]]
"""Length [m] and number of turns of each route; and the turns of all: track, and both angles."""
_ALL = 1e300
"""A length that makes all obstacles matter [m]."""
_MOST_COPIES = 16
"""Up to so many times the routes are found that are asked for, if copies are among them."""


@compiled
def _search(
    scene: Scene, tracks: Tracks, goal: Array, x: float, y: float, tolerance: float, k: int
) -> tuple[list[Stage], list[int]]:
    """All stages of the search, and the indices of the last stages of the k best routes."""
    stages = [Stage(-1, STRAIGHT, 0.0, 0.0, 0.0, x, y, x, y) for _ in range(0)]
    ends = [0 for _ in range(0)]
    heap = [(0.0, 0) for _ in range(0)]
    free, near = point_view(scene, x, y, tolerance)
    if not free:
        return stages, ends
    around = view(near.discs, x, y)
    way = straight(near, around, x, y, goal)
    if way.track != NOWHERE:
        heap.append((way.distance, 0))
        stages.append(Stage(-1, STRAIGHT, 0.0, 0.0, way.line, x, y, goal[0], goal[1]))
    for track in range(len(tracks.least)):
        way = along_track(near, tracks, track, x, y)
        i = track // 2
        if way.distance < np.inf and is_clear(
            x, y, way.ux, way.uy, way.line, way.line, near, around, i, i
        ):
            end_x, end_y = point_of(scene, track, way.at)
            heap.append((way.distance, len(stages)))
            stages.append(Stage(-1, track, way.at, 0.0, way.line, x, y, end_x, end_y))
    heapq.heapify(heap)
    while len(heap) > 0 and len(ends) < k:
        index = heapq.heappop(heap)[1]
        if has_loop(stages, index, scene.discs, scene.shapes, scene.margin):
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
                px, py = point_of(scene, track, tracks.angle[node])
                arc = arc_length(scene, track, stage.at, tracks.angle[node])
                length = stage.length + arc + tracks.line[node]
                heapq.heappush(heap, (length + togo, len(stages)))
                if other >= 0:
                    there, at = tracks.track[other], tracks.angle[other]
                    qx, qy = point_of(scene, there, at)
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
    number = k
    while True:
        found = _found(distance, x, y, number)
        if distance.field.obstacles.are_discs:
            return found
        distinct = _distinct(found, distance.tolerance)
        if len(distinct) >= k or len(found) < number or number >= _MOST_COPIES * k:
            return distinct[:k]
        number *= 2


def _found(distance: DistanceToGoal, x: float, y: float, k: int) -> list[ShortestPath]:
    """The k shortest routes from a point, the shortest first."""
    graph: PartialGraph | None = None
    if distance.tracks is not None:
        found, every = _routes(distance, distance.scene, distance.tracks, x, y, k)
    elif distance.field.obstacles.are_discs:
        search, found, every = find_classes(distance.borrow(), x, y, distance.tolerance, k)
        distance.searches.append(search)
    else:

        def question(graph: PartialGraph) -> tuple[_Routes, Array]:
            routes = _routes(distance, graph.scene, graph.tracks, x, y, k)
            most = max((length for length, _ in routes[0]), default=np.inf)
            # more obstacles can make more routes where there is one
            return routes, np.array([_ALL if 0 < len(routes[0]) < k else most])

        graph, (found, every) = distance.ask(np.array([[x, y]]), question)
    paths = []
    for length, number in found:
        # the last turn comes first
        turns, every = every[:number][::-1], every[number:]
        paths.append(distance.traced((x, y), turns, length, graph))
    # sorted, since the last digit of a length depends on the order of its summands
    return sorted(paths, key=lambda path: path.length)


def _routes(
    distance: DistanceToGoal, scene: Scene, tracks: Tracks, x: float, y: float, k: int
) -> _Routes:
    """The k shortest routes in a graph."""
    goal, tolerance = distance.field.goal, distance.tolerance
    stages, ends = _search(scene, tracks, goal, x, y, tolerance, k)
    found, every = list[tuple[float, int]](), list[tuple[int, float, float]]()
    for end in ends:
        count, stage = len(every), stages[end]
        while stage.parent >= 0:
            parent = stages[stage.parent]
            every.append((parent.track, parent.at, parent.at + stage.turn))
            stage = parent
        found.append((stages[end].length, len(every) - count))
    return found, every


def _distinct(paths: list[ShortestPath], tolerance: float) -> list[ShortestPath]:
    """The paths without copies, that turn on other obstacles at the same places."""
    distinct = list[ShortestPath]()
    for path in paths:
        if not any(_is_same(path, one, tolerance) for one in distinct):
            distinct.append(path)
    return distinct


def _is_same(one: ShortestPath, other: ShortestPath, tolerance: float) -> bool:
    """Whether two paths from the same point turn at the same places, up to a tolerance [m]."""
    if abs(one.length - other.length) > tolerance:
        return False
    places, others = _turning_places(one, tolerance), _turning_places(other, tolerance)
    return len(places) == len(others) and bool((np.abs(places - others) <= tolerance).all())


def _turning_places(path: ShortestPath, tolerance: float) -> Array:
    """Where a path turns, beyond a tolerance [m] from its start: (n, 2) [m]."""
    places: Array = path.lines[:-1, 1][path.sweeps > MIN_SWEEP]
    apart = np.linalg.norm(places - path.lines[0, 0], axis=1)
    return places[np.cumsum(apart > tolerance) > 0]


def best_classes(field: Field, point: ArrayLike, k: int) -> list[ShortestPath]:
    """The best homotopy classes of paths from a point to a field's goal.

    Args:
        field: in the plane.
        point: (2,) [m], free as in `DistanceToGoal`.
        k: number of classes.

    Returns:
        The shortest path of each class, the shortest class first; fewer than k if there are
        no more without loops, and an empty list if there is no path. Among more than `FEW`
        discs, only classes no longer than `LONGEST` times the shortest path are found.

    Raises:
        TypeError: a field that is not planar.
        ValueError: a point of another shape, NaN or infinity; k below 1.
    """
    return classes(DistanceToGoal(field), point, k)
