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

Pairs = NDArray[np.int64]
"""Indices (n, 2) of obstacles, the lower one first."""


def touching_pairs(field: Field) -> Pairs:
    """Pairs of obstacles whose boundaries touch and whose insides do not overlap.

    Both hold up to the tolerance of the field's limits. An exact shortest path may pass between
    such obstacles; it closes if they are inflated (`Field.inflated`).

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
    return touching


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
