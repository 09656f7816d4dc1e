"""Certified test of a minimum turn radius along whole segments.

Let v be the derivative of a planar cubic and c = v x v'. Its curvature |c| / |v|^3 is at most 1/R
where |v|^6 - R^2 c^2 >= 0, a polynomial of degree 12. Its Bernstein coefficients bound it from
below, and subdivision tightens the bound. Coefficients are computed from v and c of each
subdivided piece, so that their rounding error shrinks with the piece. The bound on that error is
subtracted, so that a positive answer is proved for the whole curve.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.curves.nearest_point import products
from ferguson_gym.curves.splines import as_control
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.world.limits import PAPER_LIMITS

_EPSILON = 2.0**-52
_DEPTH = 40
"""Halvings of the parameter after which an undecided piece fails the test."""
_PIECES = 4096
"""Number of pieces after which an undecided piece fails the test."""
_SQUARE = products(2)
_CHOOSE4 = np.array([1.0, 4.0, 6.0, 4.0, 1.0])
_CHOOSE8 = np.array([math.comb(8, k) for k in range(9)], np.float64)
_CHOOSE12 = np.array([math.comb(12, k) for k in range(13)], np.float64)


@compiled
def _fill(v: Array, c: Array, work: Array) -> float:
    """Coefficients of |v|^6 - c^2 in work[0, :13]; return a bound on their rounding error.

    v (3, 2) and c (3,) are Bernstein coefficients, the latter times R.
    """
    total, square, fourth = work[0], work[1], work[2]
    total[:] = square[:] = fourth[:] = 0.0
    speed2 = steep = 0.0
    for i in range(3):
        speed2 = max(speed2, v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1])
        steep = max(steep, abs(c[i]))
        for j in range(3):
            square[i + j] += _SQUARE[i, j] * (v[i, 0] * v[j, 0] + v[i, 1] * v[j, 1])
    for i in range(5):
        for j in range(5):
            fourth[i + j] += _CHOOSE4[i] * _CHOOSE4[j] / _CHOOSE8[i + j] * square[i] * square[j]
    for i in range(9):
        for j in range(5):
            total[i + j] += _CHOOSE8[i] * _CHOOSE4[j] / _CHOOSE12[i + j] * fourth[i] * square[j]
    # c^2 raised from degree 4 to 12
    for k in range(5):
        square[k] = 0.0
    for i in range(3):
        for j in range(3):
            square[i + j] += _SQUARE[i, j] * c[i] * c[j]
    for i in range(9):
        for j in range(5):
            total[i + j] -= _CHOOSE8[i] * _CHOOSE4[j] / _CHOOSE12[i + j] * square[j]
    return 64.0 * _EPSILON * (speed2 * speed2 * speed2 + steep * steep)


@compiled
def _halve(v: Array, c: Array, left_v: Array, left_c: Array) -> None:
    """De Casteljau at the middle: v and c become their right halves."""
    for d in range(2):
        first, second = 0.5 * (v[0, d] + v[1, d]), 0.5 * (v[1, d] + v[2, d])
        left_v[0, d], left_v[1, d], left_v[2, d] = v[0, d], first, 0.5 * (first + second)
        v[0, d], v[1, d] = left_v[2, d], second
    one, two = 0.5 * (c[0] + c[1]), 0.5 * (c[1] + c[2])
    left_c[0], left_c[1], left_c[2] = c[0], one, 0.5 * (one + two)
    c[0], c[1] = left_c[2], two


@compiled
def _too_sharp(control: Array, radius: float) -> float:
    """NaN if one segment (4, 2) provably keeps a radius, else where that failed, a parameter t."""
    v, c = np.empty((_DEPTH + 2, 3, 2)), np.empty((_DEPTH + 2, 3))
    spans, work = np.empty((_DEPTH + 2, 2)), np.empty((3, 13))
    scale = largest = 0.0
    for d in range(2):
        start, end, leave, arrive = control[0, d], control[1, d], control[2, d], control[3, d]
        v[0, 0, d], v[0, 2, d] = leave, arrive
        v[0, 1, d] = 3.0 * (end - start) - leave - arrive
        largest = max(largest, abs(start), abs(end), abs(leave), abs(arrive))
        for i in range(3):
            scale = max(scale, abs(v[0, i, d]))
    if not scale > 0.0:
        return 0.0
    for i in range(3):
        for d in range(2):
            v[0, i, d] /= scale  # avoids overflow of powers
    ratio = radius / scale
    c[0, 0] = 2.0 * ratio * (v[0, 0, 0] * v[0, 1, 1] - v[0, 0, 1] * v[0, 1, 0])
    c[0, 1] = ratio * (v[0, 0, 0] * v[0, 2, 1] - v[0, 0, 1] * v[0, 2, 0])
    c[0, 2] = 2.0 * ratio * (v[0, 1, 0] * v[0, 2, 1] - v[0, 1, 1] * v[0, 2, 0])
    # rounding error of v from coordinates and halving; the error of c is that times dc/dv
    off = 16.0 * _EPSILON * (largest / scale + _DEPTH)
    off_c = 16.0 * ratio * off
    spans[0, 0], spans[0, 1] = 0.0, 1.0
    top, examined = 0, 0
    while top >= 0:
        examined += 1
        start, end = spans[top, 0], spans[top, 1]
        noise = _fill(v[top], c[top], work)
        speed = steep = 0.0
        for i in range(3):
            speed = max(speed, np.hypot(v[top, i, 0], v[top, i, 1]))
            steep = max(steep, abs(c[top, i]))
        speed += off
        noise += 6.0 * speed**5 * off + (2.0 * steep + off_c) * off_c
        least = np.inf
        for k in range(13):
            # NaN must not pass
            least = min(least, work[0, k]) if work[0, k] == work[0, k] else -np.inf
        if least > noise:
            top -= 1
            continue
        if not work[0, 0] > -noise:
            return float(start)
        if not work[0, 12] > -noise:
            return float(end)
        middle = 0.5 * (start + end)
        if end - start <= 2.0**-_DEPTH or examined >= _PIECES:
            return float(middle)
        _halve(v[top], c[top], v[top + 1], c[top + 1])
        spans[top, 0], spans[top + 1, 0], spans[top + 1, 1] = middle, start, middle
        top += 1
    return np.nan


@compiled
def _all_too_sharp(control: Array, radius: float) -> Array:
    where = np.empty(len(control))
    for s in range(len(control)):
        where[s] = _too_sharp(control[s], radius)
    return where


def check_turn_radius(radius: float, tolerance: float = 0.0) -> float:
    """Return a minimum turn radius [m] after checking it against a tolerance [m].

    Raises:
        ValueError: not finite, or not above the tolerance.
    """
    if not tolerance < radius < math.inf:
        raise ValueError(
            f"a turn radius to keep must be finite and above the tolerance of {tolerance:g} m, "
            f"got {radius} m; omit it to allow any turn"
        )
    return float(radius)


def too_sharp_at(
    control: ArrayLike, radius: float, tolerance: float = PAPER_LIMITS.tolerance
) -> Array:
    """Where segments turn too sharply: (*batch,) a parameter t, NaN if they provably never do.

    Args:
        control: (*batch, 4, 2) segments.
        radius: minimum turn radius [m].
        tolerance: allowed violation of the radius [m].

    Raises:
        ValueError: segments that are not planar or not finite, or an invalid radius.
    """
    control = as_control(control)
    if control.shape[-1] != 2:
        raise ValueError(f"turns are planar, got segments in {control.shape[-1]} dimensions")
    least = check_turn_radius(radius, tolerance) - tolerance
    flat = np.ascontiguousarray(control.reshape(-1, 4, 2))
    return _all_too_sharp(flat, least).reshape(control.shape[:-2])


def keeps_turn_radius(
    control: ArrayLike, radius: float, tolerance: float = PAPER_LIMITS.tolerance
) -> NDArray[np.bool_]:
    """Whether each segment's radius of curvature is at least `radius` everywhere: (*batch,).

    True is proved. False may be wrong if the smallest radius exceeds `radius - tolerance` by less
    than about 1e-12 (relative), or by more where |X'| is nearly zero. A segment whose derivative
    vanishes anywhere keeps no radius.

    Args:
        control: (*batch, 4, 2) segments.
        radius: minimum turn radius [m].
        tolerance: allowed violation of the radius [m].

    Raises:
        ValueError: segments that are not planar or not finite, or an invalid radius.

    Example:
        >>> bend = [[0, 0], [9, 3], [9, 0], [9, 6]]
        >>> keeps_turn_radius(bend, 10.0).item(), keeps_turn_radius(bend, 20.0).item()
        (True, False)
    """
    return np.asarray(np.isnan(too_sharp_at(control, radius, tolerance)))
