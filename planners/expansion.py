"""A planar chain to second order, compiled: its lengths, and its contacts with what bounds it.

A contact is a parameter at which a curve comes near to what it must keep away from: a disc,
the field's bounds, or, for its derivative, zero. Its clearance c(x) = min over t of phi(x, t)
is taken over a neighbourhood of the local minimum t*, so that by the envelope theorem

    grad c = phi_x,    hess c = phi_xx - phi_xt phi_tx / phi_tt    at t*.

Local minima are bracketed by the sign of phi_t at 17 parameters and refined by Newton's
method. Where a curve hugs a disc its neighbours are nearly as close, and a step can turn any
of them into the nearest: parameters within `NEAR` of a disc are contacts of their own, held
at their t.

Reference:
    Fiacco & Ishizuka (1990), Sensitivity and stability analysis for nonlinear programming,
    Annals of Operations Research 27.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.arrays import Array
from ferguson_gym.compilation import compiled
from ferguson_gym.splines import basis

Integers = NDArray[np.int64]

SPEED, LOW, HIGH = -1, -2, -4
"""What a contact is with, if not a disc: least speed, least coordinate, greatest coordinate;
the last two less the coordinate's index."""
NEAR = 0.1
"""Distance [m] from a disc within which every looked-at parameter is a contact."""

_INTERVALS = 16
_T = np.linspace(0.0, 1.0, _INTERVALS + 1)
_POINT, _SLOPE, _TURN = basis(_T), basis(_T, 1), basis(_T, 2)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_BLEND = np.column_stack([(1.0 - _NODES) ** 2, 2.0 * _NODES * (1.0 - _NODES), _NODES**2])
_HODOGRAPH = np.array([[0.0, 0.0, 1.0, 0.0], [-3.0, 3.0, -1.0, -1.0], [0.0, 0.0, 0.0, 1.0]])
"""Bézier points of the derivative from the rows of a control array."""
_BEND = basis(0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0), 2)
BENDING = _BEND.T @ (0.5 * _BEND)
"""Weights (4, 4) of products of control rows in the integral of |X''|^2 over t; two Gauss
nodes are exact, since X'' is linear."""
_NOWHERE = 1e-9
"""A direction from a shorter vector [m] is noise."""


class Layout(NamedTuple):
    """A planar chain of n segments, which of its numbers are unknowns, and what bounds it."""

    base: Array
    """(n, 4, 2) segments; the numbers that are held."""
    place: Integers
    """(n, 8) place of each number of a segment among the m unknowns, -1 where it is held."""
    bounds: Array
    """(2, 2) least and greatest coordinates [m]."""
    centers: Array
    """(discs, 2) [m]."""
    radii: Array
    """(discs,) [m]."""
    slowest: float
    """Least |X'(t)| [m per unit t]."""
    limits: Array
    """Shortest and longest segment [m]."""
    stiffness: float
    """Weight of the integral of |X''|^2 over t in the objective [1/m]."""
    correction: Array
    """(n,) certified length less quadrature [m], zero but for near-cusps."""
    held: Array
    """(k, 3) further contacts: segment, disc and parameter, which certification found."""


CONTACT = np.dtype(
    [
        ("clearance", np.float64),  # [m], or [m per unit t] for the speed
        ("segment", np.int64),
        ("what", np.int64),  # disc, or SPEED, LOW, HIGH
        ("t", np.float64),
        ("weight", np.float64, (4,)),  # w: of the control rows at t
        ("normal", np.float64, (2,)),  # N: in which the clearance grows
        ("inverse", np.float64),  # q: one over the distance from a disc's centre [1/m]
        ("mixed", np.float64, (8,)),  # u: gradient of the clearance's derivative by t
        ("drift", np.float64),  # e: one over its second derivative, zero where t is held
    ],
    align=True,
)
"""A contact. With respect to the numbers i = 2 a + d of its segment, rows a of the control
array, coordinates d, its Hessian is w_a w_b (1 - N N')_de q - u_i u_j e."""


