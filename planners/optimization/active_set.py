"""Strictly convex quadratic programs of few unknowns, by a compiled dual active-set method.

The unconstrained minimum is the first point. As long as a row is violated, the most violated one
becomes active, and rows whose multipliers would change their sign leave the active set. A program
without a feasible point is recognised. Rows may be elastic: violating one by a length costs that
length times a price, which then bounds the row's multiplier.

Reference:
    Goldfarb & Idnani (1983), A numerically stable dual method for solving strictly convex
    quadratic programs, Mathematical Programming 27.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from planners.optimization.normals import add_normal, drop_normal, factor, solve_triangle

Integers = NDArray[np.int64]

FREE, ACTIVE, PRICED = 0, 1, 2
"""States of a row: it does not matter; it is kept with equality; it is violated at its price."""
SOLVED, INFEASIBLE, CAPPED = 0, 1, 2
"""Results of a solve: the minimum; there is no feasible point; the cap of iterations was reached
(or the Hessian is not positive definite)."""
_VIOLATED = 1e-9
"""Violation of a row above which it is not satisfied, in its own unit."""
_DEPENDENT = 1e-13
"""Square of the part of a normal, in the metric of the Hessian, that no active normal covers,
relative to that of the normal, below which it counts as dependent on them."""
_INDEPENDENT = 1e-6
"""The same, below which a row of the guess does not become active."""


class Rows(NamedTuple):
    """Rows A x >= b, whose violations cost a price, and bounds, which are kept."""

    entries: Array
    """(r, w) entries of A, with normals of similar size; the rest of each row is zero."""
    offsets: Integers
    """(r,) column of the first of them; all zero where w is m."""
    least: Array
    """(r,) b."""
    price: float
    """Cost of violating a row by one; infinite if rows must be kept."""
    low: Array
    """(m,) lower bounds of x; (0,) without bounds."""
    high: Array
    """(m,) upper bounds of x, or (0,)."""
    state: Integers
    """(r,) FREE, ACTIVE or PRICED: a guess before, the result after minimisation."""
    multipliers: Array
    """(r,), filled: 0 of FREE rows, the price of PRICED ones."""


@compiled
def _worst(rows: Rows, bound: Integers, x: Array) -> tuple[int, float]:
    """The row or bound that a point contradicts most, and its value; -1 if it contradicts none.

    The lower bounds count on from the rows, the upper ones from those. The value is positive for a
    PRICED row that is more than satisfied, negative for all others.
    """
    which, value, worst = -1, 0.0, _VIOLATED
    number, width, m = rows.entries.shape[0], rows.entries.shape[1], len(x)
    for i in range(number):
        state = rows.state[i]
        if state == ACTIVE:
            continue
        here, begin = -rows.least[i], rows.offsets[i]
        for j in range(width):
            here += rows.entries[i, j] * x[begin + j]
        if (here if state == PRICED else -here) > worst:
            which, value, worst = i, here, abs(here)
    for j in range(len(rows.low)):
        here = x[j] - rows.low[j]
        if -here > worst and bound[j] != ACTIVE:
            which, value, worst = number + j, here, -here
        here = rows.high[j] - x[j]
        if -here > worst and bound[m + j] != ACTIVE:
            which, value, worst = number + m + j, here, -here
    return which, value


@compiled
def _fill_share(basis: Array, rows: Rows, which: int, share: Array) -> None:
    """Fill the coefficients (m,) in the basis of the normal of a row or bound."""
    number, m = len(rows.entries), len(share)
    if which >= number:
        lower = which < number + m
        place = which - number if lower else which - number - m
        for j in range(m):
            share[j] = basis[place, j] if lower else -basis[place, j]
        return
    share[:] = 0.0
    for i in range(rows.entries.shape[1]):
        entry, place = rows.entries[which, i], rows.offsets[which] + i
        for j in range(m):
            share[j] += basis[place, j] * entry


@compiled
def _pull(linear: Array, rows: Rows, which: int) -> None:
    """Add the price of a row to the gradient (m,)."""
    for i in range(rows.entries.shape[1]):
        linear[rows.offsets[which] + i] -= rows.price * rows.entries[which, i]


@compiled
def _right_side(rows: Rows, which: int, m: int) -> float:
    number = len(rows.entries)
    if which < number:
        return float(rows.least[which])
    return float(rows.low[which - number] if which < number + m else -rows.high[which - number - m])


class _Active(NamedTuple):
    """The active rows and bounds, a basis in which their normals are triangular, and scratch."""

    basis: Array
    triangle: Array
    members: Integers
    multipliers: Array
    linear: Array
    """(m,) gradient with the pull of PRICED rows."""
    along: Array
    """(m,) coordinates of the minimum among active rows."""


@compiled
def _settle(now: _Active, rows: Rows, active: int, x: Array) -> None:
    """Fill the minimum among active rows (m,) and their multipliers."""
    m, along = len(x), now.along
    right = np.empty(m)
    for j in range(m):
        along[j] = 0.0
    for i in range(m):
        for j in range(m):
            along[j] -= now.basis[i, j] * now.linear[i]
    for k in range(active):
        total = _right_side(rows, now.members[k], m)
        for i in range(k):
            total -= now.triangle[i, k] * right[i]
        right[k] = total / now.triangle[k, k]
    for k in range(active):
        along[k], right[k] = right[k], right[k] - along[k]
    solve_triangle(now.triangle, right, active, now.multipliers)
    for i in range(m):
        x[i] = 0.0
        for j in range(m):
            x[i] += now.basis[i, j] * along[j]


@compiled
def _leave(now: _Active, rows: Rows, place: int, active: int, priced: bool) -> None:
    """Let the member at a place leave the active set."""
    which = now.members[place]
    if which < len(rows.entries):
        rows.state[which] = PRICED if priced else FREE
    drop_normal(now.basis, now.triangle, place, active)
    for i in range(place, active - 1):
        now.members[i], now.multipliers[i] = now.members[i + 1], now.multipliers[i + 1]


@compiled
def _begin(now: _Active, rows: Rows, x: Array, share: Array) -> int:
    """Start from the guess of states, as far as multipliers agree; return the number of active."""
    m, active = len(x), 0
    for i in range(len(rows.entries)):
        if rows.state[i] == PRICED:
            _pull(now.linear, rows, i)
        elif rows.state[i] == ACTIVE:
            _fill_share(now.basis, rows, i, share)
            whole = free = 0.0
            for j in range(m):
                whole += share[j] * share[j]
                free += share[j] * share[j] if j >= active else 0.0
            if active == m or free <= _INDEPENDENT * whole:
                rows.state[i] = FREE
                continue
            add_normal(now.basis, now.triangle, share, active)
            now.members[active] = i
            active += 1
    while True:
        _settle(now, rows, active, x)
        leaving, worst = -1, 0.0
        for i in range(active):
            out = max(-now.multipliers[i], now.multipliers[i] - rows.price)
            if out > worst:
                leaving, worst = i, out
        if leaving < 0:
            return active
        priced = now.multipliers[leaving] > 0.0
        if priced:
            _pull(now.linear, rows, now.members[leaving])
        _leave(now, rows, leaving, active, priced)
        active -= 1


@compiled
def minimise_elastic(
    hessian: Array, gradient: Array, rows: Rows, x: Array, cap: int
) -> tuple[int, int]:
    """Minimise 1/2 x' H x + g' x + price sum of violations, within bounds.

    Args:
        hessian: (m, m) H, positive definite; its lower triangle is read.
        gradient: (m,) g.
        rows: and bounds; their states and multipliers are filled.
        x: (m,), filled with the minimum if there is one.
        cap: maximum number of iterations, each of which lets a row enter or leave the active set.

    Returns:
        SOLVED, INFEASIBLE or CAPPED, and the number of iterations.
    """
    m, number = len(gradient), len(rows.entries)
    now = _Active(
        np.empty((m, m)),
        np.zeros((m + 1, m + 1)),
        np.zeros(m + 1, np.int64),
        np.zeros(m + 1),
        gradient.copy(),
        np.empty(m),
    )
    share, change, bound = np.empty(m), np.empty(m + 1), np.zeros(2 * len(rows.low), np.int64)
    basis, triangle, members, multipliers = now.basis, now.triangle, now.members, now.multipliers
    if not factor(hessian, basis):
        return CAPPED, 0
    active, iterations = _begin(now, rows, x, share), 0
    entering, value = _worst(rows, bound, x)
    pressure = 0.0  # by how much the multiplier of the entering row has changed
    while entering >= 0:
        if iterations >= cap:
            return CAPPED, iterations
        iterations += 1
        whole = free = 0.0
        _fill_share(basis, rows, entering, share)
        for j in range(m):
            # a PRICED row lets its multiplier fall
            share[j] = -share[j] if value > 0.0 else share[j]
            whole += share[j] * share[j]
            if j >= active:
                free += share[j] * share[j]
        solve_triangle(triangle, share, active, change)
        leaving, dual = -1, np.inf
        for i in range(active):
            if change[i] > 0.0 and multipliers[i] < dual * change[i]:
                leaving, dual = i, multipliers[i] / change[i]
            elif change[i] < 0.0 and members[i] < number:
                room = rows.price - multipliers[i]
                if room < -dual * change[i]:
                    leaving, dual = i, -room / change[i]
        independent = active < m and free > _DEPENDENT * whole
        primal = abs(value) / free if independent else np.inf
        own = rows.price - pressure if entering < number else np.inf
        length = min(primal, dual, own)
        if length == np.inf:
            return INFEASIBLE, iterations
        for i in range(active):
            multipliers[i] -= length * change[i]
        pressure += length
        if independent:
            for i in range(m):
                step = 0.0
                for j in range(active, m):
                    step += basis[i, j] * share[j]
                x[i] += length * step
        if length == primal:
            if value > 0.0:
                pressure = rows.price - pressure
                for j in range(m):
                    share[j] = -share[j]
            add_normal(basis, triangle, share, active)
            members[active], multipliers[active] = entering, pressure
            if entering < number:
                rows.state[entering] = ACTIVE
            else:
                bound[entering - number] = ACTIVE
            active += 1
        elif length == dual:
            which = members[leaving]
            if which >= number:
                bound[which - number] = FREE
            _leave(now, rows, leaving, active, change[leaving] < 0.0)
            active -= 1
            if independent:
                value += length * free if value < 0.0 else -length * free
            continue
        else:
            rows.state[entering] = PRICED if value < 0.0 else FREE
        entering, value = _worst(rows, bound, x)
        pressure = 0.0
    _finish(now, rows, gradient, active, x)
    return SOLVED, iterations


@compiled
def _finish(now: _Active, rows: Rows, gradient: Array, active: int, x: Array) -> None:
    """Fill the minimum and the multipliers again, without the rounding of many steps."""
    now.linear[:] = gradient
    for i in range(len(rows.entries)):
        rows.multipliers[i] = rows.price if rows.state[i] == PRICED else 0.0
        if rows.state[i] == PRICED:
            _pull(now.linear, rows, i)
    _settle(now, rows, active, x)
    for k in range(active):
        if now.members[k] < len(rows.entries):
            rows.multipliers[now.members[k]] = max(now.multipliers[k], 0.0)


@compiled
def minimise(
    hessian: Array,
    gradient: Array,
    rows: Array,
    offsets: Integers,
    least: Array,
    x: Array,
    cap: int,
) -> tuple[int, int]:
    """Minimise 1/2 x' H x + g' x subject to A x >= b.

    Args:
        hessian: (m, m) H, positive definite; its lower triangle is read.
        gradient: (m,) g.
        rows: (r, w) entries of A, with normals of similar size; the rest of each row is zero.
        offsets: (r,) column of the first of them; all zero where w is m.
        least: (r,) b.
        x: (m,), filled with the minimum if there is one.
        cap: maximum number of iterations, each of which lets a row enter or leave the active set.

    Returns:
        SOLVED, INFEASIBLE or CAPPED, and the number of iterations.
    """
    none, number = np.empty(0), len(rows)
    state, multipliers = np.zeros(number, np.int64), np.empty(number)
    kept = Rows(rows, offsets, least, np.inf, none, none, state, multipliers)
    return minimise_elastic(hessian, gradient, kept, x, cap)
