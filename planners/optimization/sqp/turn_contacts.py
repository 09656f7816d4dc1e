"""Contacts of a chain with a minimum turn radius, to second order, compiled.

With v the derivative of a segment, s its size and c = v x v', a left turn of radius R or wider has
s^3 >= R c, and a right turn the same with -c. The quantity that must not fall below zero is

    h = (s^3 -+ R c) / (s^2 + 1)    [m per unit t],

which has the same sign as s^3 -+ R c, has derivatives of the size of those of v where the turn is
wide enough, and is smooth where |X'(t)| is nearly zero. Its local minima over t are contacts, as in
`planners.optimization.sqp.contacts`, and so are sampled parameters where the turn is nearly as
sharp as the limit: an arc of the minimum radius is at the limit along its whole length.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place
from ferguson_gym.world.turn_radius import too_sharp_at
from planners.optimization.sqp.contacts import SAMPLES, Integers, Piece, Records, row_weights

LEFT, RIGHT = -6, -7
"""Codes of turns to the left and to the right in the field `what` of a contact."""
RADIUS_FACTOR = 1.001
"""Factor by which planned turns are wider than the limit: rounding to float32 actions moves ends by
up to 1e-5 m, which can change the curvature considerably where |X'(t)| is small."""
TURN_RATIO = 4.0
"""Approximate maximum of (change of h) / (displacement of points) over a step."""
_NEAR = 0.1
"""A sample is a contact if h is below this times s."""
_LEAST = 1e-9
"""Second derivatives with respect to t below this count as zero."""
_T = np.linspace(0.0, 1.0, SAMPLES)


class _Turn(NamedTuple):
    """h and its derivatives with respect to v and w = v'."""

    h: float
    v0: float
    v1: float
    w0: float
    w1: float
    v00: float
    v01: float
    v11: float
    v0w0: float
    v0w1: float
    v1w0: float
    v1w1: float


class _Motion(NamedTuple):
    """A segment's derivatives with respect to t, at some t."""

    v: tuple[float, float]
    w: tuple[float, float]
    z: tuple[float, float]


@compiled
def _turn(v: tuple[float, float], w: tuple[float, float], radius: float) -> _Turn:
    """The quantity h for turns to the left, for a negative radius to the right."""
    s = np.sqrt(v[0] * v[0] + v[1] * v[1])
    inverse = 1.0 / (s * s + 1.0)
    h = inverse * (s * s * s - radius * (v[0] * w[1] - v[1] * w[0]))
    v0 = inverse * (3.0 * s * v[0] - radius * w[1] - 2.0 * h * v[0])
    v1 = inverse * (3.0 * s * v[1] + radius * w[0] - 2.0 * h * v[1])
    w0, w1 = inverse * radius * v[1], -inverse * radius * v[0]
    still = 1.0 / max(s, 1e-9)
    v00 = 3.0 * (s + v[0] * v[0] * still) - 4.0 * v0 * v[0] - 2.0 * h
    v11 = 3.0 * (s + v[1] * v[1] * still) - 4.0 * v1 * v[1] - 2.0 * h
    v01 = 3.0 * v[0] * v[1] * still - 2.0 * (v0 * v[1] + v1 * v[0])
    return _Turn(
        h,
        v0,
        v1,
        w0,
        w1,
        inverse * v00,
        inverse * v01,
        inverse * v11,
        -2.0 * inverse * v[0] * w0,
        -inverse * (radius + 2.0 * v[0] * w1),
        inverse * (radius - 2.0 * v[1] * w0),
        -2.0 * inverse * v[1] * w1,
    )


@compiled
def _move(control: Array, t: float) -> _Motion:
    one, two, three = row_weights(t, 1), row_weights(t, 2), row_weights(t, 3)
    v0 = v1 = w0 = w1 = z0 = z1 = 0.0
    for a in range(4):
        v0 += one[a] * control[a, 0]
        v1 += one[a] * control[a, 1]
        w0 += two[a] * control[a, 0]
        w1 += two[a] * control[a, 1]
        z0 += three[a] * control[a, 0]
        z1 += three[a] * control[a, 1]
    return _Motion((v0, v1), (w0, w1), (z0, z1))


