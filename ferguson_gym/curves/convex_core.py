"""Convex cores, the hulls of corners that obstacles consist of: the nearest point, compiled.

A core is one point, a line between two points, or, in the plane, a convex polygon with its corners
in counter-clockwise order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.nearest_point import Rows
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled


class Cores(NamedTuple):
    """The cores of n obstacles, one after the other."""

    corners: Array
    """(D, c) [m]; (D, 0) if every obstacle is a disc around the centre of its bounding ball."""
    first: NDArray[np.int64]
    """(n + 1,) index of the first corner of each core, the last entry is c; or (0,) for discs."""
    radii: Array
    """(n,) by which cores are grown [m]; or (0,) for discs."""


@compiled
def has_core(cores: Cores, k: int) -> bool:
    """Whether obstacle k is no disc."""
    return len(cores.first) > 0 and cores.first[k + 1] - cores.first[k] > 1


@compiled
def most_corners(cores: Cores) -> int:
    """Largest number of corners of a core; 0 if all obstacles are discs."""
    most = 0
    for k in range(len(cores.first) - 1):
        most = max(most, cores.first[k + 1] - cores.first[k])
    return most


class Nearest(NamedTuple):
    """How a point lies beside a core."""

    distance: float
    """Signed distance [m], negative inside a polygon."""
    corner: int
    """The corner that is nearest, or at which the nearest edge starts, as an index of corners."""
    share: float
    """Where on the edge the nearest point lies, in (0, 1); 0 for a corner."""


@compiled
def nearest_on_core(
    point: Array | tuple[float, float], corners: Array, first: int, end: int, axes: Rows
) -> Nearest:
    """The nearest corner or edge of a core to a point (D,), and the signed distance.

    Inside a polygon it is the edge whose line is nearest.

    Args:
        point: (D,) [m].
        corners: (D, c) [m], of which those from `first` up to `end` span the core.
        first: index of the first corner.
        end: index behind the last corner.
        axes: the D axes.
    """
    number = end - first
    best, corner, share = np.inf, first, 0.0
    deepest, wall = -np.inf, first
    for k in range(first, end):
        after = k + 1 if k + 1 < end else first
        size2 = along = off2 = 0.0
        for d in range(len(axes)):
            edge, off = corners[d, after] - corners[d, k], point[d] - corners[d, k]
            size2 += edge * edge
            along += edge * off
            off2 += off * off
        if off2 < best:
            best, corner, share = off2, k, 0.0
        if number == 1 or (number == 2 and k > first):
            continue
        if number > 2:
            # the polygon lies to the left of its edges
            ex, ey = corners[0, after] - corners[0, k], corners[1, after] - corners[1, k]
            beyond = (point[0] - corners[0, k]) * ey - (point[1] - corners[1, k]) * ex
            beyond /= np.sqrt(size2)
            if beyond > deepest:
                deepest, wall = beyond, k
        if 0.0 < along < size2:
            part = along / size2
            apart2 = 0.0
            for d in range(len(axes)):
                off = point[d] - corners[d, k] - part * (corners[d, after] - corners[d, k])
                apart2 += off * off
            if apart2 < best:
                best, corner, share = apart2, k, part
    if number > 2 and deepest <= 0.0:
        return Nearest(deepest, wall, 0.5)
    return Nearest(float(np.sqrt(best)), corner, share)


@compiled
def outward_normal(
    point: Array | tuple[float, float],
    near: Nearest,
    corners: Array,
    first: int,
    end: int,
    axes: Rows,
    normal: Array,
) -> float:
    """Fill the unit normal (D,) in which the signed distance grows; return its curvature [1/m].

    The curvature of the distance's level set there is one over the distance beside a corner, and
    zero beside an edge in the plane. On a corner, where there is no such direction, both are zero.
    """
    k = near.corner
    after = k + 1 if k + 1 < end else first
    if len(axes) == 2 and near.share > 0.0:
        # from the edge alone: near it, the difference from the nearest point has no direction
        ex, ey = corners[0, after] - corners[0, k], corners[1, after] - corners[1, k]
        beyond = (point[0] - corners[0, k]) * ey - (point[1] - corners[1, k]) * ex
        size = np.sqrt(ex * ex + ey * ey)
        if end - first == 2 and beyond < 0.0:
            size = -size
        normal[0], normal[1] = ey / size, -ex / size
        return 0.0
    edge2 = along = 0.0
    for d in range(len(axes)):
        edge = corners[d, after] - corners[d, k]
        normal[d] = point[d] - corners[d, k] - near.share * edge
        edge2 += edge * edge
        along += normal[d] * edge
    size2 = 0.0
    for d in range(len(axes)):
        if near.share > 0.0:  # what rounding has left along the edge
            normal[d] -= along / edge2 * (corners[d, after] - corners[d, k])
        size2 += normal[d] * normal[d]
    if size2 == 0.0:
        return 0.0
    for d in range(len(axes)):
        normal[d] /= np.sqrt(size2)
    return 1.0 / float(np.sqrt(size2))