class Expansion(NamedTuple):
    """A chain at some unknowns, to second order; filled by `expand`."""

    control: Array
    """(n, 4, 2)."""
    length: Array
    """(n,) [m]."""
    length_slope: Array
    """(n, m)."""
    length_curvature: Array
    """(n, 8, 8) with respect to each segment's numbers."""
    contact: NDArray[np.void]
    """(room,) of CONTACT."""
    slope: Array
    """(room, m) gradient of each contact's clearance."""


def empty_expansion(segments: int, unknowns: int, room: int) -> Expansion:
    """Room for an expansion with so many contacts; those beyond are left to certification."""
    return Expansion(
        control=np.empty((segments, 4, 2)),
        length=np.empty(segments),
        length_slope=np.empty((segments, unknowns)),
        length_curvature=np.empty((segments, 8, 8)),
        contact=np.empty(room, CONTACT),
        slope=np.empty((room, unknowns)),
    )


@compiled
def _weights(t: float, order: int) -> tuple[float, float, float, float]:
    """Weights of the control rows in a point (order 0), a derivative (1) or a second (2)."""
    if order == 0:
        bend = t * t * (3.0 - 2.0 * t)
        return 1.0 - bend, bend, t * (1.0 - t) * (1.0 - t), t * t * (t - 1.0)
    if order == 1:
        bend = 6.0 * t * (1.0 - t)
        return -bend, bend, (3.0 * t - 4.0) * t + 1.0, (3.0 * t - 2.0) * t
    return 12.0 * t - 6.0, 6.0 - 12.0 * t, 6.0 * t - 4.0, 6.0 * t - 2.0