@compiled
def _rise(turn: _Turn, w: tuple[float, float], z: tuple[float, float]) -> float:
    """Derivative of h with respect to t."""
    return turn.v0 * w[0] + turn.v1 * w[1] + turn.w0 * z[0] + turn.w1 * z[1]


@compiled
def _bend(turn: _Turn, w: tuple[float, float], z: tuple[float, float]) -> float:
    """Second derivative of h with respect to t."""
    bend = turn.v00 * w[0] * w[0] + 2.0 * turn.v01 * w[0] * w[1] + turn.v11 * w[1] * w[1]
    bend += 2.0 * w[0] * (turn.v0w0 * z[0] + turn.v0w1 * z[1])
    bend += 2.0 * w[1] * (turn.v1w0 * z[0] + turn.v1w1 * z[1])
    return bend + turn.v0 * z[0] + turn.v1 * z[1]


@compiled
def _refine(control: Array, radius: float, low: float, high: float) -> float:
    """Minimiser of h on [low, high], where it falls at `low` and rises at `high`."""
    t = 0.5 * (low + high)
    for _ in range(40):
        v, w, z = _move(control, t)
        turn = _turn(v, w, radius)
        rise, bend = _rise(turn, w, z), _bend(turn, w, z)
        step = rise / bend if bend > 0.0 else 1.0
        if abs(step) < 1e-12:
            break
        if rise > 0.0:
            high = t
        else:
            low = t
        t = t - step if low < t - step < high else 0.5 * (low + high)
    return t


@compiled
def add_turn(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    radius: float,
    t: float,
    moving: bool,
) -> int:
    """Add a contact at t; turns to the right have a negative radius [m]."""
    if count == len(records):
        return count
    v, w, z = _move(piece.control, t)
    turn = _turn(v, w, radius)
    contact, slope, place = records[count], gradients[count], piece.place
    contact.clearance, contact.segment, contact.t = turn.h, piece.k, t
    contact.what = LEFT if radius > 0.0 else RIGHT
    contact.normal[0] = contact.normal[1] = contact.inverse = contact.drift = 0.0
    one, two, three = row_weights(t, 1), row_weights(t, 2), row_weights(t, 3)
    slope[:] = 0.0
    for a in range(4):
        contact.weight[a] = one[a]
        if place[2 * a] >= 0:
            slope[place[2 * a]] = one[a] * turn.v0 + two[a] * turn.w0
        if place[2 * a + 1] >= 0:
            slope[place[2 * a + 1]] = one[a] * turn.v1 + two[a] * turn.w1
    bend = _bend(turn, w, z)
    if moving and bend > _LEAST:
        contact.drift = 1.0 / bend
        # derivatives with respect to t of those with respect to v and w
        v0 = turn.v00 * w[0] + turn.v01 * w[1] + turn.v0w0 * z[0] + turn.v0w1 * z[1]
        v1 = turn.v01 * w[0] + turn.v11 * w[1] + turn.v1w0 * z[0] + turn.v1w1 * z[1]
        w0 = turn.v0w0 * w[0] + turn.v1w0 * w[1]
        w1 = turn.v0w1 * w[0] + turn.v1w1 * w[1]
        for a in range(4):
            contact.mixed[2 * a] = one[a] * v0 + two[a] * (turn.v0 + w0) + three[a] * turn.w0
            contact.mixed[2 * a + 1] = one[a] * v1 + two[a] * (turn.v1 + w1) + three[a] * turn.w1
    return count + 1


