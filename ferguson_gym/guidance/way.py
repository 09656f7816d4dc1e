"""The way from any point of a field to its goal, with a margin where there is room."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.guidance.margins import OUTSIDE, Solids, outside, solids, surroundings
from ferguson_gym.guidance.path_tree import PathTree, look_ahead, path_tree
from ferguson_gym.runtime.arrays import Array, finite
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.tangent_graph import build
from ferguson_gym.world.field import Field


class _Paths(NamedTuple):
    """Shortest paths to a goal."""

    togo: DistanceToGoal
    tree: PathTree | None
    """All of them; None among many discs, where each path is searched for."""
    solids: Solids
    """What a point is moved out of."""


class Way:
    """Points ahead on the shortest path that keeps a margin, and the distance to go along it.

    Obstacles are grown by the margin, or by less where that would close a passage as wide as the
    margin; from within a margin the way leads out of it first. Where no way keeps margins, it is
    the shortest path itself.

    Args:
        field: in the plane.
        margin: kept from obstacles where there is room [units of the field].

    Raises:
        ValueError: a field that is not planar.
    """

    def __init__(self, field: Field, margin: float) -> None:
        self._field = field
        self._kept = _paths(with_margin(field, margin))
        self._exact: _Paths | None = None

    def ahead(self, points: ArrayLike, distances: ArrayLike) -> tuple[Array, Array]:
        """Points ahead (m, n, 2) [m] and distances to go (m,) [m] from points (m, 2) [m].

        Points ahead stay on the goal once they have reached it. Without a way the distance is
        infinite, and all points ahead are the point itself.

        Args:
            points: (m, 2) [m].
            distances: (m, n) along the way, or (1, n) for all points, increasing in each row
                [units of the field].

        Raises:
            ValueError: arrays of another shape, NaN or infinity.
        """
        points = np.ascontiguousarray(finite("points", points, (None, 2)))
        distances = np.ascontiguousarray(finite("distances", distances, (None, None)))
        if len(distances) not in (1, len(points)):
            raise ValueError(f"need 1 or {len(points)} rows of distances, got {len(distances)}")
        places, togo = self._along(self._kept, points, distances)
        if (none := np.isinf(togo)).any():
            if self._exact is None:
                self._exact = _paths(DistanceToGoal(self._field))
            rows = distances[none] if len(distances) > 1 else distances
            there, left = self._along(self._exact, points[none], rows)
            there[np.isinf(left)] = points[none][np.isinf(left), None]
            places[none], togo[none] = there, left
        return places, togo

    def _along(self, paths: _Paths, points: Array, distances: Array) -> tuple[Array, Array]:
        """As `ahead`, on given paths; where there is none the points ahead mean nothing."""
        places, togo = np.empty((len(points), distances.shape[1], 2)), np.empty(len(points))
        if paths.tree is not None:
            look_ahead(paths.tree, points, distances, places, togo)
            return places, togo
        unit = self._field.limits.unit
        for i, point in enumerate(points):
            shown = unit * distances[i % len(distances)]
            x, y, found = outside(point[0], point[1], paths.solids, OUTSIDE * unit)
            path = paths.togo.path((x, y)) if found else None
            if path is None:
                togo[i] = np.inf
                continue
            away = np.array([x, y]) - point
            moved = float(np.linalg.norm(away))
            togo[i], places[i] = moved + path.length, path.at(shown - moved)
            if moved > 0.0:
                before = shown <= moved
                places[i, before] = point + shown[before, None] / moved * away
        return places, togo


def _paths(togo: DistanceToGoal) -> _Paths:
    return _Paths(togo, tree_of(togo), solids(togo.field.obstacles))


def with_margin(field: Field, margin: float) -> DistanceToGoal:
    """The distance to the goal along paths that keep a margin [units of the field]."""
    most = margin * field.limits.unit
    return surroundings(field, most, most).togo


def tree_of(togo: DistanceToGoal) -> PathTree | None:
    """The tree of all shortest paths of a field; None among many discs."""
    field, unit, tracks = togo.field, togo.field.limits.unit, togo.tracks
    if tracks is None:
        if field.obstacles.are_discs:
            return None
        tracks = build(togo.scene, field.goal)
    return path_tree(togo.scene, tracks, field.goal, togo.tolerance, unit, OUTSIDE * unit)
