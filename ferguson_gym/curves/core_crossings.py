"""Lines that cross convex cores in the plane, and the shortest way to move them out, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled


class Exit(NamedTuple):
    """How a line moves sideways out of a core."""

    corner: int
    """The last corner that it passes, as an index of corners."""
    left: bool
    """Whether it moves to the left."""
    depth: float
    """How far [m]; negative if the core lies on one side of the line."""


@compiled
def line_exit(
    x: float, y: float, vx: float, vy: float, corners: Array, first: int, end: int
) -> Exit:
    """How a line moves sideways out of a core, to the side where that is less.

    Args:
        x: of a point of the line [m].
        y: of the same.
        vx: of the line's direction, a vector of any length but zero.
        vy: of the same.
        corners: (2, c) [m], of which those from `first` up to `end` span the core.
        first: index of the first corner.
        end: index behind the last corner.
    """
    left, right, most, least = first, first, -np.inf, np.inf
    for k in range(first, end):
        off = vx * (corners[1, k] - y) - vy * (corners[0, k] - x)
        if off > most:
            most, left = off, k
        if off < least:
            least, right = off, k
    size = float(np.sqrt(vx * vx + vy * vy))
    if most <= -least:
        return Exit(left, True, most / size)
    return Exit(right, False, -least / size)


@compiled
def crosses(x: float, y: float, vx: float, vy: float, corners: Array, first: int, end: int) -> bool:
    """Whether the line from (x, y) to (x + vx, y + vy) meets a core of two or more corners.

    Of the lines that may separate them, one is along the line and the others along edges.
    """
    least, most = np.inf, -np.inf
    for k in range(first, end):
        off = vx * (corners[1, k] - y) - vy * (corners[0, k] - x)
        least, most = min(least, off), max(most, off)
    if least > 0.0 or most < 0.0:
        return False
    for k in range(first, end):
        after = k + 1 if k + 1 < end else first
        ex, ey = corners[0, after] - corners[0, k], corners[1, after] - corners[1, k]
        one = (x - corners[0, k]) * ey - (y - corners[1, k]) * ex
        other = one + vx * ey - vy * ex
        if one > 0.0 and other > 0.0:
            return False
    return True
