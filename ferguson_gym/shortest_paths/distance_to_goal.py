"""The exact distance to the goal (the cost-to-go) from any point of a field, and the path.

It comes from the graph of all tangents; among many discs, from a search from the goal that is kept
and continued for each query; among many other obstacles, from the graph of those that paths from
the points asked for can meet.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.runtime.arrays import Array, finite
from ferguson_gym.shortest_paths.departures import (
    NOWHERE,
    Departure,
    query,
    shortest_departure,
    turns_along,
)
from ferguson_gym.shortest_paths.goal_search.queries import departure, shortest_leave, turns_of
from ferguson_gym.shortest_paths.goal_search.search import GoalSearch, begin_search
from ferguson_gym.shortest_paths.partial_graph import PartialGraph, covers, first_guess, wider
from ferguson_gym.shortest_paths.scene import Scene, scene
from ferguson_gym.shortest_paths.shapes import Integers, sweep
from ferguson_gym.shortest_paths.tangent_graph import Tracks, build
from ferguson_gym.shortest_paths.taut_path import ShortestPath, trace
from ferguson_gym.world.field import Field

T = TypeVar("T")

FEW = 200
"""Up to so many obstacles, paths come from the tangent graph that holds every tangent: flights and
lengths on record are kept to the last bit. Among more discs, a search makes the tangents it needs;
its lengths differ from those of the graph by rounding alone. If there are other shapes among them,
paths come from the tangent graph of a part of the obstacles, which grows with the queries."""


@dataclass(frozen=True, slots=True, eq=False)
class DistanceToGoal:
    """Length of the shortest path from any point to the goal of a field in the plane.

    Building it takes one search from the goal, and a query then looks at the tangents of a point.
    Among more than `FEW` obstacles a query continues what earlier ones began, until the value is
    known: the first one takes as long as a single shortest path, others near it much less.

    Raises:
        TypeError: a field that is not planar.
    """

    field: Field
    for_few_queries: bool = False
    """Among obstacles of other shapes, however few, paths then come from the graph of a part."""
    scene: Scene = dataclasses.field(init=False, repr=False)
    """The obstacles that can obstruct a path."""
    kept: Integers = dataclasses.field(init=False, repr=False)
    """(n,) the field's obstacle for each of those that tracks are numbered after."""
    tracks: Tracks | None = dataclasses.field(init=False, repr=False)
    """The tangent graph of all obstacles; None among many."""
    searches: list[GoalSearch] = dataclasses.field(init=False, repr=False)
    """Searches that no query is using at the moment. A query that was interrupted does not return
    its search, and another thread does not find it."""
    graphs: list[PartialGraph] = dataclasses.field(init=False, repr=False)
    """The latest graph of a part of many obstacles of other shapes, if one has been made."""

    def __post_init__(self) -> None:
        world, kept = scene(self.field)
        are_discs = self.field.obstacles.are_discs
        few = len(self.field.obstacles) <= FEW and (are_discs or not self.for_few_queries)
        tracks, searches = build(world, self.field.goal) if few else None, []
        if not few and are_discs:
            search, order = begin_search(world, self.field.goal, self.tolerance)
            searches, kept = [search], kept[order]
        for name, value in (
            ("scene", world),
            ("kept", kept),
            ("tracks", tracks),
            ("searches", searches),
            ("graphs", []),
        ):
            object.__setattr__(self, name, value)

    @property
    def tolerance(self) -> float:
        """Depth [m] by which a point may lie inside obstacles or outside the bounds."""
        return self.field.limits.tolerance

    def __call__(self, points: ArrayLike) -> tuple[Array, Array]:
        """Distance to the goal and its gradient.

        The gradient is minus the direction in which the path leaves: a unit vector except at the
        goal. Where two paths are equally short it belongs to one of them.

        Args:
            points: (n, 2) [m]. A point that violates obstacles or bounds by at most the tolerance
                counts as free; its path enters an obstacle no deeper than the point itself.

        Returns:
            Distance (n,) [m], infinite where there is no path or the point is not free, and
            gradient (n, 2), zero there.

        Raises:
            ValueError: another shape, NaN or infinity.
        """
        points = finite("points", points, (None, 2))
        if self.tracks is not None:
            return query(self.scene, self.tracks, self.field.goal, points, self.tolerance)
        if not self.field.obstacles.are_discs:
            return self.ask(points, lambda graph: self._queried(graph, points))[1]
        ways = [self.departure(x, y) for x, y in points]
        distance = np.array([way.distance for way in ways], dtype=np.float64)
        return distance, np.array([(-way.ux, -way.uy) for way in ways]).reshape(-1, 2)

    def departure(self, x: float, y: float) -> Departure:
        """How the shortest path from a point [m] leaves the point."""
        if self.tracks is not None:
            goal = self.field.goal
            return shortest_departure(self.scene, self.tracks, goal, x, y, self.tolerance)
        if not self.field.obstacles.are_discs:
            return self._left(x, y)[1]
        search, way = departure(self.borrow(), x, y, self.tolerance)
        self.searches.append(search)
        return way

    def path(self, point: ArrayLike) -> ShortestPath | None:
        """The shortest path from a point (2,) [m] to the goal, None if there is none.

        From a point in an arc's disc, within the tolerance, whose path begins with that arc, it
        starts on the obstacle's boundary.

        Raises:
            ValueError: another shape, NaN or infinity.
        """
        x, y = finite("point", point, (2,))
        graph: PartialGraph | None = None
        if self.tracks is None and self.field.obstacles.are_discs:
            search, leave = shortest_leave(self.borrow(), x, y, self.tolerance)
            turns = turns_of(search, leave)
            self.searches.append(search)
            length = leave.distance
            if length == np.inf:
                return None
            turns = [(track, at, at + sweep(at, until)) for track, at, until in turns]
        else:
            if (tracks := self.tracks) is None:
                graph, way = self._left(x, y)
                tracks = graph.tracks
            else:
                way = self.departure(x, y)
            if way.track == NOWHERE:
                return None
            length, turns = way.distance, turns_along(tracks, way)
        return self.traced((x, y), turns, length, graph)

    def traced(
        self,
        start: tuple[float, float],
        turns: list[tuple[int, float, float]],
        length: float,
        graph: PartialGraph | None = None,
    ) -> ShortestPath:
        """The path of a length [m] from a start [m] with some turns along tracks (of a graph)."""
        world, kept = (self.scene, self.kept) if graph is None else (graph.scene, graph.kept)
        return trace(self.field, world, kept, start, turns, length)

    def ask(
        self, points: Array, question: Callable[[PartialGraph], tuple[T, Array]]
    ) -> tuple[PartialGraph, T]:
        """What a graph answers that has all obstacles on which the answer depends.

        Args:
            points: (n, 2) from which paths lead to the goal [m].
            question: answers from a graph, with the lengths (n,) [m] up to which paths from the
                points count; infinite ones if there are no paths. It is asked until the graph
                covers these.
        """
        goal, discs, margin = self.field.goal, self.scene.discs, self.scene.margin
        parts = (self.scene, self.kept, goal)
        if not self.graphs:
            self.graphs.append(wider(*parts, None, points, first_guess(goal, points)))
        graph = self.graphs[-1]
        while True:
            answer, lengths = question(graph)
            more = ~covers(discs, graph.holds, goal, points, lengths, margin)
            if not more.any():
                return graph, answer
            graph = wider(*parts, graph, points[more], lengths[more])
            self.graphs[:] = [graph]

    def _left(self, x: float, y: float) -> tuple[PartialGraph, Departure]:
        """How the shortest path from a point [m] leaves it, and the graph that says so."""
        goal = self.field.goal

        def question(graph: PartialGraph) -> tuple[Departure, Array]:
            way = shortest_departure(graph.scene, graph.tracks, goal, x, y, self.tolerance)
            return way, np.array([way.distance])

        return self.ask(np.array([[x, y]]), question)

    def _queried(self, graph: PartialGraph, points: Array) -> tuple[tuple[Array, Array], Array]:
        """Distances and gradients from a graph, and the lengths up to which paths count."""
        found = query(graph.scene, graph.tracks, self.field.goal, points, self.tolerance)
        return found, found[0]

    def borrow(self) -> GoalSearch:
        """A search for the caller alone, who appends it to `searches` when it has been used."""
        try:
            return self.searches.pop()
        except IndexError:
            return begin_search(self.scene, self.field.goal, self.tolerance)[0]


@lru_cache(maxsize=2)
def distance_to_go(field: Field) -> DistanceToGoal:
    """The distance to the goal of a field, cached for the last two fields (by identity).

    Raises:
        TypeError: a field that is not planar.
    """
    return DistanceToGoal(field)
