"""Trees of shortest paths of many fields in arrays that one compiled call reads."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.guidance.forest import Forest, look_ahead_each
from ferguson_gym.guidance.path_tree import NODE, PathTree
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.shapes import CORNER, Integers

A = TypeVar("A", bound=NDArray[Any])

MOST_BYTES = 2**28
"""Memory that a pool may take before its owner should forget its trees and make them again."""


class TreePool:
    """Trees by number, one behind the other in three arrays that grow by doubling."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all trees."""
        numbers, first, nodes = np.empty(4096), np.empty(1024, np.int64), np.empty(1024, NODE)
        corners = np.empty(64, CORNER)
        self._forest = Forest(np.empty((64, 6), np.int64), numbers, first, nodes, corners)
        self._number, self._used = 0, [0, 0, 0, 0]

    def __len__(self) -> int:
        return self._number

    @property
    def is_full(self) -> bool:
        """Whether the trees take more memory than `MOST_BYTES`."""
        return sum(array.nbytes for array in self._forest) > MOST_BYTES

    def add(self, tree: PathTree) -> int:
        """Keep a tree; returns its number, which holds until `clear`."""
        shapes, old = tree.shapes, self._forest
        parts = (tree.discs, tree.least, tree.frame, shapes.radii, shapes.reach)
        numbers = np.concatenate([part.ravel() for part in parts])
        first = np.concatenate([tree.first, shapes.first])
        at_numbers, at_first, at_nodes, at_corners = self._used
        row = [tree.discs.shape[1], at_numbers, at_first, at_nodes, len(shapes.corners), at_corners]
        self._forest = Forest(
            _with(old.parts, self._number, np.array([row])),
            _with(old.numbers, at_numbers, numbers),
            _with(old.first, at_first, first),
            _with(old.nodes, at_nodes, tree.nodes),
            _with(old.corners, at_corners, shapes.corners),
        )
        self._used = [
            at_numbers + len(numbers),
            at_first + len(first),
            at_nodes + len(tree.nodes),
            at_corners + len(shapes.corners),
        ]
        self._number += 1
        return self._number - 1

    def look_ahead(self, which: Integers, points: Array, distances: Array) -> tuple[Array, Array]:
        """Points ahead (m, n, 2) [m] and distances to go (m,) [m], on paths with margins.

        Args:
            which: (m,) numbers of trees; the distance is infinite for those below zero.
            points: (m, 2) [m], each among the discs of its tree.
            distances: (m, n) along the way at which points are shown, or (1, n) for all of them,
                increasing in each row [units of the field].
        """
        places, togo = np.empty((len(points), distances.shape[1], 2)), np.empty(len(points))
        look_ahead_each(self._forest, which, points, distances, places, togo)
        return places, togo


def _with(array: A, used: int, part: A) -> A:
    """An array with rows written behind those in use; at least doubled if it must grow."""
    until = used + len(part)
    if until > len(array):
        longer: Any = np.empty((max(until, 2 * len(array)), *array.shape[1:]), array.dtype)
        longer[:used] = array[:used]
        array = longer
    array[used:until] = part
    return array
