"""Second-order expansion of a planar chain, compiled: its lengths and its contacts with limits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ferguson_gym.curves.convex_core import Cores
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place, unowned
from planners.optimization.quadrature import BENDING
from planners.optimization.sqp.contacts import (
    CONTACT,
    SPEED,
    Circle,
    Curve,
    Integers,
    Piece,
    Records,
    add,
    add_around,
    add_coordinates,
    approach,
    empty_curve,
    trace,
)
from planners.optimization.sqp.core_contacts import Core, add_around_core, add_fixed_to_core
from planners.optimization.sqp.turn_contacts import add_turns

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_BLEND = np.column_stack([(1.0 - _NODES) ** 2, 2.0 * _NODES * (1.0 - _NODES), _NODES**2])
_HODOGRAPH = np.array([[0.0, 0.0, 1.0, 0.0], [-3.0, 3.0, -1.0, -1.0], [0.0, 0.0, 0.0, 1.0]])
"""Bézier points of the hodograph, the derivative curve X'(t), from the rows of a control array."""
_MIN_SPEED = 1e-9
"""Derivatives below this count as zero [m per unit t]."""


class Layout(NamedTuple):
    """A planar chain of n segments, which of its numbers are unknowns, and its limits."""

    base: Array
    """(n, 4, 2) segments with the fixed numbers."""
    place: Integers
    """(n, 8) place of each number of a segment among the m unknowns, -1 if it is fixed."""
    bounds: Array
    """(2, 2) lower and upper bounds of the coordinates [m]."""
    centers: Array
    """(obstacles, 2) centres of balls that contain the obstacles; discs are these [m]."""
    radii: Array
    """(obstacles,) of the balls [m]."""
    cores: Cores
    """Of the obstacles; empty if all are discs."""
    slowest: float
    """Lower bound on |X'(t)| [m per unit t]."""
    limits: Array
    """Shortest and longest segment [m]."""
    bending_weight: float
    """Weight of the integral of |X''|^2 over t in the objective [1/m]."""
    correction: Array
    """(n,) certified length minus quadrature length [m]; nonzero only near cusps."""
    pinned_contacts: Array
    """(k, 3) contacts that certification found, at a fixed parameter: segment, obstacle or side of
    a turn, and t."""
    turn_radius: float
    """Minimum turn radius [m]; zero allows any."""


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
    contact: Records
    """(room,) of CONTACT."""
    slope: Array
    """(room, m) gradient of each contact's clearance."""


@compiled
def empty_expansion(segments: int, unknowns: int, room: int) -> Expansion:
    """Memory for `room` contacts; further ones are dropped, and certified if they are violated."""
    return Expansion(
        np.empty((segments, 4, 2)),
        np.empty(segments),
        np.empty((segments, unknowns)),
        np.empty((segments, 8, 8)),
        np.empty(room, CONTACT),
        np.empty((room, unknowns)),
    )


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
        if speed < _MIN_SPEED:
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
def _violation(here: Expansion, contacts: int, limits: Array) -> float:
    """Sum of the violations of lengths, and of the worst contact with each limit [m]."""
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


@compiled_in_place
def _fill_control(x: Array, base: Array, place: Integers, control: Array) -> None:
    """Fill a segment (4, 2) with its unknowns and its fixed numbers."""
    for i in range(8):
        a, d = i // 2, i % 2
        control[a, d] = x[place[i]] if place[i] >= 0 else base[a, d]


@compiled_in_place
def _add_bending(control: Array, total: float) -> float:
    """Add the integral of |X''|^2 over a segment (4, 2) to a total [m^2]."""
    for a in range(4):
        for b in range(4):
            for d in range(2):
                total += BENDING[a, b] * control[a, d] * control[b, d]
    return total


