"""Greatest speed and greatest acceleration across and along a cubic segment, proved, compiled.

With v = X' of degree 2, a = X'' of degree 1 and u = v / |v|, the squares of the three rates are
quotients N / D of polynomials: the square of the speed is |v|^2 / 1, that of the acceleration
across the path (v x a)^2 / |v|^2, and that of the acceleration along it (v . a)^2 / |v|^2. Since
a = v', the cubic terms of v x a cancel: it is of degree 2, and its square of degree 4; v . a is of
degree 3, and its square of degree 6.

A rate is at most b where the polynomial b^2 D - N has no negative Bernstein coefficient. Pieces of
the parameter on which that holds for b just above the greatest rate found at the ends of pieces
are discarded, and all others halved. Coefficients are computed from v and a of each halved piece,
and a bound on their rounding error is added. Where v nearly vanishes, a piece is also discarded
when |a| itself is small enough, since neither rate exceeds it.

Reference:
    Farouki & Rajan (1988), Algorithms for polynomials in Bernstein form, Computer Aided
    Geometric Design 5(1).
"""

from __future__ import annotations

import math

import numpy as np

from ferguson_gym.curves.nearest_point import products
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled

SPEED, ACROSS, ALONG = 0, 1, 2
"""The rates: |v|, |u x a| and |u . a|."""
SHARPNESS = 1e-8
"""Relative amount by which the square of a proved rate may exceed that of a rate attained."""
FLOOR = 1e-8
"""Accelerations below this part of the greatest |a| are not told apart."""
_EPSILON = 2.0**-52
_ROUNDING = 64.0 * _EPSILON
"""Bound on the error of a Bernstein coefficient, relative to its terms."""
_DEPTH = 40
"""Halvings of the parameter after which a piece is bounded by |a|."""
_PIECES = 4096
"""Number of pieces after which all others are bounded by |a|."""
_FAST = 1e8
"""A rate counts as attained where |v|^2 is at least so many times its rounding error."""
_SQUARE2, _SQUARE3 = products(2), products(3)
_RAISE = np.array(
    [[math.comb(4, j) * math.comb(2, i) / math.comb(6, i + j) for j in range(5)] for i in range(3)]
)
"""Weights (3, 5) of coefficient j of degree 4 in coefficient i + j of degree 6."""


@compiled
def _fill(v: Array, a: Array, rate: int, work: Array) -> tuple[int, float]:
    """Coefficients of N in work[0] and of D in work[1] on a piece.

    Returns:
        Their degree, and the greatest coefficient of the polynomial whose square N is.
    """
    above, below, speed2, q = work[0], work[1], work[2], work[3]
    for k in range(7):
        above[k] = below[k] = speed2[k] = 0.0
    for i in range(3):
        for j in range(3):
            speed2[i + j] += _SQUARE2[i, j] * (v[i, 0] * v[j, 0] + v[i, 1] * v[j, 1])
    if rate == SPEED:
        for k in range(5):
            above[k], below[k] = speed2[k], 1.0
        return 4, 1.0
    if rate == ACROSS:
        # the cubic with these values and slopes at its ends is the quadratic
        q[0] = v[0, 0] * a[0, 1] - v[0, 1] * a[0, 0]
        q[2] = v[2, 0] * a[1, 1] - v[2, 1] * a[1, 0]
        q[1] = 0.5 * (v[0, 0] * (a[0, 1] + a[1, 1]) - v[0, 1] * (a[0, 0] + a[1, 0]))
        for i in range(3):
            below[i], below[i + 2] = speed2[i], speed2[i + 2]
            for j in range(3):
                above[i + j] += _SQUARE2[i, j] * q[i] * q[j]
        return 4, max(abs(q[0]), abs(q[1]), abs(q[2]))
    q[0] = v[0, 0] * a[0, 0] + v[0, 1] * a[0, 1]
    q[1] = 2.0 * (v[1, 0] * a[0, 0] + v[1, 1] * a[0, 1]) + v[0, 0] * a[1, 0] + v[0, 1] * a[1, 1]
    q[2] = 2.0 * (v[1, 0] * a[1, 0] + v[1, 1] * a[1, 1]) + v[2, 0] * a[0, 0] + v[2, 1] * a[0, 1]
    q[1] /= 3.0
    q[2] /= 3.0
    q[3] = v[2, 0] * a[1, 0] + v[2, 1] * a[1, 1]
    for i in range(4):
        for j in range(4):
            above[i + j] += _SQUARE3[i, j] * q[i] * q[j]
    for i in range(3):
        for j in range(5):
            below[i + j] += _RAISE[i, j] * speed2[j]
    return 6, max(abs(q[0]), abs(q[1]), abs(q[2]), abs(q[3]))


@compiled
def _halve(v: Array, a: Array, left_v: Array, left_a: Array) -> None:
    """De Casteljau at the middle: v and a become their right halves."""
    for d in range(2):
        first, second = 0.5 * (v[0, d] + v[1, d]), 0.5 * (v[1, d] + v[2, d])
        left_v[0, d], left_v[1, d], left_v[2, d] = v[0, d], first, 0.5 * (first + second)
        v[0, d], v[1, d] = left_v[2, d], second
        middle = 0.5 * (a[0, d] + a[1, d])
        left_a[0, d], left_a[1, d], a[0, d] = a[0, d], middle, middle


