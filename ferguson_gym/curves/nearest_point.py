"""The certified search, compiled: where a Bézier curve comes nearest to the origin.

For a Bézier curve Y of degree n, |Y(t)|^2 is a polynomial of degree 2n. Its Bernstein
coefficients bound it from below, and subdivision tightens the bound. A branch ends early
where the coefficients show |Y|^2 monotone (its least value is at an end) or convex (a
tangent bounds it). Coefficients are formed anew from the points of each subdivided curve,
so their rounding error shrinks with the piece and the answer stays sharp at distance zero.

Reference:
    Farouki & Rajan (1987), On the numerical condition of polynomials in Bernstein form,
    Computer Aided Geometric Design 4(3).
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled

SHARPNESS = 1e-10
"""The least norm found exceeds the true one by at most this part of the curve's scale."""
DEPTH = 96
"""Pieces held at once. A split leaves at most 3/4, so 96 reach below SHARPNESS; without the
bound, numbers that overflowed would run out of the scratch memory."""
_ROUNDING = 64.0 * 2.0**-52
"""Bound on the error of a coefficient of |Y|^2, relative to the largest |Y_i|^2."""
_UNCONVEX = 16.0
"""What rounding may hide of a convex polynomial's bend and slope, in units of that error."""


def products(degree: int) -> Array:
    """Weights (n + 1, n + 1) of Y_i . Y_j in coefficient i + j of |Y|^2."""
    choose = np.zeros((2 * degree + 1, 2 * degree + 1))
    for n in range(2 * degree + 1):
        choose[n, 0] = 1.0
        for k in range(1, n + 1):
            choose[n, k] = choose[n - 1, k - 1] + choose[n - 1, k]
    weights = np.empty((degree + 1, degree + 1))
    for i in range(degree + 1):
        for j in range(degree + 1):
            weights[i, j] = choose[degree, i] * choose[degree, j] / choose[2 * degree, i + j]
    return weights


Rows: TypeAlias = tuple[int, ...]
"""Indices of rows or axes: the compiler knows a tuple's length and unrolls loops over it."""

QUADRATIC, CUBIC = (0, 1, 2), (0, 1, 2, 3)
"""Rows of curves of degree 2 and 3."""
_WEIGHTS = np.zeros((4, 4, 4))
_WEIGHTS[2, :3, :3], _WEIGHTS[3] = products(2), products(3)


@compiled
def _norm(stack: Array, piece: int, point: int, axes: Rows) -> float:
    total = 0.0
    for d in range(len(axes)):
        total += stack[piece, point, d] * stack[piece, point, d]
    return float(np.sqrt(total))


@compiled
def _least_of_convex(coefficients: Array, scratch: Array, rows: Rows) -> tuple[float, float]:
    """Where a convex polynomial in Bernstein form is least, and a proved lower bound."""
    degree = 2 * len(rows) - 2
    low, high = 0.0, 1.0
    falls = coefficients[0] - coefficients[1]
    rises = coefficients[degree] - coefficients[degree - 1]
    t = falls / (falls + rises) if falls > 0.0 and rises > 0.0 else 0.5
    bound = -np.inf
    # finer than a thousandth of what the caller must tell apart
    fine = 1e-13 * max(coefficients[0], coefficients[degree])
    for _ in range(40):
        for k in range(degree + 1):
            scratch[k] = coefficients[k]
        curve = slope = value = 0.0
        for level in range(degree, 0, -1):
            if level == 2:
                curve = degree * (degree - 1) * (scratch[2] - 2.0 * scratch[1] + scratch[0])
            if level == 1:
                slope = degree * (scratch[1] - scratch[0])
            for k in range(level):
                scratch[k] += t * (scratch[k + 1] - scratch[k])
        value = scratch[0]
        bound = max(bound, value - abs(slope) * (t if slope > 0.0 else 1.0 - t))
        if slope > 0.0:
            high = t
        else:
            low = t
        if slope == 0.0 or value - bound <= fine or high - low < 1e-16:
            break
        step = t - slope / curve if curve > 0.0 else low
        t = step if low < step < high else 0.5 * (low + high)
    return t, bound


