"""The elastic quadratic program of one step.

    minimise    g.p + 1/2 p.H p + nu sum s
    subject to  c + A p >= -s,   s >= 0,   low <= x + p <= high,   |p_i| <= radius scale_i

where c contains the length constraints and the contacts that a step within the trust region can
reach. `planners.optimization.active_set` solves it, from the rows that were active before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from planners.optimization.active_set import ACTIVE, FREE, PRICED, SOLVED, Rows, minimise_elastic
from planners.optimization.sqp.contacts import Integers
from planners.optimization.sqp.expansion import Expansion, Layout
from planners.optimization.sqp.turn_contacts import LEFT, TURN_RATIO

_REACH = 2.5
"""Upper bound on the displacement [m] of any curve point for a step of 1 m in every point and 3 m
in every derivative."""
_PRICE = 1e4
"""nu, far above any multiplier: where the constraints can be satisfied, they are."""
_ITERATIONS, _ITERATIONS_EACH = 300, 15
"""Maximum number of changes of the active set, and at least so many for each unknown."""
_ACROSS = 8
"""Number of unknowns of a segment."""


class Program(NamedTuple):
    """Memory for quadratic programs."""

    entries: Array
    """(2 n + contacts, 8) of the rows: least lengths, greatest lengths, contacts."""
    offsets: Integers
    """(2 n + contacts,)."""
    least: Array
    """(2 n + contacts,)."""
    state: Integers
    """(2 n + contacts,)."""
    multipliers: Array
    """(2 n + contacts,)."""
    low: Array
    """(m,) bounds of the step."""
    high: Array
    """(m,)."""
    taken: Integers
    """The contact of each row after those of the lengths."""
    number: Integers
    """(1,) number of rows in use."""


@compiled
def empty_program(segments: int, unknowns: int, contacts: int) -> Program:
    """Memory for quadratic programs of windows."""
    rows = 2 * segments + contacts
    return Program(
        np.empty((rows, min(unknowns, _ACROSS))),
        np.empty(rows, np.int64),
        np.empty(rows),
        np.empty(rows, np.int64),
        np.empty(rows),
        np.empty(unknowns),
        np.empty(unknowns),
        np.empty(contacts, np.int64),
        np.zeros(1, np.int64),
    )


@compiled
def reach(radius: float) -> float:
    """Clearance [m] below which a contact may matter to a step within the radius."""
    return _REACH * radius


@compiled
def _add_row(
    out: Program, row: int, slope: Array, sign: float, place: Integers, least: float, pull: float
) -> None:
    """Fill in a row from a gradient (m,), of which only a segment's places are not zero."""
    m, width = len(slope), out.entries.shape[1]
    begin = m - width
    for i in range(len(place)):
        if place[i] >= 0:
            begin = min(begin, place[i])
    for j in range(width):
        out.entries[row, j] = sign * slope[begin + j]
    out.offsets[row], out.least[row] = begin, least
    out.state[row] = FREE if pull <= 0.0 else (PRICED if pull >= _PRICE else ACTIVE)


@compiled
def _fill(
    here: Expansion,
    contacts: int,
    x: Array,
    low: Array,
    high: Array,
    scale: Array,
    radius: float,
    layout: Layout,
    tension: Array,
    multiplier: Array,
    out: Program,
) -> None:
    """Fill in the quadratic program; multipliers are those of the step before."""
    m, segments, limits = len(x), len(here.length), layout.limits
    for i in range(m):
        out.low[i] = max(low[i] - x[i], -radius * scale[i])
        out.high[i] = min(high[i] - x[i], radius * scale[i])
    for k in range(segments):
        slope, place, length = here.length_slope[k], layout.place[k], here.length[k]
        _add_row(out, k, slope, 1.0, place, limits[0] - length, tension[k])
        _add_row(out, segments + k, slope, -1.0, place, length - limits[1], -tension[k])
    count = 2 * segments
    for row in range(contacts):
        contact = here.contact[row]
        swing = 1.0 if contact.what > LEFT else TURN_RATIO
        if contact.clearance < swing * _REACH * radius:
            place, least = layout.place[contact.segment], -contact.clearance
            _add_row(out, count, here.slope[row], 1.0, place, least, multiplier[row])
            out.taken[count - 2 * segments] = row
            count += 1
    out.number[0] = count


@compiled
def solve(
    here: Expansion,
    contacts: int,
    x: Array,
    low: Array,
    high: Array,
    scale: Array,
    radius: float,
    layout: Layout,
    gradient: Array,
    hessian: Array,
    tension: Array,
    multiplier: Array,
    out: Program,
    p: Array,
) -> bool:
    """Fill the step p (m,) and the program with its multipliers; False without a solution.

    The multipliers of lengths (n,), `tension`, and of contacts tell which rows to begin with.
    """
    _fill(here, contacts, x, low, high, scale, radius, layout, tension, multiplier, out)
    count = out.number[0]
    rows = Rows(
        out.entries[:count],
        out.offsets[:count],
        out.least[:count],
        _PRICE,
        out.low,
        out.high,
        out.state[:count],
        out.multipliers[:count],
    )
    cap = max(_ITERATIONS, _ITERATIONS_EACH * len(x))
    status, _ = minimise_elastic(hessian, gradient, rows, p, cap)
    return status == SOLVED
