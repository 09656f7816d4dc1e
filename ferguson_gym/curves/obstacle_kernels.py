"""Certified clearance of one segment from obstacles, compiled.

Relative to a disc's centre, a segment is a Bézier curve; `ferguson_gym.curves.nearest_point` finds
its point nearest to the origin, and `ferguson_gym.curves.core_clearance` the least distance from
other obstacles. Cheap lower bounds make most of these searches unnecessary. Computed distances are
reduced by margins that cover rounding.
"""

from __future__ import annotations

import numpy as np

from ferguson_gym.curves.certified_kernels import (
    MARGIN,
    Scratch,
    largest_norm,
    least_projection,
    make_scratch,
    margin_of,
    relative_to,
)
from ferguson_gym.curves.convex_core import Cores, most_corners
from ferguson_gym.curves.core_clearance import least_core_distance
from ferguson_gym.curves.nearest_point import CUBIC, Rows, nearest_point
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place


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
        spare[k] = wide * wide - off2 * (1.0 - 8.0 * MARGIN)
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
    bound: float = np.sqrt(off2) * (1.0 - 4.0 * MARGIN) - radii[k] - reach
    return bound


@compiled_in_place
def segment_clearance(
    control: Array, columns: Array, radii: Array, cores: Cores, cutoff: float, scratch: Scratch
) -> float:
    """Clearance of one segment (4, D) from its nearest obstacle, or `cutoff` if that is less.

    Args:
        control: (4, D) segment.
        columns: (D, n) centres of the balls that bound the obstacles; discs are their own.
        radii: (n,) of the balls; a radius of minus infinity is padding.
        cores: of the obstacles, as `Cores` says.
        cutoff: the search ignores obstacles farther than this; see the result.
        scratch: for n obstacles or more.
    """
    square, deviation = _chord(control, scratch)
    chord = float(np.sqrt(square))
    largest = 0.0
    for i in range(4):
        for d in range(len(scratch.axes)):
            largest = max(largest, abs(control[i, d]))
    around = deviation + chord
    reach = deviation + 4.0 * margin_of(around, largest + around)
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
            best = _nearer(control, columns, radii, cores, found[m], best, scratch)
        elif turn == 0:
            break
    return best


@compiled
def _core_clearance(
    control: Array, columns: Array, cores: Cores, k: int, best: float, scratch: Scratch
) -> tuple[float, float]:
    """Clearance from obstacle k and its parameter, or a clearance of `best` or more."""
    points, core, axes = scratch.points, scratch.core, scratch.axes
    # relative to the centre of the ball, as for a disc
    margin = relative_to(control, columns, k, scratch)
    first, number = cores.first[k], cores.first[k + 1] - cores.first[k]
    around = 0.0
    for j in range(number):
        norm2 = 0.0
        for d in range(len(axes)):
            core[d, j] = cores.corners[d, first + j] - columns[d, k]
            norm2 += core[d, j] * core[d, j]
        around = max(around, norm2)
    around = float(np.sqrt(around))
    scale = largest_norm(points, CUBIC, axes) + around
    margin = 2.0 * (margin + margin_of(around, around))
    radius = cores.radii[k]
    distance, where = least_core_distance(
        points,
        core,
        0,
        number,
        scale,
        best + radius + margin,
        axes,
        scratch.parts,
        scratch.part_spans,
        scratch.stack,
        scratch.spans,
        scratch.coefficients,
    )
    return distance - margin - radius, where


@compiled_in_place
def _nearer(
    control: Array,
    columns: Array,
    radii: Array,
    cores: Cores,
    k: int,
    best: float,
    scratch: Scratch,
) -> float:
    """The smaller of `best` and the clearance from obstacle k."""
    if len(cores.first) > 0 and cores.first[k + 1] - cores.first[k] > 1:
        return min(best, _core_clearance(control, columns, cores, k, best, scratch)[0])
    margin = relative_to(control, columns, k, scratch)
    threshold = best + margin + radii[k]
    if (
        threshold <= 0.0
        or least_projection(scratch.points, CUBIC, scratch.axes) >= threshold + margin
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


@compiled
def closest(
    control: Array, columns: Array, radii: Array, cores: Cores, axes: Rows
) -> tuple[Array, Array]:
    """Clearance (segments, n) and parameter; see `ferguson_gym.curves.clearance.closest`."""
    segments, number = len(control), len(radii)
    clear, where = np.empty((segments, number)), np.empty((segments, number))
    scratch = make_scratch(axes, 0, most_corners(cores))
    for s in range(segments):
        for k in range(number):
            if len(cores.first) > 0 and cores.first[k + 1] - cores.first[k] > 1:
                clear[s, k], where[s, k] = _core_clearance(
                    control[s], columns, cores, k, np.inf, scratch
                )
                continue
            margin = relative_to(control[s], columns, k, scratch)
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
def clearance(
    control: Array, columns: Array, radii: Array, cores: Cores, cutoff: float, axes: Rows
) -> Array:
    """Clearance (segments,) from the nearest obstacle, or `cutoff` if that is less."""
    result = np.empty(len(control))
    scratch = make_scratch(axes, len(radii), most_corners(cores))
    for s in range(len(control)):
        result[s] = segment_clearance(control[s], columns, radii, cores, cutoff, scratch)
    return result
