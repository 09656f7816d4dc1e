"""The point of a Bézier curve nearest to the origin, by a certified branch and bound, compiled.

For a Bézier curve Y of degree n, |Y(t)|^2 is a polynomial of degree 2n. Its Bernstein coefficients
bound it from below, and subdivision tightens the bound. A piece is discarded where the bound is no
less than the best norm found. Where the coefficients show |Y|^2 to be convex, Newton's method finds
its minimum, and a tangent gives a lower bound. Coefficients are computed from the control points of
each subdivided curve, not from those of |Y|^2, so their rounding error shrinks with the piece and
the answer stays sharp at distance zero.

Reference:
    Farouki & Rajan (1987), On the numerical condition of polynomials in Bernstein form,
    Computer Aided Geometric Design 4(3).
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place

SHARPNESS = 1e-10
"""The least norm found exceeds the true one by at most this fraction of the curve's scale."""
DEPTH = 96
"""Maximum number of pieces on the stack. A split leaves at most 3/4 of a piece, so that 96 splits
reach below SHARPNESS. The limit also prevents writing past the scratch memory if values
overflow."""
_ROUNDING = 64.0 * 2.0**-52
"""Bound on the error of a coefficient of |Y|^2, relative to the largest |Y_i|^2."""
_UNCONVEX = 16.0
"""Rounding error of a convex polynomial's second and first differences, in units of `_ROUNDING`."""


def products(degree: int) -> Array:
    """Weights (n + 1, n + 1) of Y_i . Y_j in Bernstein coefficient i + j of |Y|^2, Y of degree n.

    Reference:
        Farouki & Rajan (1988), Algorithms for polynomials in Bernstein form, Computer Aided
        Geometric Design 5(1).
    """
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
def _convex_minimum(coefficients: Array, scratch: Array, rows: Rows) -> tuple[float, float]:
    """Minimiser of a convex polynomial in Bernstein form, and a proved lower bound.

    Newton's method, safeguarded by bisection; each tangent bounds the polynomial from below.
    """
    degree = 2 * len(rows) - 2
    low, high = 0.0, 1.0
    falls = coefficients[0] - coefficients[1]
    rises = coefficients[degree] - coefficients[degree - 1]
    t = falls / (falls + rises) if falls > 0.0 and rises > 0.0 else 0.5
    bound = -np.inf
    # a thousandth of `SHARPNESS`, the difference that matters to the caller
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


@compiled_in_place
def _fill_squared_norm(
    stack: Array, piece: int, coefficients: Array, rows: Rows, axes: Rows
) -> float:
    """Fill the Bernstein coefficients of |Y|^2 on a piece; return its largest |Y_i|^2."""
    degree = len(rows) - 1
    for k in range(2 * degree + 1):
        coefficients[k] = 0.0
    largest = 0.0
    for i in range(degree + 1):
        for j in range(i, degree + 1):
            dot = 0.0
            for d in range(len(axes)):
                dot += stack[piece, i, d] * stack[piece, j, d]
            if i == j:
                largest = max(largest, dot)
            coefficients[i + j] += (1.0 if i == j else 2.0) * _WEIGHTS[degree, i, j] * dot
    return largest


@compiled_in_place
def _least_coefficient(coefficients: Array, rows: Rows) -> float:
    least: float = coefficients[0]
    for k in range(1, 2 * len(rows) - 1):
        least = min(least, coefficients[k])
    return least


@compiled_in_place
def _is_convex(coefficients: Array, rows: Rows) -> bool:
    """Whether all second differences are nonnegative, hence the second derivative."""
    convex = True
    for k in range(2 * len(rows) - 3):
        if coefficients[k + 2] - 2.0 * coefficients[k + 1] + coefficients[k] < 0.0:
            convex = False
            break
    return convex


