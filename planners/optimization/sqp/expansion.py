"""A planar chain to second order, compiled: its lengths, and its contacts with what bounds it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from planners.optimization.quadrature import BENDING
from planners.optimization.sqp.contacts import (
    CONTACT,
    LOOKS,
    SPEED,
    Curve,
    Integers,
    Piece,
    Records,
    Thing,
    add,
    add_around,
    add_coordinates,
    approach,
    trace,
)
from planners.optimization.sqp.turn_contacts import add_turns

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_BLEND = np.column_stack([(1.0 - _NODES) ** 2, 2.0 * _NODES * (1.0 - _NODES), _NODES**2])
_HODOGRAPH = np.array([[0.0, 0.0, 1.0, 0.0], [-3.0, 3.0, -1.0, -1.0], [0.0, 0.0, 0.0, 1.0]])
"""Bézier points of the derivative from the rows of a control array."""
_STILL = 1e-9
"""The derivative is taken for zero below this [m per unit t]."""


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
    """(k, 3) further contacts: segment, disc or side of a turn, and parameter, which
    certification found."""
    turn_radius: float
    """Least radius of turns [m]; zero allows any."""


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
        if speed < _STILL:
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
    segments, contact, gradient = len(layout.base), out.contact, out.slope
    slope, size = np.empty(8), LOOKS
    v, first, second = np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 3, 3))
    curve = Curve(
        np.empty((size, 2)), np.empty((size, 2)), np.empty(size), np.empty((4, 2)), np.empty(2)
    )
    points, slopes, rise, spread = curve.points, curve.slopes, curve.rise, curve.spread
    count, total, bent = 0, 0.0, 0.0
    for k in range(segments):
        control, place = out.control[k], layout.place[k]
        piece = Piece(k, control, place)
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
        trace(control, 0, middle, curve)
        # points join smoothly, so that an end is nearest only where the chain ends
        ends = k == segments - 1
        for disc in range(len(layout.radii)):
            cx, cy, radius = layout.centers[disc, 0], layout.centers[disc, 1], layout.radii[disc]
            far = (middle[0] - cx) ** 2 + (middle[1] - cy) ** 2
            if far > (spread[0] + radius + reach) ** 2:
                continue
            thing = Thing(disc, cx, cy, radius)
            # here and not in a function that is handed all arrays, which takes longer
            least = approach(points, slopes, cx, cy, rise)
            if least < (radius + reach + spread[1]) ** 2:
                count = add_around(
                    contact, gradient, count, piece, thing, reach, least, ends, curve
                )
            for row in range(len(layout.held)):
                if int(layout.held[row, 0]) == k and int(layout.held[row, 1]) == disc:
                    t = layout.held[row, 2]
                    count = add(
                        contact, gradient, count, piece, thing, t, False, reach, curve.powers
                    )
        trace(control, 1, (0.0, 0.0), curve)
        least = approach(points, slopes, 0.0, 0.0, rise)
        if least < (layout.slowest + reach + spread[1]) ** 2:
            thing = Thing(SPEED, 0.0, 0.0, layout.slowest)
            count = add_around(contact, gradient, count, piece, thing, reach, least, True, curve)
        count = add_coordinates(contact, gradient, count, piece, layout.bounds, reach)
        if layout.turn_radius > 0.0:
            count = add_turns(
                contact, gradient, count, piece, layout.turn_radius, reach, layout.held
            )
    return count, _violation(out, count, layout.limits), total, layout.stiffness * bent
