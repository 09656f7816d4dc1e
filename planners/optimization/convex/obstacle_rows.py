"""Rows that keep the parts of a chain's segments beyond half-planes that turn around obstacles.

The normals are those of the nearest points of an obstacle's core at the ends of a part. A part is
halved for an obstacle whose normal turns far on it, as at a corner.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.convex_core import nearest_on_core, outward_normal
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from planners.optimization.convex.rows import Program, Weights, add_row
from planners.optimization.convex.turning_half_planes import ROWS, fill_part, fill_rows

_AXES = (0, 1)


class Surroundings(NamedTuple):
    """Obstacles: convex cores grown by radii, in the balls that bound them."""

    centers: Array
    """(2, N) of the balls [m]."""
    balls: Array
    """(N,) radii of the balls [m]."""
    corners: Array
    """(2, c) of the cores [m]."""
    first: NDArray[np.int64]
    """(N + 1,) index of the first corner of each core."""
    radii: Array
    """(N,) by which the cores are grown [m]."""


@compiled
def _normals_of(
    ends: Array, corners: Array, first: int, end: int, point: Array, normal: Array
) -> tuple[bool, complex, complex]:
    """Unit normals away from a core at both ends (2, 2) of a part; False if one has none."""
    found = (1.0 + 0.0j, 1.0 + 0.0j)
    for side in range(2):
        point[0], point[1] = ends[side, 0], ends[side, 1]
        near = nearest_on_core(point, corners, first, end, _AXES)
        outward_normal(point, near, corners, first, end, _AXES, normal)
        if normal[0] == 0.0 and normal[1] == 0.0:
            return False, found[0], found[1]
        here = complex(normal[0], normal[1])
        found = (here, found[1]) if side == 0 else (found[0], here)
    return True, found[0], found[1]


@compiled
def _supports(corners: Array, k: int, first: int, end: int, one: complex, two: complex) -> bool:
    """Whether a corner is the foremost one for a direction between two normals.

    Those at which the core ends for either normal, and those between them, all of which the
    normals' cone contains.
    """
    if end - first == 1:
        return True
    before, after = k - 1 if k > first else end - 1, k + 1 if k + 1 < end else first
    # the normals at a corner are those between the normals of its two edges; both cones are convex
    for normal in (one, two):
        rise_before = rise_after = 0.0
        rise_before += normal.real * (corners[0, before] - corners[0, k])
        rise_before += normal.imag * (corners[1, before] - corners[1, k])
        rise_after += normal.real * (corners[0, after] - corners[0, k])
        rise_after += normal.imag * (corners[1, after] - corners[1, k])
        if rise_before <= 0.0 and rise_after <= 0.0:
            return True
    if end - first == 2:
        return False
    ex, ey = corners[0, k] - corners[0, before], corners[1, k] - corners[1, before]
    edge = complex(ey, -ex)  # outwards, the core is on the left of its edges
    return (edge * one.conjugate()).imag * (edge * two.conjugate()).imag < 0.0 and (
        edge * (one + two).conjugate()
    ).real > 0.0


@compiled
def _fill_ends(part: Array, control: Array, ends: Array) -> None:
    """Fill the ends (2, 2) of a part of a segment."""
    for d in range(2):
        ends[0, d] = ends[1, d] = 0.0
        for a in range(4):
            ends[0, d] += part[0, a] * control[a, d]
            ends[1, d] += part[3, a] * control[a, d]


@compiled
def _add_obstacle(
    control: Array,
    k: int,
    n: int,
    final: bool,
    parts: int,
    p: int,
    one: int,
    around: Surroundings,
    given: Weights,
    count: int,
    out: Program,
) -> int:
    """Add the half-planes of a part that keep it from an obstacle, as `add_obstacles` does."""
    weights, values = np.empty((ROWS, 4, 2)), np.empty(ROWS)
    ends, point, normal, part = np.empty((2, 2)), np.empty(2), np.empty(2), np.empty((4, 4))
    corners, first, end = around.corners, around.first[one], around.first[one + 1]
    keep = around.radii[one] + given.margin
    halves = 1 << given.halvings  # the part in the smallest steps
    begin = 0
    while begin < halves:
        # the largest piece that begins here, halved while the normal turns too far on it
        width = begin & -begin if begin > 0 else halves
        while True:
            low, high = begin / halves, (begin + width) / halves
            fill_part((p + low) / parts, (p + high) / parts, part)
            _fill_ends(part, control, ends)
            known, before, after = _normals_of(ends, corners, first, end, point, normal)
            turned = after * before.conjugate()
            if width == 1 or not known or turned.real >= np.cos(given.turn):
                break
            width //= 2
        begin += width
        if not known:
            continue
        for corner in range(first, end):
            if not _supports(corners, corner, first, end, before, after):
                continue
            if count + ROWS > len(out.rows):
                return len(out.rows) + 1
            x, y = corners[0, corner], corners[1, corner]
            fill_rows(part, control, before, after, x, y, keep, weights, values)
            for i in range(ROWS):
                count = add_row(weights[i], -values[i], k, n, final, count, out)
    return count


@compiled
def add_obstacles(
    control: Array,
    k: int,
    n: int,
    final: bool,
    parts: int,
    around: Surroundings,
    given: Weights,
    count: int,
    out: Program,
) -> int:
    """Add the half-planes of a segment; returns a number beyond the rows if there are too few."""
    ends, point, part = np.empty((2, 2)), np.empty(2), np.empty((4, 4))
    for p in range(parts):
        fill_part(p / parts, (p + 1) / parts, part)
        _fill_ends(part, control, ends)
        mx, my = 0.5 * (ends[0, 0] + ends[1, 0]), 0.5 * (ends[0, 1] + ends[1, 1])
        half = 0.5 * np.sqrt((ends[1, 0] - ends[0, 0]) ** 2 + (ends[1, 1] - ends[0, 1]) ** 2)
        for one in range(len(around.balls)):
            wide = around.balls[one] + given.reach + half
            dx, dy = around.centers[0, one] - mx, around.centers[1, one] - my
            if dx * dx + dy * dy > wide * wide:
                continue
            begin, end = around.first[one], around.first[one + 1]
            if end - begin > 1:
                point[0], point[1] = mx, my
                near = nearest_on_core(point, around.corners, begin, end, _AXES)
                if near.distance > around.radii[one] + given.reach + half:
                    continue
            count = _add_obstacle(control, k, n, final, parts, p, one, around, given, count, out)
            if count > len(out.rows):
                return count
    return count
