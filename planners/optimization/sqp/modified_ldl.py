"""A symmetric matrix made positive definite, compiled.

H is factorised as P' L D L' P with complete pivoting, D of blocks of one or two rows, and
the eigenvalues of D's blocks are raised. That costs an eighth of an eigenvalue
decomposition of H, and steps computed with either are about as good.

Reference:
    Bunch & Parlett (1971), Direct methods for solving symmetric indefinite systems of
    linear equations, SIAM J. Numer. Anal. 8(4). Cheng & Higham (1998), A modified Cholesky
    algorithm based on a symmetric indefinite factorization, SIAM J. Matrix Anal. 19(4).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place

Indices = NDArray[np.int64]

_PIVOT_THRESHOLD = (1.0 + np.sqrt(17.0)) / 8.0
"""Threshold of Bunch and Parlett for pivots of one row."""
_NEGATIVE_FRACTION = 0.3
"""A negative eigenvalue -a is replaced by this fraction of a, which bounds the step along it."""


@compiled
def _raised(value: float, floor: float) -> float:
    return max(value, _NEGATIVE_FRACTION * abs(value), floor)


@compiled
def _swap(
    rest: Array, lower: Array, scaled: Array, order: Indices, done: int, i: int, j: int
) -> None:
    """Exchange rows and columns i and j of the remainder, and rows of the finished columns."""
    if i == j:
        return
    for k in range(len(rest)):
        rest[i, k], rest[j, k] = rest[j, k], rest[i, k]
    for k in range(len(rest)):
        rest[k, i], rest[k, j] = rest[k, j], rest[k, i]
    for k in range(done):
        lower[i, k], lower[j, k] = lower[j, k], lower[i, k]
        scaled[i, k], scaled[j, k] = scaled[j, k], scaled[i, k]
    order[i], order[j] = order[j], order[i]


@compiled_in_place
def _pivots(rest: Array, k: int) -> tuple[float, int, float, int, int]:
    """Largest diagonal entry and its index, largest other entry and its two, in rows from k on."""
    diagonal = other = -1.0
    d, p, q = k, k, k
    for i in range(k, len(rest)):
        if abs(rest[i, i]) > diagonal:
            diagonal, d = abs(rest[i, i]), i
        for j in range(k, i):
            if abs(rest[i, j]) > other:
                other, p, q = abs(rest[i, j]), j, i
    return diagonal, d, other, p, q


@compiled_in_place
def _eliminate_one(rest: Array, lower: Array, scaled: Array, k: int, floor: float) -> None:
    """Eliminate row k with a pivot of one row."""
    n, pivot = len(rest), rest[k, k]
    if pivot != 0.0:
        for i in range(k + 1, n):
            lower[i, k] = rest[i, k] / pivot
    for i in range(k + 1, n):
        for j in range(k + 1, i + 1):
            rest[i, j] -= lower[i, k] * rest[j, k]
            rest[j, i] = rest[i, j]
    raised = _raised(pivot, floor)
    for i in range(k, n):
        scaled[i, k] = lower[i, k] * raised


@compiled_in_place
def _eliminate_two(rest: Array, lower: Array, scaled: Array, k: int, floor: float) -> None:
    """Eliminate rows k and k + 1 with a pivot of two rows."""
    n = len(rest)
    a, b, c = rest[k, k], rest[k + 1, k], rest[k + 1, k + 1]
    determinant = a * c - b * b
    for i in range(k + 2, n):
        u, v = rest[i, k], rest[i, k + 1]
        lower[i, k] = (u * c - v * b) / determinant
        lower[i, k + 1] = (v * a - u * b) / determinant
    for i in range(k + 2, n):
        for j in range(k + 2, i + 1):
            rest[i, j] -= lower[i, k] * rest[j, k] + lower[i, k + 1] * rest[j, k + 1]
            rest[j, i] = rest[i, j]
    middle, half = 0.5 * (a + c), 0.5 * (a - c)
    spread = np.sqrt(half * half + b * b)
    above, below = _raised(middle + spread, floor), _raised(middle - spread, floor)
    tilt = (above - below) / (2.0 * spread)
    a = below + tilt * (a - middle + spread)
    c = below + tilt * (c - middle + spread)
    b = tilt * b
    for i in range(k, n):
        scaled[i, k] = lower[i, k] * a + lower[i, k + 1] * b
        scaled[i, k + 1] = lower[i, k] * b + lower[i, k + 1] * c


@compiled
def make_definite(matrix: Array, floor: float, out: Array) -> None:
    """Fill `out` (n, n) with a positive definite matrix near a symmetric, finite one (n, n).

    `floor` > 0 is the least eigenvalue of a block of D.
    """
    n = len(matrix)
    rest, lower, scaled = matrix.copy(), np.eye(n), np.zeros((n, n))
    order = np.arange(n)
    k = 0
    while k < n:
        diagonal, d, other, p, q = _pivots(rest, k)
        if k == n - 1 or diagonal >= _PIVOT_THRESHOLD * other:
            _swap(rest, lower, scaled, order, k, k, d)
            _eliminate_one(rest, lower, scaled, k, floor)
            k += 1
        else:
            # p < q, and neither swap moves the other's row
            _swap(rest, lower, scaled, order, k, k, p)
            _swap(rest, lower, scaled, order, k, k + 1, q)
            _eliminate_two(rest, lower, scaled, k, floor)
            k += 2
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += scaled[i, k] * lower[j, k]
            out[order[i], order[j]] = out[order[j], order[i]] = total
