"""Trees of shortest paths of many fields, one behind the other, that one compiled call reads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ferguson_gym.guidance.path_tree import PathTree, look
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, unowned
from ferguson_gym.shortest_paths.shapes import Integers, Records, Shapes


class Forest(NamedTuple):
    """Many trees, one behind the other."""

    parts: Integers
    """(trees, 6) number of obstacles of each, and where its parts begin in the next three; number
    of corners, 0 if its obstacles are discs, and where these begin."""
    numbers: Array
    """`discs`, `least` and `frame`, and `radii` and `reach` of shapes."""
    first: Integers
    """`first` of each, and that of shapes."""
    nodes: Records
    """`nodes` of each."""
    corners: Records
    """`corners` of shapes of each."""


@compiled
def look_ahead_each(
    forest: Forest,
    which: Integers,
    points: Array,
    distances: Array,
    places: Array,
    togo: Array,
) -> None:
    """As `look_ahead`, each point (m,) in a tree of its own: infinite where `which` is negative."""
    forest = unowned(forest)  # the caller holds it
    for i in range(len(points)):
        togo[i] = np.inf
        if which[i] < 0:
            continue
        n, begin, first, node, number, corner = forest.parts[which[i]]
        least, frame = begin + 4 * n, begin + 6 * n
        radii, shape = frame + 8, first + 2 * n + 1
        until = forest.first[first + 2 * n]
        shaped = n if number > 0 else 0
        shapes = Shapes(
            forest.first[shape : shape + (n + 1 if number > 0 else 0)],
            forest.corners[corner : corner + number],
            forest.numbers[radii : radii + shaped],
            forest.numbers[radii + shaped : radii + 2 * shaped],
        )
        tree = PathTree(
            forest.numbers[begin:least].reshape(4, n),
            forest.numbers[frame : frame + 8].reshape(4, 2),
            forest.first[first : first + 2 * n + 1],
            forest.numbers[least:frame].reshape(2, n),
            forest.nodes[node : node + until],
            shapes,
        )
        along = distances[i % len(distances)]
        togo[i] = look(tree, points[i, 0], points[i, 1], along, places[i])
