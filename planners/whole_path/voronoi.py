"""Routes along the Voronoi diagram of the obstacles' cores.

A core is represented by points on its boundary, a disc's by its centre, and the bounds by points
along them, so that the diagram is bounded and has edges between the outermost obstacles and the
bounds. Edges that enter an obstacle or leave the bounds are removed. Start and goal are connected
to every visible vertex, and to each other if the line between them is clear; if they were connected
to the nearest vertices only, results would depend on how many vertices lie in a corner of the
bounds. The route is the shortest path in this graph.

The method ignores radii, and so does this implementation. An edge is equally far from two cores,
not from two obstacles: beside a larger disc it may collide although there is room.

Reference:
    The paper, section I, on its reference [1] by Beard and McLain.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.scene import Scene
from ferguson_gym.world import Field, transition
from planners.interface import Route
from planners.whole_path.line_of_sight import lines_clear, scene_from

_FINER = 5.0
"""Points along cores are so many times denser than those along the bounds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VoronoiEdges:
    """Routes along the clear edges of the diagram.

    Raises:
        ValueError: a side without points.
    """

    per_side: int = 24
    """Number of points along each side of the bounds: one every 5 m in the paper's fields."""

    def __post_init__(self) -> None:
        if self.per_side < 1:
            raise ValueError(f"each side needs at least 1 point, got {self.per_side}")

    def route(self, field: Field, vehicle: transition.State, seed: int) -> Route | None:
        """Find the shortest route from the vehicle to the goal; the seed has no effect.

        Raises:
            TypeError: a field that is not planar.
        """
        # a third of the time in which all planners are imported, and only this one needs them
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra
        from scipy.spatial import Voronoi

        began = time.perf_counter()
        scene = scene_from(field, vehicle.position)
        if scene is None:
            return None
        apart = float((field.bounds[1] - field.bounds[0]).mean()) / (_FINER * self.per_side)
        cores = _on_boundaries(scene, apart)
        diagram = Voronoi(np.concatenate([cores, _along(field.bounds, self.per_side)]))
        points = np.concatenate([diagram.vertices, [vehicle.position, field.goal]])
        start, goal = len(points) - 2, len(points) - 1
        ridges = np.array(diagram.ridge_vertices)
        edges = np.concatenate(
            [
                ridges[(ridges >= 0).all(axis=1)],  # the others have no end
                np.column_stack([np.full(start, start), np.arange(start)]),
                np.column_stack([np.full(goal, goal), np.arange(goal)]),
            ]
        )
        edges = edges[lines_clear(scene, points[edges[:, 0]], points[edges[:, 1]])]
        lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
        graph = csr_array((lengths, (edges[:, 0], edges[:, 1])), shape=(goal + 1, goal + 1))
        togo, after = dijkstra(graph, directed=False, indices=goal, return_predecessors=True)
        if togo[start] == np.inf:
            return None
        way = [start]
        while way[-1] != goal:
            way.append(int(after[way[-1]]))
        length = float(togo[start])
        found = time.perf_counter() - began, length
        return Route(points=points[way], length=length, progress=[found])


def _on_boundaries(scene: Scene, apart: float) -> Array:
    """Points (m, 2) on the boundaries of all cores, neighbours at most `apart` apart [m]."""
    first, corners = scene.shapes.first, scene.shapes.corners
    if len(first) == 0:
        return np.column_stack([scene.discs["x"], scene.discs["y"]])
    points = np.column_stack([corners["x"], corners["y"]])
    after = np.arange(1, len(points) + 1)
    after[first[1:] - 1] = first[:-1]
    edges = points[after] - points
    parts = np.maximum(np.ceil(np.linalg.norm(edges, axis=1) / apart), 1.0).astype(np.int64)
    # the way back along a line has the points of the way there, and one corner is left
    parts[first[:-1][np.diff(first) == 2] + 1] = 1
    step = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    share = (step / np.repeat(parts, parts))[:, None]
    along: Array = np.repeat(points, parts, axis=0) + share * np.repeat(edges, parts, axis=0)
    return along


def _along(bounds: Array, per_side: int) -> Array:
    """Points (4 per_side, 2) along the bounds [m], corners among them."""
    (left, low), (right, high) = bounds
    corners = np.array([[left, low], [right, low], [right, high], [left, high]])
    share = np.linspace(0.0, 1.0, per_side, endpoint=False)[:, None, None]
    along: Array = corners + share * (np.roll(corners, -1, axis=0) - corners)
    return along.reshape(-1, 2)
