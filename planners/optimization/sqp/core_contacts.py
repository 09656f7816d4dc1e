"""Contacts of a segment with obstacles around lines and polygons, to second order, compiled.

Outside of a core, the distance from it is that from the nearest corner or edge: a corner has the
contacts of a disc, an edge those of a straight line. Where a segment crosses a core, the distance
has a kink at its least point, and its gradient leads back and forth along the segment rather than
out. The clearance of a crossing is therefore minus the distance by which the segment must move
sideways, to the side where that is less: the distance of the segment from the corner that it must
pass on the other side. It changes smoothly into the distance from that corner when the segment has
passed it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ferguson_gym.curves.convex_core import nearest_on_core, outward_normal
from ferguson_gym.curves.core_crossings import line_exit
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from planners.optimization.sqp.contacts import (
    MIN_NORM,
    NEAR,
    SAMPLES,
    Curve,
    Local,
    Piece,
    Records,
    record,
    row_weights,
)

_AXES = (0, 1)
_T = np.linspace(0.0, 1.0, SAMPLES)
_NARROW = 1e-3
"""Width of a bracket in t in which the distance has a kink if Newton's method does not converge."""
_ALONG = 0.5
"""Sine of the angle between a segment and a level line of the distance below which it runs along
the obstacle."""
_FAR = 0.25
"""Greatest difference in t between a crossing and the point nearest to the corner to be passed."""


class Core(NamedTuple):
    """An obstacle: the hull of some corners, grown by a radius."""

    what: int
    """Index of the obstacle."""
    corners: Array
    """(2, c) of all obstacles [m]."""
    first: int
    """Index of its first corner."""
    end: int
    """Index behind its last corner."""
    radius: float


@compiled
def _visit(powers: Array, t: float, here: Local) -> None:
    """Fill the point and the derivatives of a segment at t."""
    for d in range(2):
        a1, a2, a3 = powers[1, d], powers[2, d], powers[3, d]
        here.point[d] = powers[0, d] + t * (a1 + t * (a2 + t * a3))
        here.slope[d] = a1 + t * (2.0 * a2 + 3.0 * t * a3)
        here.bend[d] = 2.0 * a2 + 6.0 * t * a3


@compiled
def _dot(a: Array, b: Array) -> float:
    return float(a[0] * b[0] + a[1] * b[1])


@compiled
def _look(core: Core, here: Local) -> tuple[float, float, float, float]:
    """How a point of a segment lies beside a core; fills the normal.

    Returns:
        The signed distance from the core [m]; its derivative with respect to t; the curvature of
        its level set [1/m]; and Newton's step to its minimum, infinite where it is not convex, and
        on a corner, where the normal is zero.
    """
    near = nearest_on_core(here.point, core.corners, core.first, core.end, _AXES)
    inverse = outward_normal(
        here.point, near, core.corners, core.first, core.end, _AXES, here.normal
    )
    rise, curve, scale = _dot(here.normal, here.slope), _dot(here.normal, here.bend), 1.0
    if near.share == 0.0:  # of the squared distance, which is smooth at a corner
        scale = near.distance
        curve = scale * curve + _dot(here.slope, here.slope)
    step = scale * rise / curve if curve > 0.0 and scale > MIN_NORM else np.inf
    return near.distance, rise, inverse, step


@compiled
def _nearest_to_corner(powers: Array, x: float, y: float, t: float, here: Local) -> float:
    """Parameter in (0, 1) of a segment's point nearest to (x, y), close to t; or -1."""
    start = t
    for _ in range(20):
        _visit(powers, t, here)
        here.point[0] -= x
        here.point[1] -= y
        curve = _dot(here.slope, here.slope) + _dot(here.point, here.bend)
        if curve <= 0.0:
            return -1.0
        step = _dot(here.point, here.slope) / curve
        t -= step
        if not 0.0 < t < 1.0 or abs(t - start) > _FAR:
            return -1.0
        if abs(step) < 1e-13:
            return t
    return -1.0


