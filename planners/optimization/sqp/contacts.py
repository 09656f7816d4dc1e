"""Contacts of a curve with discs, bounds and its least speed, to second order, compiled.

Those with other obstacles are in `planners.optimization.sqp.core_contacts`.

A contact is a local minimum over t of the distance phi(x, t) between a curve and a disc or a bound,
or of |X'(t)| minus its limit. Its value c(x) = phi(x, t*(x)), here called its clearance, is a
constraint c(x) >= 0 of the solver. By the envelope theorem

    grad c = phi_x,    hess c = phi_xx - phi_xt phi_tx / phi_tt    at t*.

Local minima are bracketed by the sign of phi_t at 17 parameters and refined by Newton's method.
Where a curve runs along a disc, many parameters are almost equally close, and a step can make any
of them the nearest. Therefore every sample within `NEAR` of a disc is also a contact, at a fixed t.

Reference:
    Fiacco & Ishizuka (1990), Sensitivity and stability analysis for nonlinear programming,
    Annals of Operations Research 27.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.splines import basis
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place

Integers = NDArray[np.int64]
Records = NDArray[np.void]
"""An array of CONTACT."""

SPEED, LOW, HIGH = -1, -2, -4
"""Codes in the field `what` of a contact, beside the indices of obstacles: SPEED for the lower
bound on |X'(t)|; LOW - d and HIGH - d for the bounds of coordinate d."""
NEAR = 0.1
"""Distance [m] from an obstacle within which every sampled parameter is a contact."""

SAMPLES = 17
"""Number of sampled parameters of a curve."""
_T = np.linspace(0.0, 1.0, SAMPLES)
_POINT, _SLOPE, _SECOND = basis(_T), basis(_T, 1), basis(_T, 2)
MIN_NORM = 1e-9
"""Vectors shorter than this have no usable direction [m]."""

CONTACT = np.dtype(
    [
        ("clearance", np.float64),  # [m], or [m per unit t] for speed and turns
        ("segment", np.int64),
        ("what", np.int64),  # obstacle, or SPEED, LOW, HIGH, or a side, LEFT or RIGHT, of turns
        ("t", np.float64),
        ("weight", np.float64, (4,)),  # w: weights of the control rows at t
        ("normal", np.float64, (2,)),  # N: direction in which the clearance grows
        ("inverse", np.float64),  # q: one over the distance from a centre or corner [1/m]
        ("mixed", np.float64, (8,)),  # u = phi_xt
        ("drift", np.float64),  # e = 1 / phi_tt, zero where t is fixed
    ],
    align=True,
)
"""A contact. With respect to the numbers i = 2 a + d of its segment, rows a of the control
array, coordinates d, its Hessian is w_a w_b (1 - N N')_de q - u_i u_j e."""


@compiled
def row_weights(t: float, order: int) -> tuple[float, float, float, float]:
    """Weights of the control rows in a point (order 0) or a derivative (1 to 3)."""
    if order == 0:
        bend = t * t * (3.0 - 2.0 * t)
        return 1.0 - bend, bend, t * (1.0 - t) * (1.0 - t), t * t * (t - 1.0)
    if order == 1:
        bend = 6.0 * t * (1.0 - t)
        return -bend, bend, (3.0 * t - 4.0) * t + 1.0, (3.0 * t - 2.0) * t
    if order == 2:
        return 12.0 * t - 6.0, 6.0 - 12.0 * t, 6.0 * t - 4.0, 6.0 * t - 2.0
    return 12.0, -12.0, 6.0, 6.0


