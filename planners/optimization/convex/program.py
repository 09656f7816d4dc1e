"""The quadratic program of a chain around a nominal one, written by compiled code.

Unknowns are the changes of the ends and end derivatives of a chain of n planar segments; a chain
that ends on the goal has its last end fixed. The objective is the chain's length to second order
around the nominal chain, by four Gauss nodes a segment, plus the distance to go from its end, to
second order, too: a line that supports it, and its curvature across. The rows are half-planes that
turn (`turning_half_planes`), Bézier points inside the bounds, and a least progress of the
derivative in the direction of each segment.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.convex_core import nearest_on_core, outward_normal
from ferguson_gym.curves.splines import basis
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from planners.optimization.convex.turning_half_planes import ROWS, fill_rows
from planners.optimization.quadrature import BENDING

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(4)
_NODE_WEIGHTS = 0.5 * _NODE_WEIGHTS
_SLOPES = basis(0.5 * (_NODES + 1.0), 1)
_HODOGRAPH = np.array([[0.0, 0.0, 1.0, 0.0], [-3.0, 3.0, -1.0, -1.0], [0.0, 0.0, 0.0, 1.0]])
"""Bézier points of X'(t) from the rows of a control array."""
_BEZIER = np.array([[1, 0, 0, 0], [1, 0, 1 / 3, 0], [0, 1, 0, -1 / 3], [0, 1, 0, 0]])
_AXES = (0, 1)
_SMOOTH_ROWS = 4 + 12
"""Rows of a segment at most that are not those of obstacles."""
_MIN_SPEED = 1e-6
"""Derivatives below this count as having it [m per unit t]."""


class Weights(NamedTuple):
    """Constants of the program."""

    bending: float = 1e-5
    """Weight of the integral of |X''|^2 over t [1/m]."""
    damping: float = 1e-4
    """Weight of the square of every change: it chooses among equally long parametrisations."""
    reach: float = 1.0
    """Distance from the nominal chain within which obstacles have rows [m]."""
    margin: float = 2e-6
    """Distance from obstacles that the rows keep, so that rounding breaks none [m]."""
    progress: float = 0.2
    """Least derivative in the direction of a segment's chord, relative to that."""
    change: float = 5.0
    """Largest change of a coordinate [m]."""


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


class Terminal(NamedTuple):
    """The distance to go from the end of a chain."""

    final: bool
    """Whether the chain ends on the goal; the rest means nothing then."""
    ux: float
    """Unit direction in which the shortest path leaves the nominal end."""
    uy: float
    bend: float
    """Curvature of the level line of the distance to go there [1/m]."""


class Program(NamedTuple):
    """min 1/2 x' H x + g' x with lower <= (x, A x) <= upper, as DAQP takes it."""

    hessian: Array
    """(m, m)."""
    gradient: Array
    """(m,)."""
    rows: Array
    """(r, m) A."""
    lower: Array
    """(m + r,)."""
    upper: Array
    """(m + r,)."""


@compiled
def unknowns(segments: int, final: bool) -> int:
    """Number m of unknowns of a chain."""
    return 4 * segments - 2 if final else 4 * segments


@compiled
def place_of(k: int, a: int, d: int, segments: int, final: bool) -> int:
    """The unknown that is coordinate d of row a of segment k; -1 if that is fixed."""
    if a == 0 or a == 2:
        k, a = k - 1, a + 1
    if k < 0:
        return -1
    if final and k == segments - 1:
        return -1 if a == 1 else 4 * k + d
    return 4 * k + d if a == 1 else 4 * k + 2 + d


