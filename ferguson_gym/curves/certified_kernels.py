"""Certified minimum of |X'(t)| and bounds margin of one segment, compiled, and its scratch memory.

Computed distances are reduced by margins that cover rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.arc_length import DEPTH as PIECES
from ferguson_gym.curves.arc_length import NODES
from ferguson_gym.curves.nearest_point import CUBIC, DEPTH, QUADRATIC, Rows, nearest_point
from ferguson_gym.curves.splines import coordinate_extent
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place

MARGIN = 2e-10
"""Margin relative to the scale; covers the search (1e-10) and its rounding."""
_GRAIN = 1e-15
"""Margin relative to the largest coordinate; covers the rounding of X(t) - c."""
_ROUNDING = 1e-13
"""Rounding margin of the bounds margin, relative to the largest entry of the control array."""


class Scratch(NamedTuple):
    """Scratch memory for certifying one segment."""

    axes: Rows
    chord: Array
    work: Array
    found: NDArray[np.int64]
    points: Array
    stack: Array
    spans: Array
    coefficients: Array
    pieces: Array
    widths: Array
    speed2: Array
    core: Array
    parts: Array
    part_spans: Array


@compiled
def make_scratch(axes: Rows, obstacles: int, corners: int) -> Scratch:
    """Scratch memory for segments in D dimensions, axes (0, ..., D - 1).

    Args:
        axes: (0, ..., D - 1).
        obstacles: maximum number of obstacles of a field.
        corners: maximum number of corners of an obstacle; 0 if all are discs.
    """
    dimension = len(axes)
    return Scratch(
        axes,
        np.empty((2, dimension)),
        np.empty((2, obstacles)),
        np.empty(obstacles, np.int64),
        np.empty((4, dimension)),
        np.empty((DEPTH, 4, dimension)),
        np.empty((DEPTH, 2)),
        np.empty((2, 7)),
        np.empty((PIECES, 3, dimension)),
        np.empty(PIECES),
        np.empty(NODES),
        np.empty((dimension, corners)),
        np.empty((DEPTH if corners else 0, 4, dimension)),
        np.empty((DEPTH if corners else 0, 2)),
    )


@compiled_in_place
def margin_of(scale: float, largest: float) -> float:
    """Margin [m] for lengths up to a scale, from coordinates up to a largest one [m]."""
    return MARGIN * scale + _GRAIN * largest


@compiled_in_place
def relative_to(control: Array, columns: Array, k: int, scratch: Scratch) -> float:
    """Fill the Bézier points of X - c, c the centre of disc k; return the rounding margin."""
    points, axes = scratch.points, scratch.axes
    largest = 0.0
    for d in range(len(axes)):
        start, end, center = control[0, d], control[1, d], columns[d, k]
        leave, arrive = control[2, d] / 3.0, control[3, d] / 3.0
        points[0, d] = start - center
        points[1, d] = start - center + leave
        points[2, d] = end - center - arrive
        points[3, d] = end - center
        largest = max(largest, abs(start), abs(end), abs(leave), abs(arrive), abs(center))
    return margin_of(largest_norm(points, CUBIC, axes), largest)


@compiled
def largest_norm(points: Array, rows: Rows, axes: Rows) -> float:
    """The largest norm of some Bézier points."""
    largest2 = 0.0
    for i in range(len(rows)):
        norm2 = 0.0
        for d in range(len(axes)):
            norm2 += points[i, d] * points[i, d]
        largest2 = max(largest2, norm2)
    return float(np.sqrt(largest2))


@compiled
def least_projection(points: Array, rows: Rows, axes: Rows) -> float:
    """Smallest projection of Bézier points onto their sum's direction, a lower bound of |Y(t)|."""
    total2 = 0.0
    for d in range(len(axes)):
        total = 0.0
        for j in range(len(rows)):
            total += points[j, d]
        total2 += total * total
    least = np.inf
    for i in range(len(rows)):
        along = 0.0
        for d in range(len(axes)):
            total = 0.0
            for j in range(len(rows)):
                total += points[j, d]
            along += points[i, d] * total
        least = min(least, along)
    return float(least / np.sqrt(total2)) if total2 > 0.0 else 0.0


@compiled_in_place
def segment_speed(control: Array, threshold: float, scratch: Scratch) -> tuple[float, float]:
    """Minimum of |X'(t)| along one segment (4, D) and its parameter.

    If the minimum is at least `threshold`, a lower bound of at least `threshold` may be returned.
    """
    points, axes = scratch.points, scratch.axes
    largest = 0.0
    for d in range(len(axes)):
        start, end, leave, arrive = control[0, d], control[1, d], control[2, d], control[3, d]
        points[0, d], points[2, d] = leave, arrive
        points[1, d] = 3.0 * (end - start) - leave - arrive
        largest = max(largest, abs(start), abs(end), abs(leave), abs(arrive))
    margin = margin_of(largest_norm(points, QUADRATIC, axes), 8.0 * largest)
    ahead = least_projection(points, QUADRATIC, axes)
    if ahead >= threshold + 2.0 * margin:
        return ahead - margin, 0.0
    norm, where = nearest_point(
        points,
        threshold + margin,
        QUADRATIC,
        axes,
        scratch.stack,
        scratch.spans,
        scratch.coefficients,
    )
    return max(0.0, norm - margin), where


@compiled
def segment_bounds_margin(control: Array, bounds: Array, threshold: float) -> float:
    """Least distance of one segment (4, D) inside the bounds (2, D) [m].

    If the distance of the control polygon, a lower bound, is at least `threshold`, that is
    returned.
    """
    bounds_margin = ahead = np.inf
    largest = 0.0
    for d in range(control.shape[1]):
        start, end, leave, arrive = control[0, d], control[1, d], control[2, d], control[3, d]
        second, third = start + leave / 3.0, end - arrive / 3.0
        low, high = min(start, end, second, third), max(start, end, second, third)
        ahead = min(ahead, low - bounds[0, d], bounds[1, d] - high)
        largest = max(largest, abs(start), abs(end), abs(leave), abs(arrive))
    if ahead - _ROUNDING * largest >= threshold:
        return ahead - _ROUNDING * largest
    for d in range(control.shape[1]):
        start, end, leave, arrive = control[0, d], control[1, d], control[2, d], control[3, d]
        low, high = coordinate_extent(start, end, leave, arrive)
        bounds_margin = min(bounds_margin, low - bounds[0, d], bounds[1, d] - high)
    return bounds_margin - _ROUNDING * largest


@compiled
def least_speed(control: Array, axes: Rows) -> tuple[Array, Array]:
    """Minimum of |X'(t)| (segments,) and its parameter; see `ferguson_gym.curves.clearance`."""
    speed, where = np.empty(len(control)), np.empty(len(control))
    scratch = make_scratch(axes, 0, 0)
    for s in range(len(control)):
        speed[s], where[s] = segment_speed(control[s], np.inf, scratch)
    return speed, where


@compiled
def bounds_margins(control: Array, bounds: Array) -> Array:
    """Least distance inside the bounds (segments,) [m]."""
    result = np.empty(len(control))
    for s in range(len(control)):
        result[s] = segment_bounds_margin(control[s], bounds, np.inf)
    return result
