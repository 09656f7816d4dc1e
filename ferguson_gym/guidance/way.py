"""The way from any point of a field to its goal, with a margin where there is room."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.guidance.margins import OUTSIDE, surroundings
from ferguson_gym.guidance.path_tree import PathTree, look_ahead, path_tree
from ferguson_gym.runtime.arrays import Array, finite
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.world.field import Field

SPACING = 0.25
"""Distance between points on a path among many discs, from which others are interpolated
[units of the field]."""


class Way:
    """Points ahead on the shortest path that keeps a margin, and the distance to go along it.

    Discs are grown by the margin, or by less where that would close a passage as wide as the
    margin; from within a margin the way leads out of it first. Where no way keeps margins, it is
    the shortest path itself.

    Args:
        field: of discs in the plane.
        margin: kept from discs where there is room [units of the field].
        distances: (n,) along the way at which points are shown, increasing [units of the field].

    Raises:
        TypeError: obstacles other than discs.
        ValueError: a field that is not planar; distances that are not finite.
    """

    def __init__(self, field: Field, margin: float, distances: ArrayLike) -> None:
        self._field = field
        self._distances = finite("distances", distances, (None,))
        self._kept = with_margin(field, margin)
        self._exact: DistanceToGoal | None = None
        self.tree = tree_of(self._kept)
        """The paths that keep the margin; None among many discs."""

    def ahead(self, points: Array) -> tuple[Array, Array]:
        """Points ahead (m, n, 2) [m] and distances to go (m,) [m] from points (m, 2) [m].

        Points ahead stay on the goal once they have reached it. Without a way the distance is
        infinite, and all points ahead are the point itself.
        """
        points = np.ascontiguousarray(points)
        places, togo = self._along(self._kept, self.tree, points)
        if (none := np.isinf(togo)).any():
            if self._exact is None:
                self._exact = DistanceToGoal(self._field)
            there, left = self._along(self._exact, tree_of(self._exact), points[none])
            there[np.isinf(left)] = points[none][np.isinf(left), None]
            places[none], togo[none] = there, left
        return places, togo

    def _along(
        self, paths: DistanceToGoal, tree: PathTree | None, points: Array
    ) -> tuple[Array, Array]:
        """As `ahead`, on given paths; where there is none the points ahead mean nothing."""
        places, togo = np.empty((len(points), len(self._distances), 2)), np.empty(len(points))
        if tree is not None:
            look_ahead(tree, points, self._distances, places, togo)
            return places, togo
        unit = self._field.limits.unit
        for i, point in enumerate(points):
            path = paths.path(point)
            togo[i] = np.inf if path is None else path.length
            if path is not None:
                spots = path.points(SPACING * unit)
                chords = np.linalg.norm(np.diff(spots, axis=0), axis=1)
                along = np.concatenate([[0.0], np.cumsum(chords)])
                shown = unit * self._distances
                places[i] = np.column_stack([np.interp(shown, along, axis) for axis in spots.T])
        return places, togo


def with_margin(field: Field, margin: float) -> DistanceToGoal:
    """The distance to the goal along paths that keep a margin [units of the field]."""
    most = margin * field.limits.unit
    return surroundings(field, most, most).togo


def tree_of(togo: DistanceToGoal) -> PathTree | None:
    """The tree of all shortest paths of a field; None among many discs."""
    if togo.tracks is None:
        return None
    field, unit = togo.field, togo.field.limits.unit
    return path_tree(togo.scene, togo.tracks, field.goal, togo.tolerance, unit, OUTSIDE * unit)
