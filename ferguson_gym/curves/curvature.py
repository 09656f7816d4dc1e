"""The maximum curvature along a segment, compiled.

Let v be the derivative of a segment and C = v x v' (one number in the plane, one for each pair of
axes in more dimensions). Then curvature^2 is G / S^3 with G = |C|^2 and S = |v|^2. C is of degree
2, since its cubic terms cancel. Extremes are roots of P = G' S - 3 G S', a polynomial of degree 7.
Its Bernstein coefficients show on which pieces it has no root, and on which it has exactly one,
which Newton's method then finds. Those of G and S bound the curvature, so that pieces which cannot
contain the maximum are discarded; other pieces are halved. Coefficients are computed from v and C
of each halved piece, so that their rounding error shrinks with the piece; otherwise the three roots
of P that meet at a cusp could not be distinguished.

Reference:
    Farouki & Rajan (1988), Algorithms for polynomials in Bernstein form, Computer Aided
    Geometric Design 5(1).
"""

from __future__ import annotations

import math

import numpy as np

from ferguson_gym.curves.nearest_point import products
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place

CUSP_SPEED = 1e-12
"""|X'| that counts as a cusp, relative to the largest coordinate of the Bézier points of X'."""
_EPSILON = 2.0**-52
_SLACK = 1e-12
"""Relative amount by which a discarded piece may exceed the square of the maximum curvature."""
_DEPTH = 64
"""Halvings after which only the middle of a piece is evaluated."""
_PIECES = 4096
"""Upper limit of pieces examined."""
_STEPS = 60
"""Upper limit of steps towards a root; bisection alone would need no more."""
_SQUARE = products(2)
_EXTREME = np.array(
    [[math.comb(3, i) * math.comb(4, j) / math.comb(7, i + j) for j in range(5)] for i in range(4)]
)
"""Weights (4, 5) of coefficients i and j of factors of degree 3 and 4 in coefficient i + j of their
product, in Bernstein form."""


@compiled
def _crosses(v: Array, c: Array, control: Array, unit: float) -> None:
    """Fill c (pairs, 3) from v (3, D), both in Bernstein form; zero if c is only rounding.

    v was computed from a control array (4, D) and divided by `unit`.
    """
    dimension = v.shape[1]
    pair, straight = 0, True
    for d in range(dimension):
        for e in range(d):
            # rounding error of v, from the control rows and the sums that v consists of
            off_d = off_e = 0.0
            for row in range(4):
                weight = 3.0 if row < 2 else 1.0
                off_d += weight * (abs(control[row, d]) / unit)
                off_e += weight * (abs(control[row, e]) / unit)
            for k, (i, j, twice) in enumerate(((0, 1, 2.0), (0, 2, 1.0), (1, 2, 2.0))):
                c[pair, k] = twice * (v[i, d] * v[j, e] - v[j, d] * v[i, e])
                off = abs(v[i, d] * v[j, e]) + abs(v[j, d] * v[i, e])
                off += off_d * (abs(v[i, e]) + abs(v[j, e]))
                off += off_e * (abs(v[i, d]) + abs(v[j, d]))
                if abs(c[pair, k]) > twice * _EPSILON * off:
                    straight = False
            pair += 1
    if straight:
        c[:] = 0.0


