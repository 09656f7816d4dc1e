"""The objective of swarms: the length of a whole chain, plus penalties for violated constraints.

The unknowns move knots off the straight line to the goal. The knots are linear in the unknowns,

    knots = base + reach x    with x in [-1, 1],

and `Encoding.arrays` returns base and reach. A chain of n segments has 4 n - 2 unknowns: n - 1
knots move across and along the line, and n derivatives deviate from those of Catmull and Rom.
Displacements across the line are hierarchical: a few unknowns bend the whole chain, and the others
parts of it.

Reference:
    The paper, references [9]-[11]: Ferguson splines moved by particle swarms and bee colonies,
    with penalties for obstacles, the whole flight in a single pass.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.convex_core import Cores, nearest_on_core
from ferguson_gym.curves.splines import basis
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field, planar_obstacles
from ferguson_gym.world.obstacles import Obstacles

CELLS = 32
"""Cells along each side of the grid that stores which obstacles are near a point."""

MIN_SEGMENTS = 4
"""Minimum number of segments of a chain, if each then covers at least `MIN_SPACING`."""
MIN_SPACING = 4.0
"""Straight distance [m] that a segment should cover at least."""


def hierarchical_tents(segments: int) -> Array:
    """Hierarchical shapes (n - 1, n - 1): tents over the whole chain, its halves and so on.

    Each level of tents is 1.6 times lower than the level above it.
    """
    knots = np.arange(1, segments)
    shapes: list[Array] = []
    parts, reach = [(0, segments)], 1.0
    while parts:
        halves = []
        for first, last in parts:
            if last - first > 1:
                middle = (first + last) // 2
                shapes.append(reach * np.interp(knots, [first, middle, last], [0.0, 1.0, 0.0]))
                halves += [(first, middle), (middle, last)]
        parts, reach = halves, reach / 1.6
    return np.array(shapes).reshape(segments - 1, segments - 1).T


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoding:
    """How far the unknowns move a chain off the straight line to the goal."""

    spacing: float = 10.5
    """Greatest straight distance that a segment covers [m]."""
    across: float = 1.0 / 3.0
    """Greatest offset across the line, in widths of the field."""
    along: float = 0.5
    """Greatest offset along the line, in straight distances of a segment."""
    tangent: float = 0.25
    """Greatest offset of a derivative's coordinates, in straight distances of a segment."""

    def segments(self, distance: float) -> int:
        """Number of segments for a straight distance [m]; near the goal enough of them to bend."""
        return max(
            1, min(MIN_SEGMENTS, int(distance / MIN_SPACING)), math.ceil(distance / self.spacing)
        )

    def arrays(self, field: Field, vehicle: transition.State) -> tuple[Array, Array]:
        """Base (n + 1, 2, 2), rows point and derivative, and reach (n + 1, 2, 2, 4 n - 2) [m]."""
        way = field.goal - vehicle.position
        n = self.segments(float(np.linalg.norm(way)))
        step = way / n
        aside = np.array([-step[1], step[0]])
        width = float((field.bounds[1] - field.bounds[0]).max()) * self.across
        base, reach = np.zeros((n + 1, 2, 2)), np.zeros((n + 1, 2, 2, 4 * n - 2))
        base[:, 0] = vehicle.position + np.arange(n + 1)[:, None] * step
        for knot, row in enumerate(hierarchical_tents(n), start=1):  # the goal's knot does not move
            normal = aside / np.linalg.norm(aside)
            reach[knot, 0, :, : n - 1] = width * normal[:, None] * row
            reach[knot, 0, :, n - 2 + knot] = self.along * step
        for knots in (base, reach):
            knots[1:-1, 1] = 0.5 * (knots[2:, 0] - knots[:-2, 0])
            knots[-1, 1] = knots[-1, 0] - knots[-2, 0]
        for knot in range(1, n + 1):
            free = 2 * n - 2 + 2 * (knot - 1)
            reach[knot, 1, :, free] = self.tangent * step
            reach[knot, 1, :, free + 1] = self.tangent * aside
        base[0, 1] = vehicle.derivative
        return base, reach


@dataclass(frozen=True, slots=True, kw_only=True)
class Penalties:
    """Penalties, added to the length of a chain [m]."""

    depth: float = 30.0
    """For each metre flown in an obstacle or outside the bounds, times the depth there [1/m]."""
    inside: float = 3.0
    """For each such metre, at any depth."""
    length: float = 5.0
    """For each metre by which a segment is too short or too long."""
    margin: float = 0.05
    """Growth of obstacles [m], since a chain cuts deeper between its samples."""
    samples: int = 10
    """Number of samples of a segment, its end among them."""


class Cells(NamedTuple):
    """The obstacles that overlap each cell of a grid over the bounds; border cells are endless."""

    low: Array
    """(2,) least coordinates [m]."""
    size: Array
    """(2,) of a cell [m]."""
    first: NDArray[np.int64]
    """(CELLS^2 + 1,) index of each cell's first obstacle."""
    balls: Array
    """(m, 3) centre and radius of the balls that contain them [m], by cell, rows of cells one after
    the other."""
    which: NDArray[np.int64]
    """(m,) index of each."""
    cores: Cores
    """Of all obstacles."""


