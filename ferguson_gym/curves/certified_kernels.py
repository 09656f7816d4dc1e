"""Certified clearance, minimum of |X'(t)| and bounds margin of one segment, compiled.

Relative to a disc's centre, a segment is a Bézier curve; `ferguson_gym.curves.nearest_point` finds
its point nearest to the origin. Cheap lower bounds make most of these searches unnecessary.
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

_MARGIN = 2e-10
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


@compiled
def make_scratch(axes: Rows, discs: int) -> Scratch:
    """Scratch memory for segments in D dimensions, axes (0, ..., D - 1), and `discs` discs."""
    dimension = len(axes)
    return Scratch(
        axes,
        np.empty((2, dimension)),
        np.empty((2, discs)),
        np.empty(discs, np.int64),
        np.empty((4, dimension)),
        np.empty((DEPTH, 4, dimension)),
        np.empty((DEPTH, 2)),
        np.empty((2, 7)),
        np.empty((PIECES, 3, dimension)),
        np.empty(PIECES),
        np.empty(NODES),
    )


@compiled_in_place
def _margin(scale: float, largest: float) -> float:
    return _MARGIN * scale + _GRAIN * largest


@compiled_in_place
def _shift(control: Array, columns: Array, k: int, scratch: Scratch) -> float:
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
    return _margin(_largest_norm(points, CUBIC, axes), largest)


@compiled
def _largest_norm(points: Array, rows: Rows, axes: Rows) -> float:
    largest2 = 0.0
    for i in range(len(rows)):
        norm2 = 0.0
        for d in range(len(axes)):
            norm2 += points[i, d] * points[i, d]
        largest2 = max(largest2, norm2)
    return float(np.sqrt(largest2))


@compiled
def _least_projection(points: Array, rows: Rows, axes: Rows) -> float:
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
def _chord(control: Array, scratch: Scratch) -> tuple[float, float]:
    """Fill a segment's chord; return its squared length and the curve's greatest deviation from it.

    A point of the curve is B0 P0 + B1 P1 + B2 P2 + B3 P3 with Bernstein weights. Replacing the
    inner Bézier points by their nearest points on the chord gives a point of the chord, and moves
    it by at most B1 + B2 <= 3/4 times the larger of the two distances.
    """
    chord, axes = scratch.chord, scratch.axes
    square = 0.0
    for d in range(len(axes)):
        chord[0, d], chord[1, d] = control[0, d], control[1, d] - control[0, d]
        square += chord[1, d] * chord[1, d]
    deviation2 = 0.0
    for row in range(2):
        along = 0.0
        for d in range(len(axes)):
            third = control[2 + row, d] / 3.0
            along += (third if row == 0 else chord[1, d] - third) * chord[1, d]
        share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
        off2 = 0.0
        for d in range(len(axes)):
            third = control[2 + row, d] / 3.0
            off = (third if row == 0 else chord[1, d] - third) - share * chord[1, d]
            off2 += off * off
        deviation2 = max(deviation2, off2)
    return square, 0.75 * float(np.sqrt(deviation2))


@compiled_in_place
def _fill_candidates(
    columns: Array, radii: Array, best: float, around: float, scratch: Scratch
) -> int:
    """Fill `found` with the discs closer than `best` to a circle around a segment; count them.

    Args:
        columns: (D, n) centres of the discs.
        radii: (n,).
        best: distance [m].
        around: radius of the circle around the chord's middle, margins included [m].
        scratch: memory; has the chord.
    """
    chord, axes, spare, found = scratch.chord, scratch.axes, scratch.work[0], scratch.found
    for k in range(len(radii)):  # no branches or roots, so that it is vectorised
        off2 = 0.0
        for d in range(len(axes)):
            off = columns[d, k] - (chord[0, d] + 0.5 * chord[1, d])
            off2 += off * off
        wide = best + radii[k] + around
        wide = wide if wide > 0.0 else 0.0
        # the margin proportional to the distance is subtracted here, the rest is in `around`
        spare[k] = wide * wide - off2 * (1.0 - 8.0 * _MARGIN)
    number = 0
    for k in range(len(radii)):
        found[number] = k
        number += not spare[k] <= 0.0
    return number


@compiled_in_place
def _clearance_bound(
    columns: Array, radii: Array, k: int, inverse: float, reach: float, scratch: Scratch
) -> float:
    """Lower bound of a segment's clearance from disc k, by its chord."""
    chord, axes = scratch.chord, scratch.axes
    along = 0.0
    for d in range(len(axes)):
        along += (columns[d, k] - chord[0, d]) * chord[1, d]
    share = min(max(along * inverse, 0.0), 1.0)
    off2 = 0.0
    for d in range(len(axes)):
        off = columns[d, k] - chord[0, d] - share * chord[1, d]
        off2 += off * off
    bound: float = np.sqrt(off2) * (1.0 - 4.0 * _MARGIN) - radii[k] - reach
    return bound