@compiled_in_place
def _add_obstacles(
    layout: Layout,
    out: Expansion,
    count: int,
    piece: Piece,
    middle: tuple[float, float],
    reach: float,
    curve: Curve,
) -> int:
    """Add a segment's contacts with obstacles, near ones and pinned ones."""
    # segments join smoothly, so that an end is a nearest point only where the chain ends
    ends = piece.k == len(layout.base) - 1
    shaped = len(layout.cores.first) > 0
    for disc in range(len(layout.radii)):
        x, y, radius = layout.centers[disc, 0], layout.centers[disc, 1], layout.radii[disc]
        far = (middle[0] - x) ** 2 + (middle[1] - y) ** 2
        if far > (curve.spread[0] + radius + reach) ** 2:
            continue
        if shaped and layout.cores.first[disc + 1] - layout.cores.first[disc] > 1:
            count = _add_core(layout, out, count, piece, disc, ends, reach, curve)
            continue
        circle = Circle(disc, x, y, radius)
        least = approach(curve.points, curve.slopes, x, y, curve.rise)
        if least < (radius + reach + curve.spread[1]) ** 2:
            count = add_around(
                out.contact, out.slope, count, piece, circle, reach, least, ends, curve
            )
        for row in range(len(layout.pinned_contacts)):
            pinned = layout.pinned_contacts[row]
            if int(pinned[0]) == piece.k and int(pinned[1]) == disc:
                t, powers = pinned[2], curve.powers
                count = add(out.contact, out.slope, count, piece, circle, t, False, reach, powers)
    return count


@compiled
def _add_core(
    layout: Layout,
    out: Expansion,
    count: int,
    piece: Piece,
    what: int,
    ends: bool,
    reach: float,
    curve: Curve,
) -> int:
    """Add a segment's contacts with an obstacle whose core is not a point."""
    cores = layout.cores
    core = Core(what, cores.corners, cores.first[what], cores.first[what + 1], cores.radii[what])
    count = add_around_core(out.contact, out.slope, count, piece, core, reach, ends, curve)
    for row in range(len(layout.pinned_contacts)):
        pinned = layout.pinned_contacts[row]
        if int(pinned[0]) == piece.k and int(pinned[1]) == what:
            t = pinned[2]
            count = add_fixed_to_core(out.contact, out.slope, count, piece, core, t, reach, curve)
    return count


@compiled_in_place
def _add_speed(
    layout: Layout, out: Expansion, count: int, piece: Piece, reach: float, curve: Curve
) -> int:
    """Add the contacts of a segment's derivative with the circle of its lower bound."""
    least = approach(curve.points, curve.slopes, 0.0, 0.0, curve.rise)
    if least < (layout.slowest + reach + curve.spread[1]) ** 2:
        circle = Circle(SPEED, 0.0, 0.0, layout.slowest)
        count = add_around(out.contact, out.slope, count, piece, circle, reach, least, True, curve)
    return count


@compiled
def expand(
    x: Array, layout: Layout, reach: float, out: Expansion
) -> tuple[int, float, float, float]:
    """Expand the chain at unknowns x (m,) into `out`.

    Contacts with a clearance of `reach` [m] or more are left out.

    Returns:
        The number of contacts; the sum of all constraint violations [m]; the chain's length [m];
        and the bending's share of the objective [m].
    """
    layout, out = unowned(layout), unowned(out)  # the caller holds them
    slope = np.empty(8)
    v, first, second = np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 3, 3))
    owned = empty_curve()
    curve = unowned(owned)
    count, total, bent = 0, 0.0, 0.0
    for k in range(len(layout.base)):
        control, place = out.control[k], layout.place[k]
        piece = Piece(k, control, place)
        _fill_control(x, layout.base[k], place, control)
        length = _measure(control, slope, out.length_curvature[k], v, first, second)
        length += layout.correction[k]
        out.length[k] = length
        total += length
        out.length_slope[k, :] = 0.0
        for i in range(8):
            if place[i] >= 0:
                out.length_slope[k, place[i]] += slope[i]
        bent = _add_bending(control, bent)
        middle = 0.5 * (control[0, 0] + control[1, 0]), 0.5 * (control[0, 1] + control[1, 1])
        trace(control, 0, middle, curve)
        count = _add_obstacles(layout, out, count, piece, middle, reach, curve)
        trace(control, 1, (0.0, 0.0), curve)
        count = _add_speed(layout, out, count, piece, reach, curve)
        count = add_coordinates(out.contact, out.slope, count, piece, layout.bounds, reach)
        if layout.turn_radius > 0.0:
            radius, pinned = layout.turn_radius, layout.pinned_contacts
            count = add_turns(out.contact, out.slope, count, piece, radius, reach, pinned)
    owned.rise[0] = 0.0  # a last use, which keeps the memory of `curve` alive until here
    return count, _violation(out, count, layout.limits), total, layout.bending_weight * bent
