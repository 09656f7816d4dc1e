"""Certified questions about one segment at a time, compiled: clearance, speed, room.

The searches are those of `ferguson_gym.curves.nearest_point`; here segments become Bézier curves,
cheap bounds spare most searches, and outward margins cover rounding.
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
from ferguson_gym.runtime.jit import compiled, compiled_in_place, unowned

_MARGIN = 2e-10
"""Outward margin, part of the scale; covers the search (1e-10) and its rounding."""
_GRAIN = 1e-15
"""Outward margin, part of the largest coordinate; covers forming X(t) - c."""
_ROUNDING = 1e-13
"""Outward margin of the room inside bounds, part of the largest number in the control array."""


class Scratch(NamedTuple):
    """Memory that questions about a segment work in."""

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
    """Memory for segments in D dimensions, axes (0, ..., D - 1), among this many discs."""
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


@compiled
def borrowed_scratch(scratch: Scratch) -> Scratch:
    """The same memory, without its owner; see `ferguson_gym.runtime.jit.unowned`."""
    return Scratch(
        scratch.axes,
        unowned(scratch.chord),
        unowned(scratch.work),
        unowned(scratch.found),
        unowned(scratch.points),
        unowned(scratch.stack),
        unowned(scratch.spans),
        unowned(scratch.coefficients),
        unowned(scratch.pieces),
        unowned(scratch.widths),
        unowned(scratch.speed2),
    )


@compiled_in_place
def _margin(scale: float, largest: float) -> float:
    return _MARGIN * scale + _GRAIN * largest


@compiled_in_place
def _shift(control: Array, columns: Array, k: int, scratch: Scratch) -> float:
    """Fill Bézier points of X - c; return the outward margin of their distances."""
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
def _least_ahead(points: Array, rows: Rows, axes: Rows) -> float:
    """Least component of Bézier points along their sum; no point of the curve has less."""
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
    """Fill start and extent of a segment's chord; return its square and the curve's deviation.

    Each point of the curve is B0 P0 + B1 P1 + B2 P2 + B3 P3 with Bernstein weights; taking
    the inner Bézier points to the nearest points of the chord gives a point of the chord, and
    moves it by at most B1 + B2 <= 3/4 of the larger of their distances.
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
def _near(columns: Array, radii: Array, best: float, around: float, scratch: Scratch) -> int:
    """Fill `found` with the discs within `best` of a circle that holds a segment; their number.

    Args:
        columns: (D, n) centres of the discs.
        radii: (n,).
        best: distance [m].
        around: radius of the circle around the chord's middle, and margins [m].
        scratch: memory, and the chord.
    """
    chord, axes, spare, found = scratch.chord, scratch.axes, scratch.work[0], scratch.found
    for k in range(len(radii)):  # without branches or roots: it becomes vector instructions
        off2 = 0.0
        for d in range(len(axes)):
            off = columns[d, k] - (chord[0, d] + 0.5 * chord[1, d])
            off2 += off * off
        wide = best + radii[k] + around
        wide = wide if wide > 0.0 else 0.0
        # the distance's own share of the outward margin is taken off, the rest is in `around`
        spare[k] = wide * wide - off2 * (1.0 - 8.0 * _MARGIN)
    number = 0
    for k in range(len(radii)):
        found[number] = k
        number += not spare[k] <= 0.0
    return number