@compiled
def _add_length(control: Array, k: int, n: int, final: bool, out: Program) -> None:
    """Add a segment's length to second order around the nominal segment (4, 2)."""
    along, across = np.empty(8), np.empty(8)
    for i in range(len(_NODE_WEIGHTS)):
        vx = vy = 0.0
        for a in range(4):
            vx += _SLOPES[i, a] * control[a, 0]
            vy += _SLOPES[i, a] * control[a, 1]
        speed = max(np.sqrt(vx * vx + vy * vy), _MIN_SPEED)
        ux, uy, weight = vx / speed, vy / speed, _NODE_WEIGHTS[i]
        for a in range(4):
            along[2 * a], along[2 * a + 1] = _SLOPES[i, a] * ux, _SLOPES[i, a] * uy
            across[2 * a], across[2 * a + 1] = -_SLOPES[i, a] * uy, _SLOPES[i, a] * ux
        for p in range(8):
            row = place_of(k, p // 2, p % 2, n, final)
            if row < 0:
                continue
            out.gradient[row] += weight * along[p]
            for q in range(8):
                column = place_of(k, q // 2, q % 2, n, final)
                if column >= 0:
                    out.hessian[row, column] += weight / speed * across[p] * across[q]


@compiled
def _add_bending(control: Array, k: int, n: int, final: bool, weight: float, out: Program) -> None:
    """Add a multiple of the integral of |X''|^2 over a segment (4, 2)."""
    for a in range(4):
        for d in range(2):
            row = place_of(k, a, d, n, final)
            if row < 0:
                continue
            for b in range(4):
                column = place_of(k, b, d, n, final)
                out.gradient[row] += 2.0 * weight * BENDING[a, b] * control[b, d]
                if column >= 0:
                    out.hessian[row, column] += 2.0 * weight * BENDING[a, b]


@compiled
def _add_row(
    weights: Array, least: float, k: int, n: int, final: bool, count: int, out: Program
) -> int:
    """Add the row weights . change >= least of a segment; returns the number of rows."""
    some = False
    row = out.rows[count]
    row[:] = 0.0
    for a in range(4):
        for d in range(2):
            place = place_of(k, a, d, n, final)
            if place >= 0 and weights[a, d] != 0.0:
                row[place] += weights[a, d]
                some = True
    if not some:  # nothing can change it
        return count
    m = len(out.gradient)
    out.lower[m + count], out.upper[m + count] = least, 1e30
    return count + 1


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
def _add_progress(
    control: Array,
    k: int,
    n: int,
    final: bool,
    shortest: float,
    given: Weights,
    count: int,
    out: Program,
) -> int:
    """Add the rows of a segment's chord and of its derivative's Bézier points along it."""
    row = np.zeros((4, 2))
    cx, cy = control[1, 0] - control[0, 0], control[1, 1] - control[0, 1]
    chord = max(np.sqrt(cx * cx + cy * cy), _MIN_SPEED)
    ux, uy = cx / chord, cy / chord
    # a segment is no shorter than its chord
    row[0, 0], row[0, 1], row[1, 0], row[1, 1] = -ux, -uy, ux, uy
    count = _add_row(row, shortest + given.margin - chord, k, n, final, count, out)
    for i in range(3):
        value = -given.progress * chord
        for a in range(4):
            row[a, 0], row[a, 1] = _HODOGRAPH[i, a] * ux, _HODOGRAPH[i, a] * uy
            value += row[a, 0] * control[a, 0] + row[a, 1] * control[a, 1]
        count = _add_row(row, -value, k, n, final, count, out)
    return count


@compiled
def _add_bounds(
    control: Array,
    k: int,
    n: int,
    final: bool,
    bounds: Array,
    given: Weights,
    count: int,
    out: Program,
) -> int:
    """Add the rows of a segment's Bézier points that changes could move out of the bounds."""
    row = np.zeros((4, 2))
    for d in range(2):
        for i in range(1, 4):
            at = 0.0
            for a in range(4):
                at += _BEZIER[i, a] * control[a, d]
            for side in range(2):
                sign = 1.0 if side == 0 else -1.0
                room = sign * (at - bounds[side, d]) - given.margin
                if room >= 2.0 * given.change:
                    continue
                row[:] = 0.0
                for a in range(4):
                    row[a, d] = sign * _BEZIER[i, a]
                count = _add_row(row, -room, k, n, final, count, out)
    return count


@compiled
def _add_obstacles(
    control: Array,
    k: int,
    n: int,
    final: bool,
    parts: Array,
    around: Surroundings,
    given: Weights,
    count: int,
    out: Program,
) -> int:
    """Add the half-planes of a segment; returns a number beyond the rows if there are too few."""
    weights, values = np.empty((ROWS, 4, 2)), np.empty(ROWS)
    ends, point, normal = np.empty((2, 2)), np.empty(2), np.empty(2)
    corners, first = around.corners, around.first
    for p in range(len(parts)):
        part = parts[p]
        for d in range(2):
            ends[0, d] = ends[1, d] = 0.0
            for a in range(4):
                ends[0, d] += part[0, a] * control[a, d]
                ends[1, d] += part[3, a] * control[a, d]
        mx, my = 0.5 * (ends[0, 0] + ends[1, 0]), 0.5 * (ends[0, 1] + ends[1, 1])
        half = 0.5 * np.sqrt((ends[1, 0] - ends[0, 0]) ** 2 + (ends[1, 1] - ends[0, 1]) ** 2)
        for one in range(len(around.balls)):
            wide = around.balls[one] + given.reach + half
            dx, dy = around.centers[0, one] - mx, around.centers[1, one] - my
            if dx * dx + dy * dy > wide * wide:
                continue
            begin, end = first[one], first[one + 1]
            if end - begin > 1:
                point[0], point[1] = mx, my
                near = nearest_on_core(point, corners, begin, end, _AXES)
                if near.distance > around.radii[one] + given.reach + half:
                    continue
            known, before, after = _normals_of(ends, corners, begin, end, point, normal)
            if not known:
                continue
            keep = around.radii[one] + given.margin
            for corner in range(begin, end):
                if not _supports(corners, corner, begin, end, before, after):
                    continue
                if count + ROWS > len(out.rows):
                    return len(out.rows) + 1
                x, y = corners[0, corner], corners[1, corner]
                fill_rows(part, control, before, after, x, y, keep, weights, values)
                for i in range(ROWS):
                    count = _add_row(weights[i], -values[i], k, n, final, count, out)
    return count


@compiled
def _add_terminal(terminal: Terminal, n: int, out: Program) -> None:
    """Add the distance to go from the chain's end to second order."""
    towards, across = (terminal.ux, terminal.uy), (-terminal.uy, terminal.ux)
    for d in range(2):
        row = place_of(n - 1, 1, d, n, False)
        out.gradient[row] -= towards[d]
        for e in range(2):
            column = place_of(n - 1, 1, e, n, False)
            out.hessian[row, column] += terminal.bend * across[d] * across[e]


@compiled
def assemble(
    control: Array,
    terminal: Terminal,
    parts: Array,
    bounds: Array,
    around: Surroundings,
    shortest: float,
    given: Weights,
    most: int,
) -> tuple[bool, Program]:
    """Write the program of a chain.

    Args:
        control: (n, 4, 2) nominal chain [m], from which the half-planes get their normals.
        terminal: of the chain.
        parts: (p, 4, 4) of `even_parts`, the parts of each segment.
        bounds: (2, 2) of the field [m].
        around: obstacles of the field.
        shortest: length of a segment at least [m].
        given: constants.
        most: maximum number of rows.

    Returns:
        Whether the rows were enough, and the program.
    """
    n, final = len(control), terminal.final
    m, count = unknowns(n, final), 0
    out = Program(
        np.zeros((m, m)), np.zeros(m), np.empty((most, m)), np.empty(m + most), np.empty(m + most)
    )
    for i in range(m):
        out.hessian[i, i] = given.damping
        out.lower[i], out.upper[i] = -given.change, given.change
    for k in range(n):
        _add_length(control[k], k, n, final, out)
        _add_bending(control[k], k, n, final, given.bending, out)
        if count + _SMOOTH_ROWS > most:
            return False, out
        count = _add_progress(control[k], k, n, final, shortest, given, count, out)
        count = _add_bounds(control[k], k, n, final, bounds, given, count, out)
        count = _add_obstacles(control[k], k, n, final, parts, around, given, count, out)
        if count > most:
            return False, out
    if not final:
        _add_terminal(terminal, n, out)
    end = m + count
    return True, Program(
        out.hessian, out.gradient, out.rows[:count], out.lower[:end], out.upper[:end]
    )