@compiled
def _search(v: Array, a: Array, widths: Array, off_v: float, off_a: float, rate: int) -> float:
    """Square of a bound of a rate.

    Args:
        v: (depth, 3, 2), the first one filled, of norms up to 1.
        a: (depth, 2, 2), likewise.
        widths: (depth,), memory.
        off_v: bound on the rounding error of each v.
        off_a: of each a.
        rate: SPEED, ACROSS or ALONG.
    """
    work = np.empty((4, 7))
    bound = FLOOR * FLOOR
    widths[0] = 1.0
    top, examined = 0, 0
    while top >= 0:
        examined += 1
        fastest = most = 0.0
        for i in range(3):
            fastest = max(fastest, math.hypot(v[top, i, 0], v[top, i, 1]))
        for i in range(2):
            most = max(most, math.hypot(a[top, i, 0], a[top, i, 1]))
        steepest = (most + off_a) ** 2
        if rate != SPEED and steepest <= bound:
            top -= 1
            continue
        degree, root = _fill(v[top], a[top], rate, work)
        above, below = work[0], work[1]
        off = off_v * (2.0 * fastest + off_v)  # error of |v|^2
        if rate == SPEED:
            noise = _ROUNDING * fastest * fastest + off
        else:
            wrong = (fastest + off_v) * (most + off_a) - fastest * most
            noise = wrong * (2.0 * root + wrong) + _ROUNDING * root * fastest * most
        for k in (0, degree):
            if above[k] > 0.0 and below[k] > _FAST * off:
                # a rate that is found, and a little more
                bound = max(bound, (1.0 + SHARPNESS) * above[k] / below[k])
        if rate != SPEED:
            noise += bound * (off + _ROUNDING * fastest * fastest)
        worst = -np.inf
        for k in range(degree + 1):
            value = above[k] - bound * below[k]
            worst = max(worst, value) if value == value else np.inf  # NaN must not pass
        if worst + noise <= 0.0:
            top -= 1
            continue
        if widths[top] <= 2.0**-_DEPTH or examined >= _PIECES:
            bound = max(bound, (fastest + off_v) ** 2 if rate == SPEED else steepest)
            top -= 1
            continue
        _halve(v[top], a[top], v[top + 1], a[top + 1])
        widths[top] = widths[top + 1] = 0.5 * widths[top]
        top += 1
    return bound


@compiled
def greatest_rates(control: Array) -> Array:
    """Greatest |v|, |u x a|, |u . a| and |a| along planar segments (n, 4, 2): (n, 4), per unit t.

    Each is proved, rounding included, and exceeds the true value by at most about 1e-8 (relative),
    but where |v| nearly vanishes, and for accelerations below `FLOOR` times |a|.
    """
    found = np.empty((len(control), 4))
    v, a = np.empty((_DEPTH + 2, 3, 2)), np.empty((_DEPTH + 2, 2, 2))
    widths = np.empty(_DEPTH + 2)
    first_v, first_a = np.empty((3, 2)), np.empty((2, 2))
    for s in range(len(control)):
        largest = fastest = most = 0.0
        for d in range(2):
            start, end = control[s, 0, d], control[s, 1, d]
            leave, arrive = control[s, 2, d], control[s, 3, d]
            largest = max(largest, abs(start), abs(end), abs(leave), abs(arrive))
            first_v[0, d], first_v[2, d] = leave, arrive
            first_v[1, d] = 3.0 * (end - start) - leave - arrive
            for i in range(2):
                first_a[i, d] = 2.0 * (first_v[i + 1, d] - first_v[i, d])
        for i in range(3):
            fastest = max(fastest, math.hypot(first_v[i, 0], first_v[i, 1]))
        for i in range(2):
            most = max(most, math.hypot(first_a[i, 0], first_a[i, 1]))
        # of coordinates, and of halving up to `_DEPTH` times
        off_v = 16.0 * _EPSILON * largest + _DEPTH * _EPSILON * fastest
        off_a = 4.0 * off_v + _DEPTH * _EPSILON * most
        found[s, 3] = (most + off_a) * (1.0 + 4.0 * _EPSILON)
        for rate in (SPEED, ACROSS, ALONG):
            scale = fastest if rate == SPEED else most
            off = off_v if rate == SPEED else off_a
            if not scale > 64.0 * off or fastest == 0.0:
                found[s, rate] = scale + off  # nothing but rounding
                continue
            for d in range(2):  # squares of unscaled numbers could overflow
                for i in range(3):
                    v[0, i, d] = first_v[i, d] / fastest
                for i in range(2):
                    a[0, i, d] = first_a[i, d] / most if most > 0.0 else 0.0
            relative = off_a / most if most > 0.0 else 0.0
            bound = _search(v, a, widths, off_v / fastest, relative, rate)
            found[s, rate] = scale * math.sqrt(bound) * (1.0 + 4.0 * _EPSILON)
    return found
