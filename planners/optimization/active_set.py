"""Strictly convex quadratic programs of few unknowns, by a compiled dual active-set method.

The unconstrained minimum is the first point. As long as a row is violated, the most violated one
becomes active, and rows whose multipliers would change their sign leave the active set. A program
without a feasible point is recognised.

Reference:
    Goldfarb & Idnani (1983), A numerically stable dual method for solving strictly convex
    quadratic programs, Mathematical Programming 27.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled

SOLVED, INFEASIBLE, CAPPED = 0, 1, 2
"""Results of a solve: the minimum; there is no feasible point; the cap of iterations was reached
(or the Hessian is not positive definite)."""
_VIOLATED = 1e-9
"""Violation of a row above which it is not satisfied, in its own unit."""
_DEPENDENT = 1e-13
"""Square of the part of a normal, in the metric of the Hessian, that no active normal covers,
relative to that of the normal, below which it counts as dependent on them."""


@compiled
def _factor(hessian: Array, basis: Array) -> bool:
    """Fill the inverse of the transposed Cholesky factor (m, m); False if there is none."""
    m = len(hessian)
    lower = np.zeros((m, m))
    for i in range(m):
        for j in range(i + 1):
            total = hessian[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i > j:
                lower[i, j] = total / lower[j, j]
            elif total > 0.0:
                lower[i, i] = np.sqrt(total)
            else:
                return False
    basis[:] = 0.0
    for j in range(m):  # column j of the inverse of `lower` is row j of its transpose
        basis[j, j] = 1.0 / lower[j, j]
        for i in range(j + 1, m):
            total = 0.0
            for k in range(j, i):
                total -= lower[i, k] * basis[j, k]
            basis[j, i] = total / lower[i, i]
    return True


@compiled
def _add(basis: Array, triangle: Array, share: Array, active: int) -> None:
    """Let a normal with the coefficients `share` (m,) in the basis become active."""
    m = len(share)
    for j in range(m - 1, active, -1):
        one, two = share[j - 1], share[j]
        size = np.hypot(one, two)
        if size == 0.0:
            continue
        cos, sin = one / size, two / size
        share[j - 1], share[j] = size, 0.0
        for i in range(m):
            before, after = basis[i, j - 1], basis[i, j]
            basis[i, j - 1] = cos * before + sin * after
            basis[i, j] = cos * after - sin * before
    for i in range(active + 1):
        triangle[i, active] = share[i]


@compiled
def _drop(basis: Array, triangle: Array, place: int, active: int) -> None:
    """Let the active normal at a place leave."""
    m = len(basis)
    for j in range(place, active - 1):
        for i in range(j + 2):
            triangle[i, j] = triangle[i, j + 1]
    for j in range(place, active - 1):
        one, two = triangle[j, j], triangle[j + 1, j]
        size = np.hypot(one, two)
        if size == 0.0:
            continue
        cos, sin = one / size, two / size
        triangle[j, j], triangle[j + 1, j] = size, 0.0
        for k in range(j + 1, active - 1):
            before, after = triangle[j, k], triangle[j + 1, k]
            triangle[j, k] = cos * before + sin * after
            triangle[j + 1, k] = cos * after - sin * before
        for i in range(m):
            before, after = basis[i, j], basis[i, j + 1]
            basis[i, j] = cos * before + sin * after
            basis[i, j + 1] = cos * after - sin * before


@compiled
def _most_violated(
    rows: Array, offsets: NDArray[np.int64], least: Array, x: Array
) -> tuple[int, float]:
    """The row that a point violates most, and its value, which is negative; -1 if none is."""
    which, value = -1, -_VIOLATED
    for i in range(len(rows)):
        here, begin = -least[i], offsets[i]
        for j in range(rows.shape[1]):
            here += rows[i, j] * x[begin + j]
        if here < value:
            which, value = i, here
    return which, value


@compiled
def minimise(
    hessian: Array,
    gradient: Array,
    rows: Array,
    offsets: NDArray[np.int64],
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
    m = len(gradient)
    basis, triangle, multipliers = np.empty((m, m)), np.zeros((m + 1, m + 1)), np.zeros(m + 1)
    members, share = np.zeros(m + 1, np.int64), np.empty(m)
    step, change = np.empty(m), np.empty(m + 1)
    if not _factor(hessian, basis):
        return CAPPED, 0
    for j in range(m):
        share[j] = 0.0
        for i in range(m):
            share[j] -= basis[i, j] * gradient[i]
    for i in range(m):
        x[i] = 0.0
        for j in range(m):
            x[i] += basis[i, j] * share[j]
    active, iterations = 0, 0
    entering, value = _most_violated(rows, offsets, least, x)
    pressure = 0.0  # the multiplier of the entering row
    while entering >= 0:
        if iterations >= cap:
            return CAPPED, iterations
        iterations += 1
        whole = free = 0.0
        share[:] = 0.0
        for i in range(rows.shape[1]):
            entry, place = rows[entering, i], offsets[entering] + i
            for j in range(m):
                share[j] += basis[place, j] * entry
        for j in range(m):
            whole += share[j] * share[j]
            if j >= active:
                free += share[j] * share[j]
        for i in range(active - 1, -1, -1):
            total = share[i]
            for j in range(i + 1, active):
                total -= triangle[i, j] * change[j]
            change[i] = total / triangle[i, i]
        leaving, dual = -1, np.inf
        for i in range(active):
            if change[i] > 0.0 and multipliers[i] < dual * change[i]:
                leaving, dual = i, multipliers[i] / change[i]
        independent = active < m and free > _DEPENDENT * whole
        primal = -value / free if independent else np.inf
        if primal == np.inf and dual == np.inf:
            return INFEASIBLE, iterations
        length = min(primal, dual)
        for i in range(active):
            multipliers[i] -= length * change[i]
        pressure += length
        if independent:
            for i in range(m):
                step[i] = 0.0
                for j in range(active, m):
                    step[i] += basis[i, j] * share[j]
                x[i] += length * step[i]
            value += length * free
        if primal <= dual:
            _add(basis, triangle, share, active)
            members[active], multipliers[active] = entering, pressure
            active += 1
            entering, value = _most_violated(rows, offsets, least, x)
            pressure = 0.0
        else:
            _drop(basis, triangle, leaving, active)
            for i in range(leaving, active - 1):
                members[i], multipliers[i] = members[i + 1], multipliers[i + 1]
            active -= 1
    return SOLVED, iterations
