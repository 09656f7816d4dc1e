"""The free space of a field as convex cells that touch along common sides.

The free space among the polygons around the obstacles is cut into triangles that have all corners
of it (a constrained Delaunay triangulation, by shapely), and triangles are joined, over the longest
sides first, while they stay convex. Cells that no shortest route passes through are left out: those
behind which there is only a dead end, and those through which every line from start to goal is
longer than a route that is known.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ferguson_gym.importers.convex_pieces import convex_cells, sides_of
from ferguson_gym.runtime.arrays import Array
from planners.whole_path.gcs.funnel import taut_length

_ROUNDING = 1e-9
"""Distance within which a point counts as on a cell, relative to the size of the bounds."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cells:
    """Convex cells between a start and a goal, each of which is in one or more of them."""

    corners: Sequence[Array]
    """Of each cell (m, 2), counter-clockwise [m]."""
    sides: dict[tuple[int, int], Array]
    """Ends (2, 2) [m] of the side from each cell to each that touches it, as the first of the two
    is gone round."""
    start: Array
    """(2,) [m]."""
    goal: Array
    """(2,) [m]."""
    first: Sequence[int]
    """Cells that have the start."""
    last: Sequence[int]
    """Cells that have the goal."""

    def only(self, kept: Sequence[int]) -> Cells:
        """These cells, in this order."""
        new = {k: place for place, k in enumerate(kept)}
        return Cells(
            corners=[self.corners[k] for k in kept],
            sides={
                (new[a], new[b]): side
                for (a, b), side in self.sides.items()
                if a in new and b in new
            },
            start=self.start,
            goal=self.goal,
            first=[new[k] for k in self.first if k in new],
            last=[new[k] for k in self.last if k in new],
        )


def free_cells(
    obstacles: Sequence[Array], bounds: Array, start: Array, goal: Array, tolerance: float
) -> Cells | None:
    """Cells of the free space that joins start and goal; None if they are apart.

    Args:
        obstacles: convex polygons (m, 2) [m].
        bounds: (2, 2) lower and upper ends of the free space [m].
        start: (2,) [m].
        goal: (2,) [m].
        tolerance: start and goal may be this far outside of the free space, whose nearest points
            then take their places [m].
    """
    import shapely

    solid = shapely.union_all([shapely.Polygon(one) for one in obstacles])
    free = shapely.box(*bounds.ravel().tolist()).difference(solid)
    ends = shapely.points([start, goal])
    for part in shapely.get_parts(free):
        if shapely.distance(part, ends).max() > tolerance:
            continue
        pieces = convex_cells(part)
        owners = {side: k for k, piece in enumerate(pieces) for side in sides_of(piece)}
        sides = {
            (k, owners[side[::-1]]): np.array(side)
            for side, k in owners.items()
            if side[::-1] in owners
        }
        near = [np.array(shapely.shortest_line(part, end).coords[0]) for end in ends]
        room = _ROUNDING * float(np.ptp(bounds, axis=0).max())
        shapes = [shapely.Polygon(piece) for piece in pieces]
        first, last = (
            np.flatnonzero(shapely.distance(shapes, shapely.Point(at)) <= room).tolist()
            for at in near
        )
        return Cells(
            corners=[np.array(piece) for piece in pieces],
            sides=sides,
            start=near[0],
            goal=near[1],
            first=first,
            last=last,
        )
    return None


def without_detours(cells: Cells) -> Cells:
    """The cells that a shortest route may pass through, which are often few of them."""
    known = _known_length(cells)
    near = [
        k
        for k, corners in enumerate(cells.corners)
        if _length_through(corners, cells.start, cells.goal) <= known * (1.0 + _ROUNDING)
    ]
    return _without_dead_ends(cells.only(near))


def _without_dead_ends(cells: Cells) -> Cells:
    """The cells less those that touch a single other one, again and again."""
    neighbours: list[set[int]] = [set() for _ in cells.corners]
    for one, other in cells.sides:
        neighbours[one].add(other)
    ends = {*cells.first, *cells.last}
    leaves = [k for k, near in enumerate(neighbours) if len(near) < 2 and k not in ends]
    gone = set(leaves)
    while leaves:
        leaf = leaves.pop()
        for k in neighbours[leaf]:
            neighbours[k].discard(leaf)
            if len(neighbours[k]) < 2 and k not in ends and k not in gone:
                gone.add(k)
                leaves.append(k)
    return cells.only([k for k in range(len(neighbours)) if k not in gone])


def _known_length(cells: Cells) -> float:
    """The length [m] of a route from start to goal: the taut one through good cells.

    The cells are those on the shortest way that crosses each side in its middle.
    """
    into: list[list[tuple[int, Array, Array]]] = [[] for _ in cells.corners]
    for (one, other), side in cells.sides.items():
        into[one].append((other, side, side.mean(axis=0)))
    order = itertools.count()  # cells of the same length in the order in which they were reached
    # the length so far, the cell, the place, and the sides crossed
    ways: list[tuple[float, int, int, Array, tuple[Array, ...]]] = [
        (0.0, next(order), k, cells.start, ()) for k in cells.first
    ]
    done: set[tuple[float, float]] = set()
    last, best, through = set(cells.last), math.inf, tuple[Array, ...]()
    while ways:
        so_far, _, k, at, crossed = heapq.heappop(ways)
        if so_far >= best:
            break
        place = (float(at[0]), float(at[1]))
        if crossed and place in done:
            continue
        done.add(place)
        if k in last and (whole := so_far + math.dist(at, cells.goal)) < best:
            best, through = whole, crossed
        for other, side, middle in into[k]:
            if (float(middle[0]), float(middle[1])) not in done:
                way = so_far + math.dist(at, middle), next(order), other, middle
                heapq.heappush(ways, (*way, (*crossed, side)))
    return taut_length(cells.start, through, cells.goal)


def _length_through(corners: Array, start: Array, goal: Array) -> float:
    """The length [m] of the shortest line from start to goal by way of a convex polygon (m, 2)."""
    sides = np.roll(corners, -1, axis=0) - corners
    sizes = np.linalg.norm(sides, axis=1)
    along = sides / sizes[:, None]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    # of both ends: where they are along each side, and how far beside it
    places = [((end - corners) * along).sum(axis=1) for end in (start, goal)]
    beside = [((end - corners) * across).sum(axis=1) for end in (start, goal)]
    if max(beside[0].min(), beside[1].min()) >= 0.0:  # one of them is inside
        return math.dist(start, goal)
    # the line to the goal, or to its mirror image behind the side, crosses the side here
    depth = np.abs(beside)
    share = depth[0] / np.maximum(depth.sum(axis=0), np.finfo(float).tiny)
    at = np.clip(places[0] + share * (places[1] - places[0]), 0.0, sizes)
    ways = np.hypot(at - places[0], depth[0]) + np.hypot(at - places[1], depth[1])
    return float(ways.min())