@compiled_in_place
def _add_side(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    radius: float,
    reach: float,
    h: Array,
    rise: Array,
) -> int:
    """Add the contacts of turns to one side; h and rise (17,) are scratch memory."""
    last, near = SAMPLES - 1, np.empty(SAMPLES)
    for i in range(SAMPLES):
        v, w, z = _move(piece.control, _T[i])
        turn = _turn(v, w, radius)
        h[i], rise[i] = turn.h, _rise(turn, w, z)
        near[i] = _NEAR * np.sqrt(v[0] * v[0] + v[1] * v[1])
    for i in range(SAMPLES):
        low = i > 0 and rise[i - 1] < 0.0 <= rise[i]
        if low and min(h[i - 1], h[i]) < reach:
            t = _refine(piece.control, radius, _T[i - 1], _T[i])
            count = add_turn(records, gradients, count, piece, radius, t, True)
        end = (i == 0 and rise[i] >= 0.0) or (i == last and rise[i] <= 0.0)
        if h[i] < near[i] or (end and h[i] < reach):
            count = add_turn(records, gradients, count, piece, radius, _T[i], False)
    return count


@compiled
def add_turns(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    radius: float,
    reach: float,
    pinned: Array,
) -> int:
    """Add a segment's contacts with the minimum turn radius [m] whose h is below the reach.

    Contacts (k, 3) in `pinned` are added at their parameters.
    """
    h, rise = np.empty(SAMPLES), np.empty(SAMPLES)
    for side in range(2):
        signed, what = (radius, LEFT) if side == 0 else (-radius, RIGHT)
        count = _add_side(records, gradients, count, piece, signed, TURN_RATIO * reach, h, rise)
        for row in range(len(pinned)):
            if int(pinned[row, 0]) == piece.k and int(pinned[row, 1]) == what:
                t = pinned[row, 2]
                count = add_turn(records, gradients, count, piece, signed, t, False)
    return count


def too_sharp(chain: Array, radius: float, tolerance: float) -> Array:
    """Pinned contacts where certification finds that segments (n, 4, 2) turn too sharply.

    Returns:
        (k, 3) segment, side and parameter, as `pinned_contacts` of
        `planners.optimization.sqp.expansion.Layout`; empty for radius zero, which allows any turn.
    """
    if radius == 0.0:
        return np.empty((0, 3))
    t = too_sharp_at(chain, radius, tolerance)
    segments = np.flatnonzero(~np.isnan(t))
    rows = np.empty((len(segments), 3))
    for row, k in zip(rows, segments, strict=True):
        (v0, v1), (w0, w1), _ = _move(chain[k], t[k])
        row[:] = k, LEFT if v0 * w1 > v1 * w0 else RIGHT, t[k]
    return rows


@compiled
def add_turn_hessian(
    hessian: Array,
    factor: float,
    records: Records,
    row: int,
    control: Array,
    radius: float,
    place: Integers,
) -> None:
    """Add `factor` times the Hessian of a contact's h; drift and mixed as in `CONTACT`."""
    contact = records[row]
    v, w, _ = _move(control, contact.t)
    turn = _turn(v, w, radius if contact.what == LEFT else -radius)
    one, two = row_weights(contact.t, 1), row_weights(contact.t, 2)
    mixed, drift = contact.mixed, contact.drift
    for i in range(8):
        for j in range(8):
            if place[i] < 0 or place[j] < 0:
                continue
            a, b = i // 2, j // 2
            if i % 2 != j % 2:
                both = turn.v01
                cross = turn.v0w1 if i % 2 == 0 else turn.v1w0
                back = turn.v1w0 if i % 2 == 0 else turn.v0w1
            elif i % 2 == 0:
                both, cross, back = turn.v00, turn.v0w0, turn.v0w0
            else:
                both, cross, back = turn.v11, turn.v1w1, turn.v1w1
            value = one[a] * one[b] * both + one[a] * two[b] * cross + two[a] * one[b] * back
            if drift != 0.0:
                value -= drift * mixed[i] * mixed[j]
            hessian[place[i], place[j]] += factor * value
