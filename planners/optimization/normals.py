"""Normals of active rows in a basis in which they are triangular, compiled.

The columns of the basis are orthonormal in the metric of the Hessian. Those of the first ones, as
many as there are active normals, span these.

Reference:
    Goldfarb & Idnani (1983), A numerically stable dual method for solving strictly convex
    quadratic programs, Mathematical Programming 27.
"""

from __future__ import annotations

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled


@compiled
def factor(hessian: Array, basis: Array) -> bool:
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
def add_normal(basis: Array, triangle: Array, share: Array, active: int) -> None:
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
def drop_normal(basis: Array, triangle: Array, place: int, active: int) -> None:
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
def solve_triangle(triangle: Array, right: Array, active: int, out: Array) -> None:
    """Fill `out` with the solution of R out = right, of the first `active` rows."""
    for i in range(active - 1, -1, -1):
        total = right[i]
        for j in range(i + 1, active):
            total -= triangle[i, j] * out[j]
        out[i] = total / triangle[i, i]
