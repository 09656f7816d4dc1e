"""Blocked cells of a grid as few rectangles."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array

Cells = NDArray[np.int64]
_HALF_SIDE = 0.01
"""Half the side of a square that closes a gap of no width [cells]."""


def rectangles(blocked: NDArray[np.bool_]) -> Cells:
    """Rectangles (n, 4) that cover exactly the blocked cells, and no cell twice.

    Runs of blocked cells within a row are joined to the same run of the next row, as far as it
    goes.

    Args:
        blocked: (rows, columns) of the grid.

    Returns:
        First column, first row, end column and end row, ends excluded, of each.
    """
    found: list[tuple[int, int, int, int]] = []
    begun: dict[tuple[int, int], int] = {}
    framed = np.pad(blocked, ((0, 1), (1, 1)))
    for row, cells in enumerate(framed):
        change = np.flatnonzero(cells[1:] != cells[:-1])
        runs = set(zip(change[::2].tolist(), change[1::2].tolist(), strict=True))
        ended = [run for run in begun if run not in runs]
        found += [(first, begun.pop((first, last)), last, row) for first, last in ended]
        for run in runs:
            begun.setdefault(run, row)
    return np.array(sorted(found), dtype=np.int64).reshape(-1, 4)


def overlapping(blocked: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Rectangles that cover exactly the blocked cells, and overlap each other and the border.

    Rectangles that only touch would leave a way along the line between them, on which no obstacle
    is met, and so would the border of the grid. So each reaches half a cell into its neighbours
    below or above, and where it cannot, a further rectangle half a cell around the common side
    does. At the border they reach half a cell beyond it.

    Args:
        blocked: (rows, columns) of the grid.

    Returns:
        Lower (n, 2) and upper (n, 2) columns and rows.
    """
    cells = rectangles(blocked)
    boxes: list[list[float]] = cells.astype(np.float64).tolist()
    below = np.full(blocked.shape, -1)
    for k, (left, top, right, end) in enumerate(cells):
        below[top:end, left:right] = k
    further: list[list[float]] = []
    for k, (left, _, right, end) in enumerate(cells.tolist()):
        if end == len(blocked):
            continue
        under = below[end, left:right]
        if (under >= 0).all():
            boxes[k][3] = end + 0.5
            continue
        change = np.flatnonzero(np.diff(under, prepend=-2, append=-2))
        for begin, stop in pairwise(change.tolist()):
            if under[begin] >= 0:
                other = int(under[begin])
                if cells[other, 0] >= left and cells[other, 2] <= right:
                    boxes[other][1] = end - 0.5
                else:
                    further.append([left + begin, end - 0.5, left + stop, end + 0.5])
    every = np.array(boxes + further, dtype=np.float64).reshape(-1, 4)
    low, high = every[:, :2], every[:, 2:]
    return np.where(low == 0.0, -0.5, low), np.where(high == blocked.shape[::-1], high + 0.5, high)


def corner_squares(blocked: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Small squares around the corners at which two blocked cells touch and no others do.

    Without them a path of no width passes between such cells. They reach 0.01 cells into the two
    free cells beside them.

    Args:
        blocked: (rows, columns) of the grid.

    Returns:
        Lower (n, 2) and upper (n, 2) columns and rows.
    """
    here, right, below = blocked[:-1, :-1], blocked[:-1, 1:], blocked[1:, :-1]
    opposite = blocked[1:, 1:]
    falling, rising = here & opposite & ~right & ~below, right & below & ~here & ~opposite
    row, column = np.nonzero(falling | rising)
    corners = np.stack([column + 1.0, row + 1.0], axis=-1)
    return corners - _HALF_SIDE, corners + _HALF_SIDE
