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

from ferguson_gym.curves.splines import basis
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from planners.optimization.convex.obstacle_rows import Surroundings, add_obstacles
from planners.optimization.convex.rows import (
    ENTRIES,
    Program,
    Weights,
    add_row,
    place_of,
    unknowns,
)
from planners.optimization.quadrature import BENDING

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(4)
_NODE_WEIGHTS = 0.5 * _NODE_WEIGHTS
_SLOPES = basis(0.5 * (_NODES + 1.0), 1)
_HODOGRAPH = np.array([[0.0, 0.0, 1.0, 0.0], [-3.0, 3.0, -1.0, -1.0], [0.0, 0.0, 0.0, 1.0]])
"""Bézier points of X'(t) from the rows of a control array."""
_BEZIER = np.array([[1, 0, 0, 0], [1, 0, 1 / 3, 0], [0, 1, 0, -1 / 3], [0, 1, 0, 0]])
_SMOOTH_ROWS = 4 + 12
"""Rows of a segment at most that are not those of obstacles."""
_MIN_SPEED = 1e-6
"""Derivatives below this count as having it [m per unit t]."""


class Terminal(NamedTuple):
    """The distance to go from the end of a chain."""

    final: bool
    """Whether the chain ends on the goal; the rest means nothing then."""
    ux: float
    """Unit direction in which the shortest path leaves the nominal end."""
    uy: float
    bend: float
    """Curvature of the level line of the distance to go there [1/m]."""


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
    count = add_row(row, shortest + given.margin - chord, k, n, final, count, out)
    for i in range(3):
        value = -given.progress * chord
        for a in range(4):
            row[a, 0], row[a, 1] = _HODOGRAPH[i, a] * ux, _HODOGRAPH[i, a] * uy
            value += row[a, 0] * control[a, 0] + row[a, 1] * control[a, 1]
        count = add_row(row, -value, k, n, final, count, out)
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
                count = add_row(row, -room, k, n, final, count, out)
    return count


@compiled
def _add_limits(most_change: float, out: Program) -> int:
    """Add the rows that limit the changes of the unknowns; returns their number."""
    m, width = len(out.gradient), out.rows.shape[1]
    for i in range(m):
        offset = min(i, m - width)
        for side in range(2):
            row = out.rows[2 * i + side]
            row[:] = 0.0
            row[i - offset] = 1.0 - 2.0 * side
            out.offsets[2 * i + side], out.least[2 * i + side] = offset, -most_change
    return 2 * m


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
    parts: int,
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
        parts: number of even parts of each segment; they are halved where normals turn far.
        bounds: (2, 2) of the field [m].
        around: obstacles of the field.
        shortest: length of a segment at least [m].
        given: constants.
        most: maximum number of rows.

    Returns:
        Whether the rows were enough, and the program.
    """
    n, final = len(control), terminal.final
    m = unknowns(n, final)
    out = Program(
        np.zeros((m, m)),
        np.zeros(m),
        np.empty((most, min(m, ENTRIES))),
        np.empty(most, np.int64),
        np.empty(most),
    )
    if 2 * m > most:
        return False, out
    count = _add_limits(given.change, out)
    for i in range(m):
        out.hessian[i, i] = given.damping
    for k in range(n):
        _add_length(control[k], k, n, final, out)
        _add_bending(control[k], k, n, final, given.bending, out)
        if count + _SMOOTH_ROWS > most:
            return False, out
        count = _add_progress(control[k], k, n, final, shortest, given, count, out)
        count = _add_bounds(control[k], k, n, final, bounds, given, count, out)
        count = add_obstacles(control[k], k, n, final, parts, around, given, count, out)
        if count > most:
            return False, out
    if not final:
        _add_terminal(terminal, n, out)
    rows, offsets, least = out.rows[:count], out.offsets[:count], out.least[:count]
    return True, Program(out.hessian, out.gradient, rows, offsets, least)
