"""Certified clearance between whole Ferguson segments and discs, and their least speed.

Every bound returned is proved for the whole curve, rounding included: a distance found is
reduced by an outward margin of 2e-10 of the scale (the largest distance between a Bézier
point and the disc's centre) plus 1e-15 of the largest coordinate. For a flight in the
paper's field that is below 1e-7 m.

Reference:
    The paper, section III-C3, samples 29 points of a segment; a sampled curve can cut
    some millimetres into a disc.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.arrays import Array, finite
from ferguson_gym.bernstein import DEPTH, least_norm, products
from ferguson_gym.compilation import compiled
from ferguson_gym.splines import as_control

_MARGIN = 2e-10
"""Outward margin, part of the scale; covers the search (1e-10) and its rounding."""
_GRAIN = 1e-15
"""Outward margin, part of the largest coordinate; covers forming X(t) - c."""


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
def _closest(control: Array, centers: Array, radii: Array) -> tuple[Array, Array]:
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
def _clearance(control: Array, centers: Array, radii: Array) -> Array:
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
def _is_clear(control: Array, centers: Array, radii: Array, least: float) -> NDArray[np.bool_]:
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
def _least_speed(control: Array) -> tuple[Array, Array]:
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


def _checked(
    control: ArrayLike, centers: ArrayLike, radii: ArrayLike
) -> tuple[Array, Array, Array]:
    control = as_control(control)
    centers = finite("centers", centers, (None, control.shape[-1]))
    radii = finite("radii", radii, (len(centers),))
    return control, centers, radii


def _flat(control: Array) -> Array:
    return np.ascontiguousarray(control.reshape(-1, *control.shape[-2:]))


def closest(control: ArrayLike, centers: ArrayLike, radii: ArrayLike) -> tuple[Array, Array]:
    """Certified clearance of each segment from each disc, and where it is attained.

    Args:
        control: (*batch, 4, D) segments.
        centers: (n, D) centres of the discs (balls) [m].
        radii: (n,) radii [m].

    Returns:
        Clearance (*batch, n) [m], a lower bound within 3e-10 of the scale of the true
        minimum over the whole curve, negative inside a disc; and the parameter (*batch, n).

    Raises:
        ValueError: mismatched shapes, NaN or infinity.
    """
    control, centers, radii = _checked(control, centers, radii)
    clear, where = _closest(_flat(control), centers, radii)
    shape = (*control.shape[:-2], len(radii))
    return clear.reshape(shape), where.reshape(shape)


def clearance(control: ArrayLike, centers: ArrayLike, radii: ArrayLike) -> Array:
    """Certified clearance of each segment from all discs: (*batch,) [m].

    As `closest`, for the nearest disc alone and therefore faster; infinite without discs.
    """
    control, centers, radii = _checked(control, centers, radii)
    return _clearance(_flat(control), centers, radii).reshape(control.shape[:-2])


def is_clear(
    control: ArrayLike, centers: ArrayLike, radii: ArrayLike, least: float = 0.0
) -> NDArray[np.bool_]:
    """Whether each segment keeps at least `least` [m] from all discs: (*batch,) of bool.

    The quick question on its own: a yes is proved as in `clearance`; within 3e-10 of the
    scale above the threshold the answer may be no.

    Raises:
        ValueError: mismatched shapes, NaN or infinity.
    """
    control, centers, radii = _checked(control, centers, radii)
    finite("least", least, ())
    return _is_clear(_flat(control), centers, radii, float(least)).reshape(control.shape[:-2])


def least_speed(control: ArrayLike) -> tuple[Array, Array]:
    """Certified least |X'(t)| of each segment [m per unit t] and its parameter: 2 x (*batch,)."""
    control = as_control(control)
    speed, where = _least_speed(_flat(control))
    return speed.reshape(control.shape[:-2]), where.reshape(control.shape[:-2])