@compiled
def _measure(
    control: Array, slope: Array, curvature: Array, v: Array, first: Array, second: Array
) -> float:
    """Length [m] by quadrature, its gradient (8,) and Hessian (8, 8).

    v (3, 2), first (3, 2) and second (3, 3, 3) are scratch.
    """
    # X' = v_0 (1-t)^2 + 2 v_1 t (1-t) + v_2 t^2 with v_1 = 3 (end - start) - v_0 - v_2
    for d in range(2):
        v[0, d], v[2, d] = control[2, d], control[3, d]
        v[1, d] = 3.0 * (control[1, d] - control[0, d]) - v[0, d] - v[2, d]
    length = 0.0
    first[:] = 0.0
    second[:] = 0.0
    for i in range(len(_WEIGHTS)):
        b0, b1, b2 = _BLEND[i, 0], _BLEND[i, 1], _BLEND[i, 2]
        x = b0 * v[0, 0] + b1 * v[1, 0] + b2 * v[2, 0]
        y = b0 * v[0, 1] + b1 * v[1, 1] + b2 * v[2, 1]
        speed = np.sqrt(x * x + y * y)
        length += _WEIGHTS[i] * speed
        if speed < _NOWHERE:
            continue
        ux, uy = x / speed, y / speed
        across = _WEIGHTS[i] / speed
        xx, xy, yy = across * uy * uy, -across * ux * uy, across * ux * ux
        ux, uy = _WEIGHTS[i] * ux, _WEIGHTS[i] * uy
        for a in range(3):
            blend = _BLEND[i, a]
            first[a, 0] += blend * ux
            first[a, 1] += blend * uy
            for b in range(a + 1):
                both = blend * _BLEND[i, b]
                second[a, b, 0] += both * xx
                second[a, b, 1] += both * xy
                second[a, b, 2] += both * yy
    for i in range(8):
        d = i % 2
        slope[i] = 0.0
        for a in range(3):
            slope[i] += _HODOGRAPH[a, i // 2] * first[a, d]
        for j in range(i + 1):
            e = d + j % 2
            total = 0.0
            for a in range(3):
                wa = _HODOGRAPH[a, i // 2]
                if wa == 0.0:
                    continue
                for b in range(3):
                    value = second[a, b, e] if a >= b else second[b, a, e]
                    total += wa * _HODOGRAPH[b, j // 2] * value
            curvature[i, j] = curvature[j, i] = total
    return length


@compiled
def _refine(powers: Array, cx: float, cy: float, low: float, high: float) -> float:
    """Where |Y(t) - (cx, cy)|^2 is least between a falling and a rising end.

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


class _Curve(NamedTuple):
    """A segment or its derivative, at the parameters that are looked at."""

    points: Array
    """(17, 2)."""
    slopes: Array
    """(17, 2)."""
    rise: Array
    """(17,) derivative of half the squared distance from a disc's centre."""
    powers: Array
    """(4, 2) coefficients of 1, t, t^2, t^3."""
    spread: Array
    """(2,) radius of a disc around the middle that holds the curve, and how far the curve
    strays from the points looked at; for a wild curve guesses, and certification decides."""


@compiled
def _trace(control: Array, order: int, middle: tuple[float, float], curve: _Curve) -> None:
    """Look at a segment (order 0) or its derivative (order 1)."""
    around = 0.0
    for i in range(len(_T)):
        px = py = vx = vy = 0.0
        for a in range(4):
            w = _POINT[i, a] if order == 0 else _SLOPE[i, a]
            px += w * control[a, 0]
            py += w * control[a, 1]
            w = _SLOPE[i, a] if order == 0 else _TURN[i, a]
            vx += w * control[a, 0]
            vy += w * control[a, 1]
        curve.points[i, 0], curve.points[i, 1] = px, py
        curve.slopes[i, 0], curve.slopes[i, 1] = vx, vy
        around = max(around, (px - middle[0]) ** 2 + (py - middle[1]) ** 2)
    curve.spread[1] = 0.05 * np.sqrt(around) + NEAR
    curve.spread[0] = np.sqrt(around) + curve.spread[1]
    _powers(control, order, curve.powers)


@compiled
def _record(
    out: Expansion,
    count: int,
    place: Integers,
    k: int,
    what: int,
    t: float,
    clearance: float,
    normal: tuple[float, float],
    inverse: float,
) -> None:
    """Write down a contact whose t is held."""
    weights = _weights(t, 1 if what == SPEED else 0)
    contact, slope = out.contact[count], out.slope[count]
    contact.clearance, contact.segment, contact.what, contact.t = clearance, k, what, t
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
def _add(
    out: Expansion,
    count: int,
    place: Integers,
    k: int,
    what: int,
    t: float,
    moving: bool,
    center: tuple[float, float],
    radius: float,
    reach: float,
    powers: Array,
) -> int:
    """Add a contact with a disc, or of the derivative with a disc of the least speed."""
    if count == len(out.contact):
        return count
    a1, a2, a3 = powers[1, 0], powers[2, 0], powers[3, 0]
    b1, b2, b3 = powers[1, 1], powers[2, 1], powers[3, 1]
    x = powers[0, 0] - center[0] + t * (a1 + t * (a2 + t * a3))
    y = powers[0, 1] - center[1] + t * (b1 + t * (b2 + t * b3))
    norm = np.sqrt(x * x + y * y)
    if norm - radius >= reach:
        return count
    size = norm
    if norm < _NOWHERE:
        # any direction will do: across the chord for a disc, along it for the speed
        control = out.control[k]
        x, y = control[1, 0] - control[0, 0], control[1, 1] - control[0, 1]
        if what >= 0:
            x, y = -y, x
        if x == 0.0 and y == 0.0:
            x = 1.0
        size = np.sqrt(x * x + y * y)
    nx, ny, inverse = x / size, y / size, 1.0 / max(norm, _NOWHERE)
    _record(out, count, place, k, what, t, norm - radius, (nx, ny), inverse)
    if moving:
        vx, vy = a1 + t * (2.0 * a2 + 3.0 * t * a3), b1 + t * (2.0 * b2 + 3.0 * t * b3)
        along = vx * nx + vy * ny
        turn = nx * (2.0 * a2 + 6.0 * t * a3) + ny * (2.0 * b2 + 6.0 * t * b3)
        turn += (vx * vx + vy * vy - along * along) * inverse
        if turn > _NOWHERE:
            contact = out.contact[count]
            contact.drift = 1.0 / turn
            wx, wy = (vx - along * nx) * inverse, (vy - along * ny) * inverse
            weights = _weights(t, 1 if what == SPEED else 0)
            slopes = _weights(t, 2 if what == SPEED else 1)
            for a in range(4):
                contact.mixed[2 * a] = slopes[a] * nx + weights[a] * wx
                contact.mixed[2 * a + 1] = slopes[a] * ny + weights[a] * wy
    return count + 1


@compiled
def _add_coordinates(
    out: Expansion, count: int, place: Integers, k: int, bounds: Array, reach: float
) -> int:
    """Add the contacts of a segment's extreme coordinates with the bounds."""
    control = out.control[k]
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
                turn = 3.0 * sign * (2.0 * a * t + b)
                if not 0.0 < t < 1.0 or turn <= _NOWHERE or count == len(out.contact):
                    continue
                clearance = sign * (p0 - edge + 3.0 * t * (c + t * (0.5 * b + t * a / 3.0)))
                if clearance >= reach:
                    continue
                normal = (sign, 0.0) if d == 0 else (0.0, sign)
                what = (LOW if side == 0 else HIGH) - d
                _record(out, count, place, k, what, t, clearance, normal, 0.0)
                contact = out.contact[count]
                contact.drift = 1.0 / turn
                slopes = _weights(t, 1)
                for i in range(4):
                    contact.mixed[2 * i] = slopes[i] * normal[0]
                    contact.mixed[2 * i + 1] = slopes[i] * normal[1]
                count += 1
    return count


@compiled
def _add_around(
    out: Expansion,
    count: int,
    place: Integers,
    k: int,
    what: int,
    center: tuple[float, float],
    radius: float,
    reach: float,
    least: float,
    ends: bool,
    curve: _Curve,
) -> int:
    """Add a segment's contacts with a disc, or its derivative's with that of least speed.

    `least` is what `_approach` found.
    """
    points, rise = curve.points, curve.rise
    last = len(rise) - 1
    for i in range(1, last + 1):
        if rise[i - 1] < 0.0 <= rise[i]:
            t = _refine(curve.powers, center[0], center[1], _T[i - 1], _T[i])
            count = _add(out, count, place, k, what, t, True, center, radius, reach, curve.powers)
    # the chain's start is held: nothing can be done about it
    if what == SPEED and k > 0 and rise[0] >= 0.0:
        count = _add(out, count, place, k, what, 0.0, False, center, radius, reach, curve.powers)
    if ends and rise[last] <= 0.0:
        count = _add(out, count, place, k, what, 1.0, False, center, radius, reach, curve.powers)
    if what >= 0 and least < (radius + NEAR) ** 2:
        for i in range(1, last + 1):
            x, y = points[i, 0] - center[0], points[i, 1] - center[1]
            if x * x + y * y < (radius + NEAR) ** 2:
                count = _add(
                    out, count, place, k, what, _T[i], False, center, radius, reach, curve.powers
                )
    return count


@compiled
def _approach(points: Array, slopes: Array, x: float, y: float, rise: Array) -> float:
    """Least squared distance from (x, y) of the points looked at; fills its derivatives."""
    least = np.inf
    for i in range(len(rise)):
        dx, dy = points[i, 0] - x, points[i, 1] - y
        rise[i] = dx * slopes[i, 0] + dy * slopes[i, 1]
        least = min(least, dx * dx + dy * dy)
    return least


@compiled
def _violation(here: Expansion, contacts: int, limits: Array) -> float:
    """Sum over lengths, and over the worst contact with each thing, of what they lack [m]."""
    total = 0.0
    for k in range(len(here.length)):
        total += max(0.0, limits[0] - here.length[k], here.length[k] - limits[1])
    worst, segment, what = 0.0, -1, 0
    for row in range(contacts):
        contact = here.contact[row]
        if contact.segment != segment or contact.what != what:
            total += worst
            worst = 0.0
        segment, what = contact.segment, contact.what
        worst = max(worst, -contact.clearance)
    return total + worst


@compiled
def expand(
    x: Array, layout: Layout, reach: float, out: Expansion
) -> tuple[int, float, float, float]:
    """Expand the chain at unknowns x (m,).

    Args:
        x: unknowns.
        layout: which chain, among what.
        reach: contacts with a clearance of this [m] or more are left out.
        out: what is filled.

    Returns:
        The number of contacts; by how much limits are broken in all [m]; the chain's
        length [m]; and the bending's share of the objective [m].
    """
    segments = len(layout.base)
    slope, size = np.empty(8), len(_T)
    v, first, second = np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 3, 3))
    curve = _Curve(
        np.empty((size, 2)), np.empty((size, 2)), np.empty(size), np.empty((4, 2)), np.empty(2)
    )
    points, slopes, rise, spread = curve.points, curve.slopes, curve.rise, curve.spread
    count, total, bent = 0, 0.0, 0.0
    for k in range(segments):
        control, place = out.control[k], layout.place[k]
        for i in range(8):
            if place[i] >= 0:
                control[i // 2, i % 2] = x[place[i]]
            else:
                control[i // 2, i % 2] = layout.base[k, i // 2, i % 2]
        length = _measure(control, slope, out.length_curvature[k], v, first, second)
        length += layout.correction[k]
        out.length[k] = length
        total += length
        out.length_slope[k, :] = 0.0
        for i in range(8):
            if place[i] >= 0:
                out.length_slope[k, place[i]] += slope[i]
        for a in range(4):
            for b in range(4):
                for d in range(2):
                    bent += BENDING[a, b] * control[a, d] * control[b, d]
        middle = (
            0.5 * (control[0, 0] + control[1, 0]),
            0.5 * (control[0, 1] + control[1, 1]),
        )
        _trace(control, 0, middle, curve)
        # points join smoothly, so that an end is nearest only where the chain ends
        ends = k == segments - 1
        for disc in range(len(layout.radii)):
            cx, cy, radius = layout.centers[disc, 0], layout.centers[disc, 1], layout.radii[disc]
            far = (middle[0] - cx) ** 2 + (middle[1] - cy) ** 2
            if far > (spread[0] + radius + reach) ** 2:
                continue
            # here and not in a function that is handed all arrays, which takes longer
            least = _approach(points, slopes, cx, cy, rise)
            if least < (radius + reach + spread[1]) ** 2:
                count = _add_around(
                    out, count, place, k, disc, (cx, cy), radius, reach, least, ends, curve
                )
            for row in range(len(layout.held)):
                if int(layout.held[row, 0]) == k and int(layout.held[row, 1]) == disc:
                    t = layout.held[row, 2]
                    count = _add(
                        out, count, place, k, disc, t, False, (cx, cy), radius, reach, curve.powers
                    )
        _trace(control, 1, (0.0, 0.0), curve)
        least = _approach(points, slopes, 0.0, 0.0, rise)
        if least < (layout.slowest + reach + spread[1]) ** 2:
            count = _add_around(
                out, count, place, k, SPEED, (0.0, 0.0), layout.slowest, reach, least, True, curve
            )
        count = _add_coordinates(out, count, place, k, layout.bounds, reach)
    return count, _violation(out, count, layout.limits), total, layout.stiffness * bent
