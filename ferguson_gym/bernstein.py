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

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.arrays import Array
from ferguson_gym.compilation import compiled

SHARPNESS = 1e-10
"""The least norm found exceeds the true one by at most this part of the curve's scale."""
DEPTH = 96
"""Pieces held at once. A split leaves at most 3/4, so 96 reach below SHARPNESS; without the
bound, numbers that overflowed would run out of the scratch memory."""
_ROUNDING = 64.0 * 2.0**-52
"""Bound on the error of a coefficient of |Y|^2, relative to the largest |Y_i|^2."""
_MARGIN = 2e-10
"""Outward margin, part of the scale; covers the search (1e-10) and its rounding."""
_GRAIN = 1e-15
"""Outward margin, part of the largest coordinate; covers forming X(t) - c."""
_UNCONVEX = 16.0
"""What rounding may hide of a convex polynomial's bend and slope, in units of that error."""


@compiled
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


@compiled
def _norm(vector: Array) -> float:
    total = 0.0
    for value in vector:
        total += value * value
    return float(np.sqrt(total))


@compiled
def _least_of_convex(coefficients: Array, scratch: Array) -> tuple[float, float]:
    """Where a convex polynomial in Bernstein form is least, and a proved lower bound."""
    degree = len(coefficients) - 1
    low, high = 0.0, 1.0
    t = 0.5
    bound = -np.inf
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
        if slope == 0.0 or value - bound <= 1e-15 * abs(value) or high - low < 1e-16:
            break
        step = t - slope / curve if curve > 0.0 else low
        t = step if low < step < high else 0.5 * (low + high)
    return t, bound


@compiled
def least_norm(
    points: Array, enough: float, weights: Array, stack: Array, spans: Array, work: Array
) -> tuple[float, float]:
    """Least |Y(t)| over t in [0, 1], and where.

    Args:
        points: (n + 1, D) Bézier points of Y.
        enough: the search may stop looking below a least norm it has proved to be at
            least this (the value returned is then at least `enough`, not the least).
        weights: `products(n)`.
        stack: scratch (DEPTH, n + 1, D).
        spans: scratch (DEPTH, 2).
        work: scratch (2, 2n + 1).

    Returns:
        A norm that the curve attains and its parameter. The true least norm is smaller by
        at most SHARPNESS times the largest |Y_i|.
    """
    degree, dimension = points.shape[0] - 1, points.shape[1]
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
    best, where = _norm(stack[0, 0]), 0.0
    if _norm(stack[0, degree]) < best:
        best, where = _norm(stack[0, degree]), 1.0
    spans[0, 0], spans[0, 1] = 0.0, 1.0
    top = 0
    while top >= 0:
        piece = stack[top]
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
                    dot += piece[i, d] * piece[j, d]
                if i == j:
                    largest = max(largest, dot)
                coefficients[i + j] += (1.0 if i == j else 2.0) * weights[i, j] * dot
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
            t, bound = _least_of_convex(coefficients, scratch)
            # evaluated on the curve, where the square has lost digits
            norm2 = 0.0
            for d in range(dimension):
                for i in range(degree + 1):
                    scratch[i] = piece[i, d]
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
                spread = max(spread, abs(piece[i, d] - piece[0, d]))
        if dimension * spread <= SHARPNESS or top + 2 > DEPTH:
            top -= 1
            continue
        # de Casteljau: the left half goes on top, the right half stays below it
        for d in range(dimension):
            for i in range(degree + 1):
                scratch[i] = piece[i, d]
            stack[top + 1, 0, d] = scratch[0]
            for level in range(degree, 0, -1):
                for i in range(level):
                    scratch[i] += split * (scratch[i + 1] - scratch[i])
                stack[top + 1, degree - level + 1, d] = scratch[0]
            for i in range(degree + 1):
                piece[i, d] = scratch[i]
        middle = start + split * (end - start)
        spans[top, 0], spans[top, 1] = middle, end
        spans[top + 1, 0], spans[top + 1, 1] = start, middle
        norm = _norm(stack[top, 0])
        if norm < best:
            best, where = norm, middle
        top += 1
    return best * scale, where


@compiled
def _shift(control: Array, center: Array, points: Array) -> tuple[float, float]:
    """Fill Bézier points of X - c; return their largest norm and coordinate."""
    scale2 = largest = 0.0
    for d in range(control.shape[1]):
        start, end = control[0, d], control[1, d]
        leave, arrive = control[2, d] / 3.0, control[3, d] / 3.0
        points[0, d] = start - center[d]
        points[1, d] = start - center[d] + leave
        points[2, d] = end - center[d] - arrive
        points[3, d] = end - center[d]
        largest = max(largest, abs(start), abs(end), abs(leave), abs(arrive), abs(center[d]))
    for i in range(4):
        norm2 = 0.0
        for d in range(control.shape[1]):
            norm2 += points[i, d] ** 2
        scale2 = max(scale2, norm2)
    return float(np.sqrt(scale2)), largest