@compiled
def nearest_point(
    points: Array, enough: float, rows: Rows, axes: Rows, stack: Array, spans: Array, work: Array
) -> tuple[float, float]:
    """Least |Y(t)| over t in [0, 1], and where.

    Args:
        points: (n + 1, D) Bézier points of Y.
        enough: the search may stop looking below a least norm it has proved to be at
            least this (the value returned is then at least `enough`, not the least).
        rows: QUADRATIC or CUBIC, the curve's n + 1 rows.
        axes: the D axes.
        stack: scratch (DEPTH, n + 1, D).
        spans: scratch (DEPTH, 2).
        work: scratch (2, 2n + 1).

    Returns:
        A norm that the curve attains and its parameter. The true least norm is smaller by
        at most SHARPNESS times the largest |Y_i|.
    """
    degree, dimension = len(rows) - 1, len(axes)
    coefficients, scratch = work[0], work[1]
    scale = 0.0
    for i in range(degree + 1):
        for d in range(dimension):
            scale = max(scale, abs(points[i, d]))
    if scale == 0.0:
        return 0.0, 0.0
    for i in range(degree + 1):
        for d in range(dimension):
            stack[0, i, d] = points[i, d] / scale  # squares would leave the range
    enough = enough / scale
    best, where = _norm(stack, 0, 0, axes), 0.0
    last = _norm(stack, 0, degree, axes)
    if last < best:
        best, where = last, 1.0
    spans[0, 0], spans[0, 1] = 0.0, 1.0
    top = 0
    while top >= 0:
        start, end = spans[top, 0], spans[top, 1]
        goal = min(best - SHARPNESS, enough)
        if goal <= 0.0:
            break
        for k in range(2 * degree + 1):
            coefficients[k] = 0.0
        largest = 0.0
        for i in range(degree + 1):
            for j in range(i, degree + 1):
                dot = 0.0
                for d in range(dimension):
                    dot += stack[top, i, d] * stack[top, j, d]
                if i == j:
                    largest = max(largest, dot)
                coefficients[i + j] += (1.0 if i == j else 2.0) * _WEIGHTS[degree, i, j] * dot
        least = coefficients[0]
        for k in range(1, 2 * degree + 1):
            least = min(least, coefficients[k])
        noise = _ROUNDING * largest
        if least - noise >= goal * goal:
            top -= 1
            continue
        convex = True
        for k in range(2 * degree - 1):
            if coefficients[k + 2] - 2.0 * coefficients[k + 1] + coefficients[k] < 0.0:
                convex = False
                break
        split = 0.5
        if convex:
            t, bound = _least_of_convex(coefficients, scratch, rows)
            # evaluated on the curve, where the square has lost digits
            norm2 = 0.0
            for d in range(dimension):
                for i in range(degree + 1):
                    scratch[i] = stack[top, i, d]
                for level in range(degree, 0, -1):
                    for i in range(level):
                        scratch[i] += t * (scratch[i + 1] - scratch[i])
                norm2 += scratch[0] * scratch[0]
            if np.sqrt(norm2) < best:
                best, where = float(np.sqrt(norm2)), start + t * (end - start)
                goal = min(best - SHARPNESS, enough)
            if goal <= 0.0 or bound - _UNCONVEX * noise >= goal * goal:
                top -= 1
                continue
            if 0.25 < t < 0.75:  # a piece that hardly shrinks would fill the stack
                split = t
        spread = 0.0
        for i in range(1, degree + 1):
            for d in range(dimension):
                spread = max(spread, abs(stack[top, i, d] - stack[top, 0, d]))
        if dimension * spread <= SHARPNESS or top + 2 > DEPTH:
            top -= 1
            continue
        # de Casteljau: the left half goes on top, the right half stays below it
        for d in range(dimension):
            for i in range(degree + 1):
                scratch[i] = stack[top, i, d]
            stack[top + 1, 0, d] = scratch[0]
            for level in range(degree, 0, -1):
                for i in range(level):
                    scratch[i] += split * (scratch[i + 1] - scratch[i])
                stack[top + 1, degree - level + 1, d] = scratch[0]
            for i in range(degree + 1):
                stack[top, i, d] = scratch[i]
        middle = start + split * (end - start)
        spans[top, 0], spans[top, 1] = middle, end
        spans[top + 1, 0], spans[top + 1, 1] = start, middle
        norm = _norm(stack, top, 0, axes)
        if norm < best:
            best, where = norm, middle
        top += 1
    return best * scale, where