def cells(bounds: Array, obstacles: Obstacles) -> Cells:
    """Sort obstacles into a grid over bounds (2, 2) [m]."""
    centers, radii = obstacles.balls
    size = (bounds[1] - bounds[0]) / CELLS
    edges = bounds[0] + np.arange(CELLS + 1)[:, None] * size
    edges[0], edges[-1] = -np.inf, np.inf
    # how far each centre is from the columns and from the rows of cells (2, CELLS, n)
    nearest = np.clip(centers, edges[:-1, None], edges[1:, None])
    square = np.moveaxis(nearest - centers, -1, 0) ** 2
    # a little more, for points that rounding puts into the neighbouring cell
    reach = (radii * (1.0 + 1e-9) + 1e-9 * size.max()) ** 2
    inside = square[1][:, None] + square[0] <= reach
    if not obstacles.are_discs:
        # the balls of long obstacles overlap many cells that these do not
        middle = bounds[0] + (np.arange(1, CELLS - 1)[:, None] + 0.5) * size
        points = np.stack(np.meshgrid(middle[:, 0], middle[:, 1]), axis=-1)
        room = (0.5 + 1e-9) * float(np.linalg.norm(size)) + 1e-9 * radii
        inside[1:-1, 1:-1] &= obstacles.signed_distance(points) <= room
    first = np.concatenate([[0], np.cumsum(inside.sum(axis=-1).ravel())])
    which = np.nonzero(inside)[2]
    return Cells(
        np.ascontiguousarray(bounds[0]),
        size,
        first.astype(np.int64),
        np.column_stack([centers, radii])[which],
        which,
        obstacles.cores,
    )


class Weights(NamedTuple):
    """Penalties and limits, for compiled functions."""

    depth: float
    inside: float
    length: float
    shortest: float
    longest: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ChainObjective:
    """Length and penalties of chains as a function of their unknowns."""

    base: Array
    """(4 (n + 1),) numbers of the knots: point, derivative, knot by knot."""
    reach: Array
    """(4 (n + 1), unknowns)."""
    samples: Array
    """(samples, 4) weights of the control rows at the samples."""
    bounds: Array
    """(2, 2) [m]."""
    cells: Cells
    weights: Weights

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return int(self.reach.shape[1])

    def control(self, x: Array) -> Array:
        """The chain (n, 4, 2) of unknowns (m,)."""
        knots = (self.base + self.reach @ x).reshape(-1, 2, 2)
        return np.stack([knots[:-1, 0], knots[1:, 0], knots[:-1, 1], knots[1:, 1]], axis=1)

    def value(self, x: Array) -> float:
        """Length, by chords, and penalties of the chain of unknowns (m,) [m]."""
        return _value(x, self.base, self.reach, self.samples, self.bounds, self.cells, self.weights)


def chain_objective(
    field: Field,
    vehicle: transition.State,
    encoding: Encoding,
    penalties: Penalties,
) -> ChainObjective:
    """The objective of chains from a vehicle to the goal.

    Raises:
        ValueError: a field that is not planar.
    """
    obstacles = planar_obstacles(field)
    base, reach = encoding.arrays(field, vehicle)
    limits = field.limits
    weights = penalties.depth, penalties.inside, penalties.length, limits.shortest, limits.longest
    return ChainObjective(
        base=base.ravel(),
        reach=reach.reshape(base.size, -1),
        samples=basis(np.linspace(0.0, 1.0, penalties.samples + 1)[1:]),
        bounds=field.bounds,
        cells=cells(field.bounds, obstacles.grown(np.full(len(obstacles), penalties.margin))),
        weights=Weights(*map(float, weights)),
    )


@compiled
def _value(
    x: Array,
    base: Array,
    reach: Array,
    samples: Array,
    bounds: Array,
    near: Cells,
    weights: Weights,
) -> float:
    knots = base + reach @ x
    px, py = knots[0], knots[1]
    total = 0.0
    for k in range(0, len(knots) - 4, 4):
        length = 0.0
        for i in range(len(samples)):
            start, end, leave, arrive = samples[i, 0], samples[i, 1], samples[i, 2], samples[i, 3]
            qx, qy = px, py
            px = start * knots[k] + end * knots[k + 4]
            px = px + leave * knots[k + 2] + arrive * knots[k + 6]
            py = start * knots[k + 1] + end * knots[k + 5]
            py = py + leave * knots[k + 3] + arrive * knots[k + 7]
            chord = np.sqrt((px - qx) ** 2 + (py - qy) ** 2)
            length += chord
            out = max(bounds[0, 0] - px, px - bounds[1, 0], 0.0)
            out += max(bounds[0, 1] - py, py - bounds[1, 1], 0.0)
            if out > 0.0:
                total += (weights.depth * out + weights.inside) * chord
            column = min(max(int((px - near.low[0]) / near.size[0]), 0), CELLS - 1)
            row = min(max(int((py - near.low[1]) / near.size[1]), 0), CELLS - 1)
            cell = row * CELLS + column
            for j in range(near.first[cell], near.first[cell + 1]):
                dx, dy, radius = px - near.balls[j, 0], py - near.balls[j, 1], near.balls[j, 2]
                square = dx * dx + dy * dy
                if square < radius * radius:
                    depth = radius - np.sqrt(square)
                    if len(near.cores.first) > 0:
                        depth = _depth(px, py, near.which[j], near.cores)
                    if depth > 0.0:
                        total += (weights.depth * depth + weights.inside) * chord
        wrong = max(weights.shortest - length, length - weights.longest, 0.0)
        total += length + weights.length * wrong
    return float(total)


@compiled
def _depth(x: float, y: float, which: int, cores: Cores) -> float:
    """How deep a point lies inside an obstacle [m], negative outside."""
    point = np.array([x, y])
    first, end = cores.first[which], cores.first[which + 1]
    near = nearest_on_core(point, cores.corners, first, end, (0, 1))
    return float(cores.radii[which] - near.distance)