@compiled
def _at(v: Array, c: Array, t: float) -> tuple[float, float]:
    """|v|^2 and curvature^2 at t of a piece with coefficients v (3, D) and c (pairs, 3)."""
    one, two, three = (1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t
    speed2 = bend2 = 0.0
    for d in range(v.shape[1]):
        speed2 += (one * v[0, d] + two * v[1, d] + three * v[2, d]) ** 2
    for pair in range(len(c)):
        bend2 += (one * c[pair, 0] + two * c[pair, 1] + three * c[pair, 2]) ** 2
    return speed2, bend2 / (speed2 * speed2 * speed2)


@compiled
def _fill(v: Array, c: Array, work: Array) -> None:
    """Coefficients of S in work[0, :5], of G in work[1, :5] and of P in work[2, :8]."""
    speed2, bend2, extreme = work[0], work[1], work[2]
    speed2[:5] = bend2[:5] = extreme[:8] = 0.0
    for i in range(3):
        for j in range(3):
            dot = cross = 0.0
            for d in range(v.shape[1]):
                dot += v[i, d] * v[j, d]
            for pair in range(len(c)):
                cross += c[pair, i] * c[pair, j]
            speed2[i + j] += _SQUARE[i, j] * dot
            bend2[i + j] += _SQUARE[i, j] * cross
    for i in range(4):
        rise, steeper = bend2[i + 1] - bend2[i], speed2[i + 1] - speed2[i]
        for j in range(5):
            extreme[i + j] += _EXTREME[i, j] * (rise * speed2[j] - 3.0 * steeper * bend2[j])


@compiled
def _root(extreme: Array, scratch: Array) -> float:
    """The only root in (0, 1) of a polynomial of degree 7 that changes from positive to negative.

    Newton's method, safeguarded by bisection.
    """
    low, high = 0.0, 1.0
    t = extreme[0] / (extreme[0] - extreme[7])
    for _ in range(_STEPS):
        for k in range(8):
            scratch[k] = extreme[k]
        slope = 0.0
        for level in range(7, 0, -1):
            if level == 1:
                slope = 7.0 * (scratch[1] - scratch[0])
            for k in range(level):
                scratch[k] += t * (scratch[k + 1] - scratch[k])
        if scratch[0] > 0.0:
            low = t
        else:
            high = t
        step = t - scratch[0] / slope if slope < 0.0 else low
        following = step if low < step < high else 0.5 * (low + high)
        if abs(following - t) <= 4.0 * _EPSILON * t:
            return float(following)
        t = following
    return float(t)


@compiled_in_place
def _fill_hodograph(control: Array, v: Array) -> tuple[float, float]:
    """Fill v (3, D), the Bézier points of X'(t), in units of a power of two; return scale, unit.

    The scale is their largest coordinate. Division by a power of two is exact; without it, powers
    of v could overflow or underflow.
    """
    scale = 0.0
    for d in range(control.shape[1]):
        leave, arrive = control[2, d], control[3, d]
        v[0, d], v[2, d] = leave, arrive
        v[1, d] = 3.0 * (control[1, d] - control[0, d]) - leave - arrive
        for i in range(3):
            scale = max(scale, abs(v[i, d]))
    if scale == 0.0:
        return 0.0, 1.0
    unit = 2.0 ** np.floor(np.log2(scale))
    for i in range(3):
        for d in range(control.shape[1]):
            v[i, d] /= unit
    return scale, unit


@compiled_in_place
def _coefficient_bounds(work: Array) -> tuple[float, float, float]:
    """Lower bound of S less its rounding error, upper bound of S, upper bound of G."""
    least, largest, most = work[0, 0], work[0, 0], work[1, 0]
    for k in range(1, 5):
        least, largest = min(least, work[0, k]), max(largest, work[0, k])
        most = max(most, work[1, k])
    return least - 16.0 * _EPSILON * largest, largest, most


@compiled_in_place
def _sign_changes(extreme: Array, noise: float) -> tuple[int, bool]:
    """Sign changes of the coefficients of P, and whether rounding cannot have changed a sign.

    By Descartes' rule P has no more roots in (0, 1) than its coefficients have sign changes.
    """
    changes, certain = 0, True
    for k in range(8):
        certain = certain and abs(extreme[k]) > noise
        if k > 0 and (extreme[k] > 0.0) != (extreme[k - 1] > 0.0):
            changes += 1
    return changes, certain


@compiled
def _greatest(control: Array, v: Array, c: Array, spans: Array, work: Array) -> float:
    """Maximum curvature [1/m] of one segment; infinite at a cusp.

    Args:
        control: (4, D), small enough that sums do not overflow.
        v: scratch (_DEPTH + 2, 3, D).
        c: scratch (_DEPTH + 2, pairs of axes, 3).
        spans: scratch (_DEPTH + 2,): number of times that each piece was halved.
        work: scratch (4, 8).
    """
    scale, unit = _fill_hodograph(control, v[0])
    if scale == 0.0:
        return np.inf
    _crosses(v[0], c[0], control, unit)
    rest = (CUSP_SPEED * scale / unit) ** 2
    best = 0.0
    for t in (0.0, 1.0):
        speed2, bend = _at(v[0], c[0], t)
        if speed2 <= rest:
            return np.inf
        best = max(best, bend)
    spans[0] = 0.0
    top, examined = 0, 0
    while top >= 0:
        examined += 1
        _fill(v[top], c[top], work)
        least, largest, most = _coefficient_bounds(work)
        if least > 0.0 and most <= best * (1.0 + _SLACK) * least * least * least:
            top -= 1
            continue
        # bound on the rounding error of a coefficient of P
        changes, certain = _sign_changes(work[2], 64.0 * _EPSILON * most * largest)
        if least > 0.0 and certain and changes <= 1:
            if changes == 1 and work[2, 0] > 0.0:
                _, bend = _at(v[top], c[top], _root(work[2], work[3]))
                best = max(best, bend)
            top -= 1
            continue
        speed2, bend = _at(v[top], c[top], 0.5)
        if speed2 <= rest:
            return np.inf
        best = max(best, bend)
        if spans[top] >= _DEPTH or examined >= _PIECES:
            top -= 1
            continue
        # de Casteljau at the middle: the right half replaces the piece, the left goes on top
        for d in range(control.shape[1]):
            _halve(v[top, :, d], v[top + 1, :, d])
        for pair in range(c.shape[1]):
            _halve(c[top, pair], c[top + 1, pair])
        spans[top] += 1.0
        spans[top + 1] = spans[top]
        top += 1
    return float(np.sqrt(best) / unit)


@compiled
def _halve(right: Array, left: Array) -> None:
    """Split coefficients (3,) of degree 2 at the middle; the right half stays."""
    one, two = 0.5 * (right[0] + right[1]), 0.5 * (right[1] + right[2])
    left[0], left[1], left[2] = right[0], one, 0.5 * (one + two)
    right[0], right[1] = left[2], two


@compiled
def greatest_curvatures(control: Array) -> Array:
    """Maximum curvature [1/m] of each segment (n, 4, D): (n,), infinite at a cusp."""
    dimension = control.shape[2]
    v = np.empty((_DEPTH + 2, 3, dimension))
    c = np.empty((_DEPTH + 2, dimension * (dimension - 1) // 2, 3))
    spans, work = np.empty(_DEPTH + 2), np.empty((4, 8))
    found = np.empty(len(control))
    for s in range(len(control)):
        found[s] = 0.125 * _greatest(0.125 * control[s], v, c, spans, work)
    return found