@compiled_in_place
def _norm_at(stack: Array, piece: int, t: float, scratch: Array, rows: Rows, axes: Rows) -> float:
    """|Y(t)| on a piece by de Casteljau's algorithm; |Y|^2 is inaccurate near zero."""
    degree = len(rows) - 1
    norm2 = 0.0
    for d in range(len(axes)):
        for i in range(degree + 1):
            scratch[i] = stack[piece, i, d]
        for level in range(degree, 0, -1):
            for i in range(level):
                scratch[i] += t * (scratch[i + 1] - scratch[i])
        norm2 += scratch[0] * scratch[0]
    return float(np.sqrt(norm2))


@compiled_in_place
def _spread(stack: Array, piece: int, rows: Rows, axes: Rows) -> float:
    """Largest coordinate of a piece's control points relative to its first."""
    spread = 0.0
    for i in range(1, len(rows)):
        for d in range(len(axes)):
            spread = max(spread, abs(stack[piece, i, d] - stack[piece, 0, d]))
    return spread


@compiled_in_place
def _subdivide(stack: Array, piece: int, t: float, scratch: Array, rows: Rows, axes: Rows) -> None:
    """De Casteljau's algorithm: the right part replaces the piece, the left one goes on top."""
    degree = len(rows) - 1
    for d in range(len(axes)):
        for i in range(degree + 1):
            scratch[i] = stack[piece, i, d]
        stack[piece + 1, 0, d] = scratch[0]
        for level in range(degree, 0, -1):
            for i in range(level):
                scratch[i] += t * (scratch[i + 1] - scratch[i])
            stack[piece + 1, degree - level + 1, d] = scratch[0]
        for i in range(degree + 1):
            stack[piece, i, d] = scratch[i]


@compiled
def nearest_point(
    points: Array,
    threshold: float,
    rows: Rows,
    axes: Rows,
    stack: Array,
    spans: Array,
    work: Array,
) -> tuple[float, float]:
    """Least |Y(t)| over t in [0, 1], and the t at which it is attained.

    Args:
        points: (n + 1, D) Bézier points of Y.
        threshold: the search may stop as soon as the least norm is proved to be at least this;
            the value returned is then at least `threshold`, not the least norm.
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
            stack[0, i, d] = points[i, d] / scale  # squares of unscaled numbers could overflow
    threshold = threshold / scale
    best, where = _norm(stack, 0, 0, axes), 0.0
    last = _norm(stack, 0, degree, axes)
    if last < best:
        best, where = last, 1.0
    spans[0, 0], spans[0, 1] = 0.0, 1.0
    top = 0
    while top >= 0:
        start, end = spans[top, 0], spans[top, 1]
        goal = min(best - SHARPNESS, threshold)
        if goal <= 0.0:
            break
        noise = _ROUNDING * _fill_squared_norm(stack, top, coefficients, rows, axes)
        if _least_coefficient(coefficients, rows) - noise >= goal * goal:
            top -= 1
            continue
        split = 0.5
        if _is_convex(coefficients, rows):
            t, bound = _convex_minimum(coefficients, scratch, rows)
            norm = _norm_at(stack, top, t, scratch, rows, axes)
            if norm < best:
                best, where = norm, start + t * (end - start)
                goal = min(best - SHARPNESS, threshold)
            if goal <= 0.0 or bound - _UNCONVEX * noise >= goal * goal:
                top -= 1
                continue
            if 0.25 < t < 0.75:  # pieces that hardly shrink would fill the stack
                split = t
        if dimension * _spread(stack, top, rows, axes) <= SHARPNESS or top + 2 > DEPTH:
            top -= 1
            continue
        _subdivide(stack, top, split, scratch, rows, axes)
        middle = start + split * (end - start)
        spans[top, 0], spans[top, 1] = middle, end
        spans[top + 1, 0], spans[top + 1, 1] = start, middle
        norm = _norm(stack, top, 0, axes)
        if norm < best:
            best, where = norm, middle
        top += 1
    return best * scale, where