@compiled
def _refine(powers: Array, cx: float, cy: float, low: float, high: float) -> float:
    """Minimiser of |Y(t) - (cx, cy)|^2 on [low, high], where it falls at `low`, rises at `high`.

    Y has the coefficients `powers` (4, 2) of 1, t, t^2, t^3.
    """
    a0, a1, a2, a3 = powers[0, 0] - cx, powers[1, 0], powers[2, 0], powers[3, 0]
    b0, b1, b2, b3 = powers[0, 1] - cy, powers[1, 1], powers[2, 1], powers[3, 1]
    t = 0.5 * (low + high)
    for _ in range(40):
        x, y = a0 + t * (a1 + t * (a2 + t * a3)), b0 + t * (b1 + t * (b2 + t * b3))
        vx, vy = a1 + t * (2.0 * a2 + 3.0 * t * a3), b1 + t * (2.0 * b2 + 3.0 * t * b3)
        rise = x * vx + y * vy
        bend = vx * vx + vy * vy + x * (2.0 * a2 + 6.0 * t * a3) + y * (2.0 * b2 + 6.0 * t * b3)
        step = rise / bend if bend > 0.0 else 1.0
        if abs(step) < 1e-13:
            break
        if rise > 0.0:
            high = t
        else:
            low = t
        t = t - step if low < t - step < high else 0.5 * (low + high)
    return t


@compiled
def _powers(control: Array, order: int, powers: Array) -> None:
    """Coefficients (4, 2) of 1, t, t^2, t^3 of a segment or its derivative."""
    for d in range(2):
        start, end, leave, arrive = control[0, d], control[1, d], control[2, d], control[3, d]
        square = 3.0 * (end - start) - 2.0 * leave - arrive
        cube = 2.0 * (start - end) + leave + arrive
        if order == 0:
            powers[0, d], powers[1, d], powers[2, d], powers[3, d] = start, leave, square, cube
        else:
            powers[0, d], powers[1, d], powers[2, d] = leave, 2.0 * square, 3.0 * cube
            powers[3, d] = 0.0


class Piece(NamedTuple):
    """A segment of a chain."""

    k: int
    control: Array
    """(4, 2)."""
    place: Integers
    """(8,) place of each of its numbers among the unknowns, -1 if it is fixed."""


class Circle(NamedTuple):
    """A circle that a segment, or for SPEED its derivative, must stay outside of."""

    what: int
    """Index of the disc, or SPEED."""
    x: float
    y: float
    radius: float


class Local(NamedTuple):
    """A segment at some t, and the direction in which a clearance grows there."""

    point: Array
    """(2,) [m]."""
    slope: Array
    """(2,) first derivative with respect to t [m per unit t]."""
    bend: Array
    """(2,) second derivative with respect to t."""
    normal: Array
    """(2,) unit vector."""


class Curve(NamedTuple):
    """A segment or its derivative at the sampled parameters."""

    points: Array
    """(17, 2)."""
    slopes: Array
    """(17, 2)."""
    rise: Array
    """(17,) derivative of half the squared distance from a disc's centre, or of the distance from
    another core."""
    powers: Array
    """(4, 2) coefficients of 1, t, t^2, t^3."""
    spread: Array
    """(2,) estimates of the curve's radius around the middle and of its deviation between samples;
    certification covers curves for which they are too small."""
    apart: Array
    """(17,) signed distance from a core that is not a point [m]."""
    depth: Array
    """(17,) scratch, as is fall (17,)."""
    fall: Array
    """Scratch."""
    local: Local
    """Scratch."""


@compiled
def empty_curve() -> Curve:
    """Memory for the samples of a curve."""
    return Curve(
        np.empty((SAMPLES, 2)),
        np.empty((SAMPLES, 2)),
        np.empty(SAMPLES),
        np.empty((4, 2)),
        np.empty(2),
        np.empty(SAMPLES),
        np.empty(SAMPLES),
        np.empty(SAMPLES),
        Local(np.empty(2), np.empty(2), np.empty(2), np.empty(2)),
    )


