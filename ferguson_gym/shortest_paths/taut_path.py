"""A path of straight lines and arcs along discs and the corners of obstacles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.scene import Scene
from ferguson_gym.shortest_paths.shapes import TWO_PI, Shapes, corner_at, end_of, next_corner
from ferguson_gym.shortest_paths.tangents import tangent_from
from ferguson_gym.world.field import Field

MAX_POINTS = 100_000
"""Upper limit of points on a line or arc: one every 0.25 m of 25 km."""
_ROUNDING = 1e-9
"""Angles of a boundary that differ by less may be the same [rad]."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ShortestPath:
    """The shortest path of its class: a line, an arc, a line, and so on; the last is a line.

    Lines touch the arcs between them, so that the direction never jumps; edges of obstacles are
    lines, too. Lines and arcs may be of length zero: where the path starts or ends on an
    obstacle, passes from one to another that touches it, or touches one without turning. A
    corner of radius zero is an arc on which the path turns on the spot.
    """

    length: float
    """[m]."""
    lines: Array
    """Start and end of each line, (m + 1, 2, 2) [m]."""
    discs: NDArray[np.int64]
    """(m,) index of each arc's obstacle in the field."""
    senses: NDArray[np.int64]
    """(m,) +1 where it turns left, the obstacle on its left; -1 where it turns right."""
    centers: Array
    """(m, 2) of the arcs [m]."""
    radii: Array
    """(m,) of the arcs [m], zero and more."""
    angles: Array
    """(m, 2) direction from the centre to each arc's start and end [rad]; it grows along an
    arc that turns left and falls along one that turns right."""

    @property
    def sweeps(self) -> Array:
        """Angle by which each arc turns, (m,) [rad], never negative."""
        turns: Array = np.abs(self.angles[:, 1] - self.angles[:, 0])
        return turns

    def at(self, distances: Array) -> Array:
        """Points (n, 2) [m] at distances (n,) along the path [m]: its ends before and beyond it."""
        straights = np.linalg.norm(self.lines[:, 1] - self.lines[:, 0], axis=1)
        lengths = np.zeros(2 * len(straights) - 1)  # line, arc, line, and so on
        lengths[::2], lengths[1::2] = straights, self.radii * self.sweeps
        ends = np.cumsum(lengths)
        pieces = np.minimum(np.searchsorted(ends, distances), len(lengths) - 1)
        # a piece of length zero is its end
        beyond = np.clip(ends[pieces] - distances, 0.0, lengths[pieces])
        share = 1.0 - beyond / np.where(lengths[pieces] > 0.0, lengths[pieces], 1.0)
        spots = np.empty((len(distances), 2))
        on_line, k = pieces % 2 == 0, pieces // 2
        start, end = self.lines[k[on_line], 0], self.lines[k[on_line], 1]
        spots[on_line] = start + share[on_line, None] * (end - start)
        arc = k[~on_line]
        first, last = self.angles[arc].T
        angle = first + share[~on_line] * (last - first)
        around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        spots[~on_line] = self.centers[arc] + self.radii[arc, None] * around
        return spots

    def points(self, spacing: float) -> Array:
        """Points on the path from its start to its end, (n, 2) [m].

        Args:
            spacing: greatest distance of neighbours along the path [m], unless a line or arc would
                need more than `MAX_POINTS` of them. Ends of lines and arcs are among the points.
                Chords between points of an arc cut into its disc, by at most
                spacing^2 / (8 radius).

        Raises:
            ValueError: a spacing that is not positive.
        """
        if not spacing > 0.0:
            raise ValueError(f"spacing must be positive, got {spacing} m")
        parts = [self.lines[0, :1]]
        for k, (start, end) in enumerate(self.lines):
            share = _shares(math.dist(start, end), spacing)[:, None]
            parts.append(start + share * (end - start))
            if k < len(self.discs):
                first, last = self.angles[k]
                share = _shares(self.radii[k] * abs(last - first), spacing)
                angle = first + share * (last - first)
                around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
                parts.append(self.centers[k] + self.radii[k] * around)
        return np.concatenate(parts)


def trace(
    field: Field,
    scene: Scene,
    kept: NDArray[np.int64],
    start: Sequence[float],
    turns: Sequence[tuple[int, float, float]],
    length: float,
) -> ShortestPath:
    """The path to a field's goal with some turns.

    Args:
        field: in the plane.
        scene: of the field.
        kept: (n,) the field's obstacle for each of those that tracks are numbered after.
        start: (2,) [m]; in a disc that the path goes round first, the path starts on its boundary.
        turns: a track and the angles of its ends, in its sense, for each turn.
        length: of the path [m].
    """
    obstacles, are_discs = field.obstacles, field.obstacles.are_discs
    corners = np.empty(0, np.int64)
    if not are_discs:
        arcs = [arc for turn in turns for arc in _arcs(scene.shapes, *turn)]
        corners = np.array([arc[1] for arc in arcs], dtype=np.int64)
        turns = [(track, begin, end) for track, _, begin, end in arcs]
    where = np.array([turn[0] for turn in turns], dtype=np.int64)
    senses = 1 - 2 * (where % 2)
    discs = kept[where // 2]
    # from the track's sense to the usual one
    angles = senses[:, None] * np.array([turn[1:] for turn in turns]).reshape(-1, 2)
    radii = obstacles.radii[discs]
    centers = obstacles.points[discs]
    if not are_discs:
        centers = np.stack([scene.shapes.corners[axis][corners] for axis in "xy"], axis=-1)
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    ends = centers[:, None] + radii[:, None, None] * around
    inside = len(turns) > 0 and math.dist(start, centers[0]) < radii[0] - scene.margin
    # beside an edge the path leads to its end instead
    if inside and (are_discs or tangent_from(scene, where[0], start[0], start[1]).length == 0.0):
        start = ends[0, 0]
    knots = np.concatenate([[start], ends.reshape(-1, 2), [field.goal]])
    return ShortestPath(
        length=length,
        lines=knots.reshape(-1, 2, 2),
        discs=discs,
        senses=senses,
        centers=centers,
        radii=radii,
        angles=angles,
    )


def _arcs(
    shapes: Shapes, track: int, at: float, until: float
) -> list[tuple[int, int, float, float]]:
    """The arcs of a turn along a track: the track, the corner, and angles in the track's sense."""
    i, clockwise = track // 2, track % 2 == 1
    begin, end = (-until, -at) if clockwise else (at, until)
    corner, last = (corner_at(shapes, i, angle % TWO_PI) for angle in (begin, end))
    number = int(shapes.first[i + 1] - shapes.first[i])
    passed = (last - corner) % number
    if passed == 0 and end - begin > 0.5 * TWO_PI:
        passed = number if number > 1 else 0
    arcs = []
    for _ in range(passed):
        wide = (end_of(shapes, i, corner) - begin) % TWO_PI
        # at the very end of a range, rounding may have passed it
        until = begin + (wide if wide < TWO_PI - _ROUNDING else 0.0)
        arcs.append((track, corner, begin, until))
        corner = next_corner(shapes, i, corner)
        begin = until
    arcs.append((track, corner, begin, end))
    if clockwise:
        return [(track, corner, -end, -begin) for track, corner, begin, end in reversed(arcs)]
    return arcs


def _shares(length: float, spacing: float) -> Array:
    """Fractions of a line or arc at which its points lie, without 0; empty for zero length."""
    number = min(math.ceil(length / spacing), MAX_POINTS)
    return np.arange(1, number + 1) / max(number, 1)
