"""Obstacles that touch without overlapping: doors of width zero, through which paths slip."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ferguson_gym.curves.convex_core import Cores
from ferguson_gym.curves.core_pairs import cores_gap
from ferguson_gym.curves.nearest_point import Rows
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles

_CIRCLE = 100.0
"""Radius of the circle around a point of contact on which gaps are looked for [tolerances]."""
_DIRECTIONS = 64
"""Number of points on this circle."""
_FLAT = 1e-9
"""Height up to which corners belong to a side that touches, as a fraction of the cores' size."""

Pairs = NDArray[np.int64]
"""Indices (n, 2) of obstacles, the lower one first."""


def touching_pairs(field: Field) -> Pairs:
    """Pairs of obstacles whose boundaries touch and whose insides do not overlap.

    Both hold up to the tolerance of the field's limits. An exact shortest path may pass between
    such obstacles; it closes if they are inflated (`Field.inflated`). Left out are pairs of shapes
    other than discs between which no path passes, since further obstacles close the place where
    they touch, as between the pieces of a building.

    Returns:
        (n, 2) indices of obstacles, the lower one first.
    """
    obstacles = field.obstacles
    if len(obstacles) < 2:
        return np.empty((0, 2), np.int64)
    tolerance = field.limits.tolerance
    near = _near_pairs(*obstacles.balls, tolerance)
    first, second = near.T
    if obstacles.are_discs:
        apart = np.linalg.norm(obstacles.centers[first] - obstacles.centers[second], axis=1)
    else:
        apart = _cores_apart(near, obstacles.cores, tuple(range(obstacles.dimension)))
    gap = apart - obstacles.radii[first] - obstacles.radii[second]
    touching: Pairs = near[np.abs(gap) <= tolerance]
    if obstacles.are_discs:
        return touching
    others = _neighbours(near, touching)
    passable = [
        _is_passable(obstacles, i, j, others[i] & others[j], tolerance)
        for i, j in touching.tolist()
    ]
    return touching[np.array(passable, dtype=np.bool_)]


def _neighbours(near: Pairs, touching: Pairs) -> dict[int, set[int]]:
    """The obstacles whose balls meet that of each obstacle that touches another."""
    found: dict[int, set[int]] = {k: set() for k in touching.ravel().tolist()}
    for i, j in near.tolist():
        if i in found:
            found[i].add(j)
        if j in found:
            found[j].add(i)
    return found


def _is_passable(obstacles: Obstacles, i: int, j: int, others: set[int], tolerance: float) -> bool:
    """Whether further obstacles leave a way through the place where two planar ones touch.

    A third one closes a common side if it contains both ends and has the middle inside. Where two
    touch at a point, at least two gaps between obstacles begin there, or no path passes.
    """
    if not others or obstacles.dimension != 2:
        return True
    ends = _contact(obstacles, i, j)
    third = obstacles.only_these(np.array(sorted(others)))
    around = _CIRCLE * tolerance
    if np.linalg.norm(ends[1] - ends[0]) > around:
        away = third.signed_distance(np.concatenate([ends, ends.mean(axis=0)[None]]))
        closed = (away[:2] <= tolerance).all(axis=0) & (away[2] < -tolerance)
        return not closed.any()
    along = np.angle(complex(*(_across(obstacles, i, j)[0] @ [[0.0, 1.0], [-1.0, 0.0]])))
    turn = along + 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    circle = ends.mean(axis=0) + around * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    every = Obstacles.joined([third, obstacles.only_these(np.array([i, j]))])
    free = (every.signed_distance(circle) >= -tolerance).all(axis=1)
    return int((free & ~np.roll(free, 1)).sum()) > 1


def _across(obstacles: Obstacles, i: int, j: int) -> tuple[Array, float]:
    """The unit vector (2,) across which one core is farthest from another, and how far [m].

    The distance is negative where cores overlap.
    """
    one, other = obstacles.core(i), obstacles.core(j)
    pairs = (other[None] - one[:, None]).reshape(-1, 2)
    sides = [np.roll(core, -1, axis=0) - core for core in (one, other) if len(core) > 1]
    normals = [side @ [[0.0, -1.0], [1.0, 0.0]] for side in sides]
    every = np.concatenate([*normals, *(-normal for normal in normals), pairs])
    size = np.linalg.norm(every, axis=1)
    least = _FLAT * size.max()
    every = every[size > least] / size[size > least, None]
    apart = (other @ every.T).min(axis=0) - (one @ every.T).max(axis=0)
    # the first of those that are equal but for rounding: that of a side if there is one
    best = int((apart >= apart.max() - least).argmax())
    return every[best], float(apart[best])


def _contact(obstacles: Obstacles, i: int, j: int) -> Array:
    """Both ends (2, 2) of the line along which two obstacles touch [m], equal at a point."""
    normal, apart = _across(obstacles, i, j)
    along = normal @ [[0.0, 1.0], [-1.0, 0.0]]
    one, other = obstacles.core(i), obstacles.core(j)
    least = _FLAT * max(float(np.ptp(one, axis=0).max()), float(np.ptp(other, axis=0).max()))
    height = float((one @ normal).max())
    mine = (one @ along)[one @ normal >= height - least]
    its = (other @ along)[other @ normal <= height + apart + least]
    low, high = max(mine.min(), its.min()), min(mine.max(), its.max())
    if low > high:
        low = high = 0.5 * (low + high)
    touch = height + float(obstacles.radii[i])
    contact: Array = np.outer([low, high], along) + touch * normal
    return contact


@compiled
def _cores_apart(pairs: Pairs, cores: Cores, axes: Rows) -> Array:
    """Signed distance between the cores of each pair (n,) [m]."""
    corners, first, apart = cores.corners, cores.first, np.empty(len(pairs))
    for k in range(len(pairs)):
        i, j = pairs[k]
        apart[k] = cores_gap(corners, first[i], first[i + 1], corners, first[j], first[j + 1], axes)
    return apart


def _near_pairs(centers: Array, radii: Array, tolerance: float) -> Pairs:
    """Pairs (n, 2) of balls that hold all that touch or overlap, and not many others.

    Balls are searched by classes of radii within a factor of 2, so that a few large ones do not
    pair every one with every other.
    """
    octave = np.floor(np.log2(radii / radii.min())).astype(np.int64)
    classes = [np.flatnonzero(octave == number) for number in np.unique(octave)]
    trees = [KDTree(centers[members]) for members in classes]
    found = [np.empty((0, 2), np.int64)]
    for a, b in combinations_with_replacement(range(len(classes)), 2):
        reach = float(radii[classes[a]].max() + radii[classes[b]].max()) + tolerance
        if a == b:
            pairs = classes[a][trees[a].query_pairs(reach, output_type="ndarray")]
        else:
            near = trees[a].sparse_distance_matrix(trees[b], reach, output_type="ndarray")
            pairs = np.column_stack([classes[a][near["i"]], classes[b][near["j"]]])
        found.append(np.sort(pairs, axis=1))
    return np.concatenate(found)