@compiled
def _add(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    core: Core,
    t: float,
    distance: float,
    inverse: float,
    moving: bool,
    here: Local,
) -> int:
    """Add a contact along the local normal, at a distance from the core."""
    normal, clearance = (here.normal[0], here.normal[1]), distance - core.radius
    record(records, gradients, count, piece, core.what, t, clearance, normal, inverse)
    along = _dot(here.slope, here.normal)
    turn = _dot(here.normal, here.bend) + (_dot(here.slope, here.slope) - along**2) * inverse
    if moving and abs(turn) > MIN_NORM:
        contact = records[count]
        contact.drift = 1.0 / turn
        weights, slopes = row_weights(t, 0), row_weights(t, 1)
        for i in range(8):
            across = (here.slope[i % 2] - along * here.normal[i % 2]) * inverse
            contact.mixed[i] = slopes[i // 2] * here.normal[i % 2] + weights[i // 2] * across
    return count + 1


@compiled
def _add_crossing(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    core: Core,
    t: float,
    reach: float,
    curve: Curve,
) -> int:
    """Add the contact with the corner that a segment crossing a core at t must pass.

    It is at the segment's point nearest to that corner, if that is close to t; otherwise at t, with
    the line through the corner along the segment.
    """
    here, powers = curve.local, curve.powers
    _visit(powers, t, here)
    if _dot(here.slope, here.slope) < MIN_NORM**2:  # any direction will do
        here.slope[0], here.slope[1] = 1.0, 0.0
    x, y, vx, vy = here.point[0], here.point[1], here.slope[0], here.slope[1]
    out = line_exit(x, y, vx, vy, core.corners, core.first, core.end)
    k, left = out.corner, out.left
    corner_x, corner_y = core.corners[0, k], core.corners[1, k]
    at = _nearest_to_corner(powers, corner_x, corner_y, t, here)
    if at > 0.0 and _supports(here, k, left, core):
        # the point is relative to the corner
        _across(here, left)
        distance = _dot(here.normal, here.point)
        if distance - core.radius >= reach:
            return count
        inverse = 1.0 / max(abs(distance), MIN_NORM)
        inverse = inverse if distance >= 0.0 else -inverse
        return _add(records, gradients, count, piece, core, at, distance, inverse, True, here)
    if -out.depth - core.radius >= reach:
        return count
    here.slope[0], here.slope[1] = vx, vy
    _across(here, left)
    return _add(records, gradients, count, piece, core, t, -out.depth, 0.0, False, here)


@compiled
def _across(here: Local, left: bool) -> None:
    """Let the normal point to one side of the curve."""
    size = np.sqrt(_dot(here.slope, here.slope))
    size = size if left else -size
    here.normal[0], here.normal[1] = -here.slope[1] / size, here.slope[0] / size


@compiled
def _supports(here: Local, k: int, left: bool, core: Core) -> bool:
    """Whether corner k is the outermost one on a side, in the direction of the curve."""
    size2 = _dot(here.slope, here.slope)
    if size2 < MIN_NORM**2:
        return False
    for j in range(core.first, core.end):
        over = here.slope[0] * (core.corners[1, j] - core.corners[1, k])
        over -= here.slope[1] * (core.corners[0, j] - core.corners[0, k])
        if (over if left else -over) > MIN_NORM * np.sqrt(size2):
            return False
    return True


@compiled
def _add_least(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    core: Core,
    low: float,
    high: float,
    reach: float,
    curve: Curve,
) -> int:
    """Add the contact at the least distance between two t, where it falls and where it rises."""
    here, powers = curve.local, curve.powers
    t = 0.5 * (low + high)
    for _ in range(40):
        if high - low < _NARROW:
            break
        _visit(powers, t, here)
        distance, rise, inverse, step = _look(core, here)
        if abs(step) < 1e-13:
            if distance - core.radius >= reach:
                return count
            return _add(records, gradients, count, piece, core, t, distance, inverse, True, here)
        if rise > 0.0:
            high = t
        else:
            low = t
        t = t - step if low < t - step < high else 0.5 * (low + high)
    return _add_crossing(records, gradients, count, piece, core, t, reach, curve)


@compiled
def add_fixed_to_core(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    core: Core,
    t: float,
    reach: float,
    curve: Curve,
) -> int:
    """Add a contact at a fixed t: a crossing, where the distance changes much along the segment."""
    if count == len(records):
        return count
    here = curve.local
    _visit(curve.powers, t, here)
    distance, rise, inverse, _ = _look(core, here)
    on_corner = _dot(here.normal, here.normal) == 0.0
    if on_corner or (0.0 < t < 1.0 and not _runs_along(rise, here.slope)):
        return _add_crossing(records, gradients, count, piece, core, t, reach, curve)
    if distance - core.radius >= reach:
        return count
    return _add(records, gradients, count, piece, core, t, distance, inverse, False, here)


@compiled
def _runs_along(rise: float, slope: Array) -> bool:
    return rise * rise <= _ALONG**2 * _dot(slope, slope)


@compiled
def _sample(core: Core, curve: Curve) -> float:
    """Fill the signed distance of the samples from a core; return the least one.

    Also fills numbers of the sign of the derivative of the distance with respect to t.
    """
    apart, rise, depth, fall = curve.apart, curve.rise, curve.depth, curve.fall
    apart[:], depth[:] = np.inf, -np.inf
    flat = core.end - core.first == 2
    for k in range(core.first, core.end - 1 if flat else core.end):
        after = k + 1 if k + 1 < core.end else core.first
        x, y = core.corners[0, k], core.corners[1, k]
        ex, ey = core.corners[0, after] - x, core.corners[1, after] - y
        size2 = ex * ex + ey * ey
        nx, ny = ey / np.sqrt(size2), -ex / np.sqrt(size2)
        # without branches, so that several samples are computed at a time
        for i in range(len(apart)):
            dx, dy = curve.points[i, 0] - x, curve.points[i, 1] - y
            share = min(max((dx * ex + dy * ey) / size2, 0.0), 1.0)
            beyond = nx * dx + ny * dy
            dx, dy = dx - share * ex, dy - share * ey
            square = dx * dx + dy * dy
            # along the edge's normal: near it, the difference from it has no direction
            along = nx * curve.slopes[i, 0] + ny * curve.slopes[i, 1]
            fall[i] = along if beyond > depth[i] else fall[i]
            along = -along if flat and beyond < 0.0 else along
            along = (
                along if 0.0 < share < 1.0 else dx * curve.slopes[i, 0] + dy * curve.slopes[i, 1]
            )
            rise[i] = along if square < apart[i] else rise[i]
            apart[i] = min(square, apart[i])
            depth[i] = max(beyond, depth[i])
    least = np.inf
    for i in range(len(apart)):
        apart[i] = np.sqrt(apart[i])
        if not flat and depth[i] <= 0.0:
            apart[i], rise[i] = depth[i], fall[i]
        least = min(least, apart[i])
    return least


@compiled
def add_around_core(
    records: Records,
    gradients: Array,
    count: int,
    piece: Piece,
    core: Core,
    reach: float,
    ends: bool,
    curve: Curve,
) -> int:
    """Add a segment's contacts with an obstacle."""
    least, last = _sample(core, curve) - core.radius, SAMPLES - 1
    if least >= reach + curve.spread[1]:
        return count
    for i in range(1, last + 1):
        if curve.rise[i - 1] < 0.0 <= curve.rise[i] and count < len(records):
            low, high = _T[i - 1], _T[i]
            count = _add_least(records, gradients, count, piece, core, low, high, reach, curve)
    if ends and curve.rise[last] <= 0.0:
        count = add_fixed_to_core(records, gradients, count, piece, core, 1.0, reach, curve)
    for i in range(1, last + 1):
        if curve.apart[i] < core.radius + NEAR and count < len(records):
            here = curve.local
            _visit(curve.powers, _T[i], here)
            distance, rise, inverse, _ = _look(core, here)
            if _runs_along(rise, here.slope) and _dot(here.normal, here.normal) > 0.0:
                t = _T[i]
                count = _add(
                    records, gradients, count, piece, core, t, distance, inverse, False, here
                )
    return count
