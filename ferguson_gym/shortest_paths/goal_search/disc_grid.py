"""A uniform grid that knows which discs' boundaries pass which of its cells.

A disc is no member of the cells that lie inside it: a line that enters the disc has to pass a cell
of its boundary first.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place
from ferguson_gym.shortest_paths.shapes import Integers, Records


class Grid(NamedTuple):
    """Square cells over a box; cell number c = column * rows + row."""

    x: float
    """Least coordinates [m]."""
    y: float
    size: float
    """Width of a cell [m]."""
    columns: int
    rows: int
    pad: float
    """A disc whose boundary passes a cell within this distance is a member, too [m]."""
    first: Integers
    """(columns * rows + 1,) where the members of each cell begin, and their number."""
    member: Integers
    """Discs, cell by cell."""
    covered: NDArray[np.bool_]
    """(columns * rows,) whether a cell lies deeper than the pad inside of a disc."""


@compiled
def cells_around(grid: Grid, x: float, y: float, radius: float) -> tuple[int, int, int, int]:
    """First and last column, and first and last row, of the cells that a disc may pass."""
    reach = radius + grid.pad
    left = math.floor((x - reach - grid.x) / grid.size) - 1.0
    right = math.floor((x + reach - grid.x) / grid.size) + 1.0
    bottom = math.floor((y - reach - grid.y) / grid.size) - 1.0
    top = math.floor((y + reach - grid.y) / grid.size) + 1.0
    return (
        int(min(max(left, 0.0), grid.columns)),
        int(min(max(right, -1.0), grid.columns - 1.0)),
        int(min(max(bottom, 0.0), grid.rows)),
        int(min(max(top, -1.0), grid.rows - 1.0)),
    )


@compiled_in_place
def is_passed(grid: Grid, column: int, row: int, x: float, y: float, radius: float) -> bool:
    """Whether a disc's boundary passes a cell."""
    half = 0.5 * grid.size
    dx = abs(x - grid.x - grid.size * (column + 0.5))
    dy = abs(y - grid.y - grid.size * (row + 0.5))
    near_x, near_y = max(dx - half, 0.0), max(dy - half, 0.0)
    far_x, far_y = dx + half, dy + half
    within = near_x * near_x + near_y * near_y <= (radius + grid.pad) ** 2
    passed: bool = within and far_x * far_x + far_y * far_y >= max(radius - grid.pad, 0.0) ** 2
    return passed


@compiled
def make_grid(discs: Records, box: Array, size: float, pad: float) -> Grid:
    """The grid of some discs over a box (2, 2), with cells of about a size [m]."""
    columns = max(math.ceil((box[1, 0] - box[0, 0]) / size), 1)
    rows = max(math.ceil((box[1, 1] - box[0, 1]) / size), 1)
    first = np.zeros(columns * rows + 1, dtype=np.int64)
    covered = np.zeros(columns * rows, dtype=np.bool_)
    grid = Grid(box[0, 0], box[0, 1], size, columns, rows, pad, first, first[:0], covered)
    for k in range(len(discs)):
        _enter(grid, discs, k, first, first[:0])
    first[:] = np.cumsum(first)
    member, end = np.empty(first[-1], dtype=np.int64), first.copy()
    for k in range(len(discs)):
        _enter(grid, discs, k, end, member)
    return Grid(box[0, 0], box[0, 1], size, columns, rows, pad, first, member, covered)


@compiled
def _enter(grid: Grid, discs: Records, k: int, end: Integers, member: Integers) -> None:
    """Enter a disc into its cells or, without room for members, count it in the cell behind."""
    x, y, radius = discs[k].x, discs[k].y, discs[k].radius
    left, right, bottom, top = cells_around(grid, x, y, radius)
    for column in range(left, right + 1):
        for row in range(bottom, top + 1):
            cell = column * grid.rows + row
            if not is_passed(grid, column, row, x, y, radius):
                dx = grid.x + grid.size * (column + 0.5) - x
                dy = grid.y + grid.size * (row + 0.5) - y
                # a cell that is not passed lies on one side of the boundary
                if dx * dx + dy * dy < radius * radius:
                    grid.covered[cell] = True
                continue
            if len(member) == 0:
                end[cell + 1] += 1
            else:
                member[end[cell]] = k
                end[cell] += 1


@compiled
def cell_at(grid: Grid, x: float, y: float) -> int:
    """The cell that holds a point, or the nearest one."""
    column = min(max((x - grid.x) / grid.size, 0.0), grid.columns - 1.0)
    row = min(max((y - grid.y) / grid.size, 0.0), grid.rows - 1.0)
    return int(column) * grid.rows + int(row)