@compiled
def trace(control: Array, order: int, middle: tuple[float, float], curve: Curve) -> None:
    """Sample a segment (order 0) or its derivative (order 1)."""
    around = 0.0
    for i in range(len(_T)):
        px = py = vx = vy = 0.0
        for a in range(4):
            w = _POINT[i, a] if order == 0 else _SLOPE[i, a]
            px += w * control[a, 0]
            py += w * control[a, 1]
            w = _SLOPE[i, a] if order == 0 else _SECOND[i, a]
            vx += w * control[a, 0]
            vy += w * control[a, 1]
        curve.points[i, 0], curve.points[i, 1] = px, py
        curve.slopes[i, 0], curve.slopes[i, 1] = vx, vy
        around = max(around, (px - middle[0]) ** 2 + (py - middle[1]) ** 2)
    curve.spread[1] = 0.05 * np.sqrt(around) + NEAR
    curve.spread[0] = np.sqrt(around) + curve.spread[1]
    _powers(control, order, curve.powers)


@compiled
def approach(points: Array, slopes: Array, x: float, y: float, rise: Array) -> float:
    """Least squared distance of the samples from (x, y); fills the derivatives of half of it."""
    least = np.inf
    for i in range(len(rise)):
        dx, dy = points[i, 0] - x, points[i, 1] - y
        rise[i] = dx * slopes[i, 0] + dy * slopes[i, 1]
        least = min(least, dx * dx + dy * dy)
    return least


@compiled
def record(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    what: int,
    t: float,
    clearance: float,
    normal: tuple[float, float],
    inverse: float,
) -> None:
    """Record a contact at a fixed t, and its gradient in `gradients` (room, m)."""
    weights = row_weights(t, 1 if what == SPEED else 0)
    contact, slope, place = records[count], gradients[count], piece.place
    contact.clearance, contact.segment, contact.what, contact.t = clearance, piece.k, what, t
    contact.normal[0], contact.normal[1] = normal
    contact.inverse, contact.drift = inverse, 0.0
    slope[:] = 0.0
    for a in range(4):
        contact.weight[a] = weights[a]
        if place[2 * a] >= 0:
            slope[place[2 * a]] = weights[a] * normal[0]
        if place[2 * a + 1] >= 0:
            slope[place[2 * a + 1]] = weights[a] * normal[1]


@compiled
def add(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    circle: Circle,
    t: float,
    moving: bool,
    reach: float,
    powers: Array,
) -> int:
    """Add a contact with a disc or, for SPEED, of the derivative with the circle of its limit."""
    if count == len(records):
        return count
    a1, a2, a3 = powers[1, 0], powers[2, 0], powers[3, 0]
    b1, b2, b3 = powers[1, 1], powers[2, 1], powers[3, 1]
    x = powers[0, 0] - circle.x + t * (a1 + t * (a2 + t * a3))
    y = powers[0, 1] - circle.y + t * (b1 + t * (b2 + t * b3))
    norm = np.sqrt(x * x + y * y)
    if norm - circle.radius >= reach:
        return count
    size = norm
    if norm < MIN_NORM:
        # any direction will do: across the chord for a disc, along it for the derivative
        control = piece.control
        x, y = control[1, 0] - control[0, 0], control[1, 1] - control[0, 1]
        if circle.what >= 0:
            x, y = -y, x
        if x == 0.0 and y == 0.0:
            x = 1.0
        size = np.sqrt(x * x + y * y)
    nx, ny, inverse = x / size, y / size, 1.0 / max(norm, MIN_NORM)
    what, clearance = circle.what, norm - circle.radius
    record(records, gradients, count, piece, what, t, clearance, (nx, ny), inverse)
    if moving:
        vx, vy = a1 + t * (2.0 * a2 + 3.0 * t * a3), b1 + t * (2.0 * b2 + 3.0 * t * b3)
        along = vx * nx + vy * ny
        turn = nx * (2.0 * a2 + 6.0 * t * a3) + ny * (2.0 * b2 + 6.0 * t * b3)
        turn += (vx * vx + vy * vy - along * along) * inverse
        if turn > MIN_NORM:
            contact = records[count]
            contact.drift = 1.0 / turn
            wx, wy = (vx - along * nx) * inverse, (vy - along * ny) * inverse
            weights = row_weights(t, 1 if circle.what == SPEED else 0)
            slopes = row_weights(t, 2 if circle.what == SPEED else 1)
            for a in range(4):
                contact.mixed[2 * a] = slopes[a] * nx + weights[a] * wx
                contact.mixed[2 * a + 1] = slopes[a] * ny + weights[a] * wy
    return count + 1


