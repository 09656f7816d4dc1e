"""Routes by A* on a grid with 8 neighbours, shortened by lines of any angle.

The grid spans the bounds. Its edges, not its cells, are checked for collision: an edge is kept if
the straight line between its two grid points is clear of the obstacles. A passage is missed only if
no grid edge fits through it. Vehicle and goal are connected to the grid points around them. The
search uses networkx; its path is then shortcut by collision-free lines.

Reference:
    Hart, Nilsson & Raphael (1968), A formal basis for the heuristic determination of minimum cost
    paths, IEEE Transactions on Systems Science and Cybernetics 4.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.shapes import Integers
from ferguson_gym.world import Field, transition
from planners.interface import Route
from planners.whole_path.line_of_sight import lines_clear, scene_from
from planners.whole_path.shortcut import shortcut

MAX_STEPS = 400
"""Maximum number of grid steps along an axis; a wider field gets a coarser grid, so that planning
takes seconds in any field."""
_ROUNDING = 1e-6
"""Part of a grid step that does not make a further step."""
_FRACTIONS = 2.0**20
"""Lengths in the grid are multiples of one unit through this number."""
LINK_STEPS = 2
"""Distance along each axis up to which grid points are connected to vehicle and goal [steps]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AStar:
    """Routes by A* on a grid, then shortened. Needs networkx.

    Raises:
        ValueError: a resolution that is not positive and finite.
    """

    resolution: float = 1.0
    """Greatest distance between neighbouring grid points along an axis [m]."""

    def __post_init__(self) -> None:
        if not 0.0 < self.resolution < math.inf:
            raise ValueError(f"resolution must be positive and finite, got {self.resolution} m")

    def route(self, field: Field, vehicle: transition.State, seed: int) -> Route | None:
        """Find a route from the vehicle to the goal; the seed has no effect.

        Raises:
            TypeError: a field that is not planar.
        """
        # an optional library, which importing the planners must not require
        import networkx

        began = time.perf_counter()
        scene = scene_from(field, vehicle.position)
        if scene is None:
            return None
        axes = [_axis(low, high, self.resolution) for low, high in field.bounds.T]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        points = np.concatenate([grid.reshape(-1, 2), [vehicle.position, field.goal]])
        start, goal = len(points) - 2, len(points) - 1
        moves = np.concatenate(
            [
                _moves(len(axes[0]), len(axes[1])),
                _joined(points, start, grid[1, 1] - grid[0, 0]),
                _joined(points, goal, grid[1, 1] - grid[0, 0]),
                [[start, goal]],
            ]
        )
        moves = moves[lines_clear(scene, points[moves[:, 0]], points[moves[:, 1]])]
        lengths = _rounded(np.linalg.norm(points[moves[:, 0]] - points[moves[:, 1]], axis=1))
        graph = networkx.Graph()
        graph.add_nodes_from((start, goal))
        graph.add_weighted_edges_from(zip(*moves.T.tolist(), lengths.tolist(), strict=True))
        # the straight distance is an admissible heuristic
        togo = _rounded(np.linalg.norm(points - field.goal, axis=1)).tolist()
        try:
            way = networkx.astar_path(graph, start, goal, lambda node, _: togo[node])
        except networkx.NetworkXNoPath:
            return None
        corners = shortcut(scene, points[way])
        length = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())
        found = time.perf_counter() - began, length
        return Route(points=corners, length=length, progress=[found])


def _axis(low: float, high: float, resolution: float) -> Array:
    """Coordinates of the grid along an axis [m], the bounds among them."""
    steps = min(max(1, math.ceil((high - low) / resolution - _ROUNDING)), MAX_STEPS)
    return np.linspace(low, high, steps + 1)


def _rounded(lengths: Array) -> Array:
    """Lengths (n,) in fractions whose sums are exact.

    So grid paths of the same length are equal in every copy of a field, moved or scaled.
    """
    rounded: Array = np.round(lengths * _FRACTIONS) / _FRACTIONS
    return rounded


def _moves(columns: int, rows: int) -> Integers:
    """Pairs of neighbours (n, 2) in a grid, each pair once."""
    node = np.arange(columns * rows).reshape(columns, rows)
    pairs = (
        (node[:-1], node[1:]),
        (node[:, :-1], node[:, 1:]),
        (node[:-1, :-1], node[1:, 1:]),
        (node[1:, :-1], node[:-1, 1:]),
    )
    return np.concatenate([np.column_stack([a.ravel(), b.ravel()]) for a, b in pairs])


def _joined(points: Array, node: int, step: Array) -> Integers:
    """Pairs (n, 2) of a node and the grid points around it."""
    apart = np.abs(points[:-2] - points[node])
    (near,) = np.nonzero((apart <= LINK_STEPS * step).all(axis=1))
    return np.column_stack([np.full(len(near), node), near])
