"""Obstacles that touch without overlapping: doors of width zero, through which paths slip."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles


def touching_pairs(field: Field) -> NDArray[np.int64]:
    """Pairs of discs whose boundaries touch and whose insides do not overlap.

    Both hold up to the tolerance of the field's limits. An exact shortest path may pass between
    such discs; it closes if they are inflated (`Field.inflated`).

    Returns:
        (n, 2) indices of discs, the lower one first; empty for other obstacles.
    """
    discs = field.obstacles
    if not discs.are_discs or len(discs) < 2:
        return np.empty((0, 2), np.int64)
    tolerance = field.limits.tolerance
    near = _near_pairs(discs, tolerance)
    first, second = near.T
    offset = discs.centers[first] - discs.centers[second]
    gap = np.linalg.norm(offset, axis=1) - discs.radii[first] - discs.radii[second]
    touching: NDArray[np.int64] = near[np.abs(gap) <= tolerance]
    return touching


def _near_pairs(discs: Obstacles, tolerance: float) -> NDArray[np.int64]:
    """Pairs (n, 2) that hold all discs that touch, and not many others.

    Discs are searched by classes of radii within a factor of 2, so that a few large discs do not
    pair every disc with every other.
    """
    octave = np.floor(np.log2(discs.radii / discs.radii.min())).astype(np.int64)
    classes = [np.flatnonzero(octave == number) for number in np.unique(octave)]
    trees = [KDTree(discs.centers[members]) for members in classes]
    found = [np.empty((0, 2), np.int64)]
    for a, b in combinations_with_replacement(range(len(classes)), 2):
        reach = float(discs.radii[classes[a]].max() + discs.radii[classes[b]].max()) + tolerance
        if a == b:
            pairs = classes[a][trees[a].query_pairs(reach, output_type="ndarray")]
        else:
            near = trees[a].sparse_distance_matrix(trees[b], reach, output_type="ndarray")
            pairs = np.column_stack([classes[a][near["i"]], classes[b][near["j"]]])
        found.append(np.sort(pairs, axis=1))
    return np.concatenate(found)