@compiled_in_place
def _bound(
    columns: Array, radii: Array, k: int, inverse: float, reach: float, scratch: Scratch
) -> float:
    """Lower bound of a segment's distance to disc k."""
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
    control: Array, columns: Array, radii: Array, below: float, scratch: Scratch
) -> float:
    """Clearance of one segment (4, D) from its nearest disc, or `below` if that is less.

    Args:
        control: (4, D) segment.
        columns: (D, n) centres of the discs.
        radii: (n,); a disc with a radius of minus infinity is none.
        below: what is not below this need not be found.
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
    best = below
    number = _near(columns, radii, best, 0.5 * chord + reach, scratch)
    # first the disc that seems nearest: what it leaves rules out most others unseen
    found, bounds = scratch.found, scratch.work[0]
    inverse = 1.0 / square if square > 0.0 else 0.0
    nearest = 0
    for m in range(number):
        bounds[m] = _bound(columns, radii, found[m], inverse, reach, scratch)
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
    """The lesser of `best` and the clearance from disc k."""
    margin = _shift(control, columns, k, scratch)
    enough = best + margin + radii[k]
    if enough <= 0.0 or _least_ahead(scratch.points, CUBIC, scratch.axes) >= enough + margin:
        return best
    norm, _ = nearest_point(
        scratch.points,
        enough,
        CUBIC,
        scratch.axes,
        scratch.stack,
        scratch.spans,
        scratch.coefficients,
    )
    clearance: float = norm - margin - radii[k]
    return min(best, clearance)


@compiled_in_place
def segment_speed(control: Array, enough: float, scratch: Scratch) -> tuple[float, float]:
    """Least speed of one segment (4, D) and its parameter; at least `enough` is proof enough."""
    points, axes = scratch.points, scratch.axes
    largest = 0.0
    for d in range(len(axes)):
        start, end, leave, arrive = control[0, d], control[1, d], control[2, d], control[3, d]
        points[0, d], points[2, d] = leave, arrive
        points[1, d] = 3.0 * (end - start) - leave - arrive
        largest = max(largest, abs(start), abs(end), abs(leave), abs(arrive))
    margin = _margin(_largest_norm(points, QUADRATIC, axes), 8.0 * largest)
    ahead = _least_ahead(points, QUADRATIC, axes)
    if ahead >= enough + 2.0 * margin:
        return ahead - margin, 0.0
    norm, where = nearest_point(
        points,
        enough + margin,
        QUADRATIC,
        axes,
        scratch.stack,
        scratch.spans,
        scratch.coefficients,
    )
    return max(0.0, norm - margin), where


@compiled
def segment_room(control: Array, bounds: Array, enough: float) -> float:
    """Least distance of one segment (4, D) inside the bounds (2, D) [m].

    At least `enough` is proof enough: then it may be that of the control polygon, which is less.
    """
    room = ahead = np.inf
    largest = 0.0
    for d in range(control.shape[1]):
        start, end, leave, arrive = control[0, d], control[1, d], control[2, d], control[3, d]
        one, other = start + leave / 3.0, end - arrive / 3.0
        low, high = min(start, end, one, other), max(start, end, one, other)
        ahead = min(ahead, low - bounds[0, d], bounds[1, d] - high)
        largest = max(largest, abs(start), abs(end), abs(leave), abs(arrive))
    if ahead - _ROUNDING * largest >= enough:
        return ahead - _ROUNDING * largest
    for d in range(control.shape[1]):
        start, end, leave, arrive = control[0, d], control[1, d], control[2, d], control[3, d]
        low, high = coordinate_extent(start, end, leave, arrive)
        room = min(room, low - bounds[0, d], bounds[1, d] - high)
    return room - _ROUNDING * largest


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
def clearance(control: Array, centers: Array, radii: Array, below: float, axes: Rows) -> Array:
    """Clearance (segments,) from the nearest disc, or `below` if that is less."""
    result = np.empty(len(control))
    columns = np.ascontiguousarray(centers.T)
    scratch = make_scratch(axes, len(radii))
    for s in range(len(control)):
        result[s] = segment_clearance(control[s], columns, radii, below, scratch)
    return result


@compiled
def least_speed(control: Array, axes: Rows) -> tuple[Array, Array]:
    """Least speed (segments,) and its parameter; see `ferguson_gym.curves.clearance`."""
    speed, where = np.empty(len(control)), np.empty(len(control))
    scratch = make_scratch(axes, 0)
    for s in range(len(control)):
        speed[s], where[s] = segment_speed(control[s], np.inf, scratch)
    return speed, where


@compiled
def rooms(control: Array, bounds: Array) -> Array:
    """Least distance inside the bounds (segments,)."""
    result = np.empty(len(control))
    for s in range(len(control)):
        result[s] = segment_room(control[s], bounds, np.inf)
    return result