@compiled_in_place
def segment_clearance(
    control: Array, columns: Array, radii: Array, cutoff: float, scratch: Scratch
) -> float:
    """Clearance of one segment (4, D) from its nearest disc, or `cutoff` if that is less.

    Args:
        control: (4, D) segment.
        columns: (D, n) centres of the discs.
        radii: (n,); a radius of minus infinity is padding.
        cutoff: the search ignores discs farther than this; see the result.
        scratch: for n discs or more.
    """
    square, deviation = _chord(control, scratch)
    chord = float(np.sqrt(square))
    largest = 0.0
    for i in range(4):
        for d in range(len(scratch.axes)):
            largest = max(largest, abs(control[i, d]))
    around = deviation + chord
    reach = deviation + 4.0 * _margin(around, largest + around)
    best = cutoff
    number = _fill_candidates(columns, radii, best, 0.5 * chord + reach, scratch)
    # the disc with the least bound comes first: its clearance rules out most of the others
    found, bounds = scratch.found, scratch.work[0]
    inverse = 1.0 / square if square > 0.0 else 0.0
    nearest = 0
    for m in range(number):
        bounds[m] = _clearance_bound(columns, radii, found[m], inverse, reach, scratch)
        if bounds[m] < bounds[nearest]:
            nearest = m
    for turn in range(number + 1):
        m = nearest if turn == 0 else turn - 1
        if m < number and bounds[m] < best and (turn == 0 or m != nearest):
            best = _nearer(control, columns, radii, found[m], best, scratch)
        elif turn == 0:
            break
    return best


@compiled_in_place
def _nearer(
    control: Array, columns: Array, radii: Array, k: int, best: float, scratch: Scratch
) -> float:
    """The smaller of `best` and the clearance from disc k."""
    margin = _shift(control, columns, k, scratch)
    threshold = best + margin + radii[k]
    if (
        threshold <= 0.0
        or _least_projection(scratch.points, CUBIC, scratch.axes) >= threshold + margin
    ):
        return best
    norm, _ = nearest_point(
        scratch.points,
        threshold,
        CUBIC,
        scratch.axes,
        scratch.stack,
        scratch.spans,
        scratch.coefficients,
    )
    clearance: float = norm - margin - radii[k]
    return min(best, clearance)


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
    margin = _margin(_largest_norm(points, QUADRATIC, axes), 8.0 * largest)
    ahead = _least_projection(points, QUADRATIC, axes)
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
def closest(control: Array, centers: Array, radii: Array, axes: Rows) -> tuple[Array, Array]:
    """Clearance (segments, discs) and parameter; see `ferguson_gym.curves.clearance.closest`."""
    segments, discs = len(control), len(radii)
    clear, where = np.empty((segments, discs)), np.empty((segments, discs))
    columns = np.ascontiguousarray(centers.T)
    scratch = make_scratch(axes, 0)
    for s in range(segments):
        for k in range(discs):
            margin = _shift(control[s], columns, k, scratch)
            norm, where[s, k] = nearest_point(
                scratch.points,
                np.inf,
                CUBIC,
                axes,
                scratch.stack,
                scratch.spans,
                scratch.coefficients,
            )
            clear[s, k] = norm - margin - radii[k]
    return clear, where


@compiled
def clearance(control: Array, centers: Array, radii: Array, cutoff: float, axes: Rows) -> Array:
    """Clearance (segments,) from the nearest disc, or `cutoff` if that is less."""
    result = np.empty(len(control))
    columns = np.ascontiguousarray(centers.T)
    scratch = make_scratch(axes, len(radii))
    for s in range(len(control)):
        result[s] = segment_clearance(control[s], columns, radii, cutoff, scratch)
    return result


@compiled
def least_speed(control: Array, axes: Rows) -> tuple[Array, Array]:
    """Minimum of |X'(t)| (segments,) and its parameter; see `ferguson_gym.curves.clearance`."""
    speed, where = np.empty(len(control)), np.empty(len(control))
    scratch = make_scratch(axes, 0)
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