@compiled_in_place
def _add_coordinate(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    extreme: tuple[float, float, float],
    d: int,
    side: int,
    reach: float,
) -> int:
    """Add a contact of coordinate d at an extreme: parameter, clearance, second derivative."""
    t, clearance, turn = extreme
    if not 0.0 < t < 1.0 or turn <= MIN_NORM or count == len(records) or clearance >= reach:
        return count
    sign = 1.0 if side == 0 else -1.0
    normal = (sign, 0.0) if d == 0 else (0.0, sign)
    what = (LOW if side == 0 else HIGH) - d
    record(records, gradients, count, piece, what, t, clearance, normal, 0.0)
    contact = records[count]
    contact.drift = 1.0 / turn
    slopes = row_weights(t, 1)
    for i in range(4):
        contact.mixed[2 * i] = slopes[i] * normal[0]
        contact.mixed[2 * i + 1] = slopes[i] * normal[1]
    return count + 1


@compiled
def add_coordinates(
    records: Records, gradients: Array, count: int, piece: Piece, bounds: Array, reach: float
) -> int:
    """Add the contacts of a segment's extreme coordinates with the bounds."""
    control = piece.control
    for d in range(2):
        p0, p3 = control[0, d], control[1, d]
        p1, p2 = p0 + control[2, d] / 3.0, p3 - control[3, d] / 3.0
        for side in range(2):
            sign = 1.0 if side == 0 else -1.0
            edge = bounds[side, d]
            if min(sign * (p1 - edge), sign * (p2 - edge)) >= reach:
                continue
            # X'_d = 3 (a t^2 + b t + c)
            c = p1 - p0
            b = 2.0 * (p2 - p1) - 2.0 * c
            a = (p3 - p2) - 2.0 * (p2 - p1) + c
            roots = b * b - 4.0 * a * c
            if roots <= 0.0:
                continue
            q = -0.5 * (b + (np.sqrt(roots) if b >= 0.0 else -np.sqrt(roots)))
            for root in range(2):
                if (a if root == 0 else q) == 0.0:
                    continue
                t = q / a if root == 0 else c / q
                clearance = sign * (p0 - edge + 3.0 * t * (c + t * (0.5 * b + t * a / 3.0)))
                extreme = t, clearance, 3.0 * sign * (2.0 * a * t + b)
                count = _add_coordinate(records, gradients, count, piece, extreme, d, side, reach)
    return count


@compiled
def add_around(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    circle: Circle,
    reach: float,
    least: float,
    ends: bool,
    curve: Curve,
) -> int:
    """Add a segment's contacts with a circle; `least` is the result of `approach`."""
    points, rise, powers = curve.points, curve.rise, curve.powers
    last = len(rise) - 1
    for i in range(1, last + 1):
        if rise[i - 1] < 0.0 <= rise[i]:
            t = _refine(powers, circle.x, circle.y, _T[i - 1], _T[i])
            count = add(records, gradients, count, piece, circle, t, True, reach, powers)
    # the chain's start is fixed: no step can change it
    if circle.what == SPEED and piece.k > 0 and rise[0] >= 0.0:
        count = add(records, gradients, count, piece, circle, 0.0, False, reach, powers)
    if ends and rise[last] <= 0.0:
        count = add(records, gradients, count, piece, circle, 1.0, False, reach, powers)
    near = (circle.radius + NEAR) ** 2
    if circle.what >= 0 and least < near:
        for i in range(1, last + 1):
            x, y = points[i, 0] - circle.x, points[i, 1] - circle.y
            if x * x + y * y < near:
                count = add(records, gradients, count, piece, circle, _T[i], False, reach, powers)
    return count