@compiled
def _margin(scale: float, largest: float) -> float:
    return _MARGIN * scale + _GRAIN * largest


@compiled
def _far(points: Array, reach: float) -> bool:
    """Whether the disc around the control points' middle alone proves |Y| >= reach."""
    middle2 = around2 = 0.0
    for d in range(points.shape[1]):
        middle = 0.5 * (points[0, d] + points[3, d])
        middle2 += middle * middle
    for i in range(4):
        norm2 = 0.0
        for d in range(points.shape[1]):
            norm2 += (points[i, d] - 0.5 * (points[0, d] + points[3, d])) ** 2
        around2 = max(around2, norm2)
    return bool(np.sqrt(middle2) - np.sqrt(around2) >= reach)


@compiled
def closest(control: Array, centers: Array, radii: Array) -> tuple[Array, Array]:
    """Clearance (segments, discs) and parameter; see `ferguson_gym.clearance.closest`."""
    segments, dimension, discs = len(control), control.shape[2], len(radii)
    clear, where = np.empty((segments, discs)), np.empty((segments, discs))
    points, weights = np.empty((4, dimension)), products(3)
    stack, spans, work = np.empty((DEPTH, 4, dimension)), np.empty((DEPTH, 2)), np.empty((2, 7))
    for s in range(segments):
        for k in range(discs):
            scale, largest = _shift(control[s], centers[k], points)
            norm, t = least_norm(points, np.inf, weights, stack, spans, work)
            clear[s, k] = norm - _margin(scale, largest) - radii[k]
            where[s, k] = t
    return clear, where


@compiled
def clearance(control: Array, centers: Array, radii: Array) -> Array:
    """Clearance (segments,) from the nearest disc; see `ferguson_gym.clearance`."""
    segments, dimension, discs = len(control), control.shape[2], len(radii)
    result = np.empty(segments)
    points, weights = np.empty((4, dimension)), products(3)
    stack, spans, work = np.empty((DEPTH, 4, dimension)), np.empty((DEPTH, 2)), np.empty((2, 7))
    for s in range(segments):
        best = np.inf
        for k in range(discs):
            scale, largest = _shift(control[s], centers[k], points)
            margin = _margin(scale, largest)
            reach = best + margin + radii[k]
            if reach <= 0.0 or _far(points, reach):
                continue
            norm, _ = least_norm(points, reach, weights, stack, spans, work)
            best = min(best, norm - margin - radii[k])
        result[s] = best
    return result


@compiled
def is_clear(control: Array, centers: Array, radii: Array, least: float) -> NDArray[np.bool_]:
    """Whether segments keep `least` from all discs; see `ferguson_gym.clearance`."""
    segments, dimension, discs = len(control), control.shape[2], len(radii)
    result = np.ones(segments, dtype=np.bool_)
    points, weights = np.empty((4, dimension)), products(3)
    stack, spans, work = np.empty((DEPTH, 4, dimension)), np.empty((DEPTH, 2)), np.empty((2, 7))
    for s in range(segments):
        for k in range(discs):
            scale, largest = _shift(control[s], centers[k], points)
            reach = least + _margin(scale, largest) + radii[k]
            if reach <= 0.0 or _far(points, reach):
                continue
            norm, _ = least_norm(points, reach, weights, stack, spans, work)
            if norm < reach:
                result[s] = False
                break
    return result


@compiled
def least_speed(control: Array) -> tuple[Array, Array]:
    """Least speed (segments,) and its parameter; see `ferguson_gym.clearance`."""
    segments, dimension = len(control), control.shape[2]
    speed, where = np.empty(segments), np.empty(segments)
    points, weights = np.empty((3, dimension)), products(2)
    stack, spans, work = np.empty((DEPTH, 3, dimension)), np.empty((DEPTH, 2)), np.empty((2, 5))
    for s in range(segments):
        scale2 = largest = 0.0
        for d in range(dimension):
            start, end, leave, arrive = control[s, :, d]
            points[0, d], points[2, d] = leave, arrive
            points[1, d] = 3.0 * (end - start) - leave - arrive
            largest = max(largest, abs(start), abs(end), abs(leave), abs(arrive))
        for i in range(3):
            norm2 = 0.0
            for d in range(dimension):
                norm2 += points[i, d] ** 2
            scale2 = max(scale2, norm2)
        norm, where[s] = least_norm(points, np.inf, weights, stack, spans, work)
        speed[s] = max(0.0, norm - _margin(float(np.sqrt(scale2)), 8.0 * largest))
    return speed, where
