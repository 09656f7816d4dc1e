"""Ferguson (cubic Hermite) segments in any number of dimensions, batched.

A segment is a control array (..., 4, D) with rows start point, end point [m], start
derivative, end derivative [m per unit t]; the parameter t runs through [0, 1].

Reference:
    Ferguson (1964), Multivariable curve interpolation, J. ACM 11(2); the paper,
    section III-A.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.curves.curvature import greatest_curvatures
from ferguson_gym.runtime.arrays import Array, GenericArray, check_size, finite, real, truncate_repr
from ferguson_gym.runtime.jit import compiled

_POWER_BASIS = np.array(
    # rows: coefficients of 1, t, t^2, t^3; columns: F1..F4 of the paper
    [[1, 0, 0, 0], [0, 0, 1, 0], [-3, 3, -2, -1], [2, -2, 1, 1]],
    dtype=np.float64,
)

_TO_BEZIER = np.array([[1, 0, 0, 0], [1, 0, 1 / 3, 0], [0, 1, 0, -1 / 3], [0, 1, 0, 0]])
_FROM_BEZIER = np.array([[1, 0, 0, 0], [0, 0, 0, 1], [-3, 3, 0, 0], [0, 0, -3, 3]], np.float64)


def as_control(control: ArrayLike) -> Array:
    """Return a control array (..., 4, D) in double precision.

    Raises:
        ValueError: another shape, or entries that are not finite numbers of at most 1e120.
    """
    return _checked(real("a control array", control))


def _checked(array: GenericArray) -> GenericArray:
    """The array itself if it is finite and of shape (..., 4, D)."""
    if array.ndim < 2 or array.shape[-2] != 4 or array.shape[-1] < 1:
        raise ValueError(
            "a control array has shape (..., 4, D): start, end, start derivative, end derivative; "
            f"got {array.shape}"
        )
    check_size("a control array", array)
    return array


def _generic(control: GenericArray) -> GenericArray:
    """As `as_control`, but complex input is kept."""
    if isinstance(control, np.ndarray) and control.dtype.kind == "c":
        return _checked(control)
    return as_control(control)


def basis(t: ArrayLike, order: int = 0) -> Array:
    """Weights of the four control rows in the `order`-th derivative at t: (n, 4), or (4,).

    Args:
        t: (n,) parameters in [0, 1], or one number.
        order: 0 for the point, 1 for the derivative, and so on.

    Raises:
        ValueError: parameters of another shape or outside [0, 1], or no such derivative.
    """
    t = real("t", t)
    t = finite("t", t, (None,) if t.ndim else ())
    if t.size and not (t.min() >= 0.0 and t.max() <= 1.0):
        raise ValueError(f"parameters lie in [0, 1], got {t[(t < 0.0) | (t > 1.0)][0]}")
    if not isinstance(order, (int, np.integer)) or order < 0:
        given = truncate_repr(order)
        raise ValueError(f"a derivative's order is a whole number from 0 on, got {given}")
    powers = np.zeros((*t.shape, 4))
    for power in range(order, 4):
        factor = float(np.prod(np.arange(power, power - order, -1)))
        powers[..., power] = factor * t ** (power - order)
    return powers @ _POWER_BASIS


def evaluate(control: GenericArray, t: ArrayLike) -> GenericArray:
    """Points on Ferguson segments.

    Args:
        control: (*batch, 4, D) rows start, end [m]; derivatives there [m per unit t].
        t: (n,) parameters in [0, 1], or one number.

    Returns:
        (*batch, n, D) points [m]; (*batch, D) for one number.

    Raises:
        ValueError: a control array of another shape or not finite; parameters outside [0, 1].

    Reference:
        Ferguson (1964), Multivariable curve interpolation, J. ACM 11(2).

    Example:
        >>> bend = [[0, 0], [9, 3], [9, 0], [9, 6]]
        >>> evaluate(bend, [0.0, 0.5, 1.0]).tolist()
        [[0.0, 0.0], [4.5, 0.75], [9.0, 3.0]]
        >>> evaluate(bend, 0.5).tolist()
        [4.5, 0.75]
    """
    points: GenericArray = basis(t) @ _generic(control)
    return points


def derivative(control: GenericArray, t: ArrayLike, order: int = 1) -> GenericArray:
    """The `order`-th derivative with respect to t: (*batch, n, D) [m per unit t^order].

    At one number t it is (*batch, D).

    Raises:
        ValueError: as `evaluate`, or no such derivative.

    Example:
        >>> derivative([[0, 0], [9, 3], [9, 0], [9, 6]], [0.0, 1.0]).tolist()
        [[9.0, 0.0], [9.0, 6.0]]
    """
    slopes: GenericArray = basis(t, order) @ _generic(control)
    return slopes


def curvature(control: ArrayLike, t: ArrayLike) -> Array:
    """Unsigned curvature [1/m] at t: (*batch, n); infinite where the derivative vanishes.

    At one number t it is (*batch,).
    """
    control = as_control(control)
    first, second = derivative(control, t, 1), derivative(control, t, 2)
    speed2 = np.sum(first * first, axis=-1)
    dot = np.sum(first * second, axis=-1)
    # Lagrange's identity, the cross product in any number of dimensions; the projection
    # is subtracted first, since the difference of squares would cancel
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = second - (dot / speed2)[..., None] * first
        bend = np.sqrt(np.sum(normal * normal, axis=-1)) / speed2
    return np.where(speed2 > 0.0, bend, np.inf)


def max_curvature(control: ArrayLike) -> Array:
    """Maximum curvature [1/m] of each segment: (*batch,); 0 on a line, infinite at a cusp.

    A segment that is straight up to rounding errors of its control array counts as a line. It has a
    cusp where |X'| is at most 1e-12 times its largest coordinate
    (`ferguson_gym.curves.curvature.CUSP_SPEED`).
    """
    control = as_control(control)
    flat = np.ascontiguousarray(control.reshape(-1, *control.shape[-2:]))
    return greatest_curvatures(flat).reshape(control.shape[:-2])


def to_bezier(control: GenericArray) -> GenericArray:
    """Bézier points (*batch, 4, D) [m] of the same cubic; ValueError as `as_control`."""
    points: GenericArray = _TO_BEZIER @ _generic(control)
    return points


def from_bezier(points: GenericArray) -> GenericArray:
    """Control array (*batch, 4, D) of the cubic with these Bézier points; inverts `to_bezier`."""
    control: GenericArray = _FROM_BEZIER @ _generic(points)
    return control


def subdivide(control: ArrayLike, t: float = 0.5) -> tuple[Array, Array]:
    """Split segments at t into two, each over its own parameter in [0, 1].

    Returns:
        Two control arrays (*batch, 4, D); derivatives are scaled to the new parameter.

    Raises:
        ValueError: t outside the open interval (0, 1), or as `evaluate`.

    Example:
        >>> left, right = subdivide([[0, 0], [9, 3], [9, 0], [9, 6]])
        >>> left.tolist()
        [[0.0, 0.0], [4.5, 0.75], [4.5, 0.0], [4.5, 1.5]]
    """
    if real("t", t).shape or not 0.0 < t < 1.0:
        raise ValueError(f"a segment is split at 0 < t < 1, got t = {t}")
    control = as_control(control)
    point = basis([t]) @ control
    slope = basis([t], 1) @ control
    start, end, leave, arrive = (control[..., row : row + 1, :] for row in range(4))
    left = np.concatenate([start, point, t * leave, t * slope], axis=-2)
    right = np.concatenate([point, end, (1 - t) * slope, (1 - t) * arrive], axis=-2)
    return left, right


@compiled
def coordinate_extent(start: float, end: float, leave: float, arrive: float) -> tuple[float, float]:
    """Minimum and maximum of one coordinate along a segment.

    Extremes of a cubic lie at its ends and at the roots of its derivative; a root's
    rounding error moves the value only to second order.
    """
    low, high = min(start, end), max(start, end)
    # squares of huge or tiny numbers would overflow or underflow
    scale = max(abs(start), abs(end), abs(leave), abs(arrive))
    if scale == 0.0:
        return low, high
    c, d = leave / scale, start / scale
    a = (2.0 * (start - end) + leave + arrive) / scale
    b = (3.0 * (end - start) - 2.0 * leave - arrive) / scale
    square = b * b - 3.0 * a * c
    if square <= 0.0:
        return low, high
    q = -(b + np.copysign(np.sqrt(square), b))
    for numerator, denominator in ((q, 3.0 * a), (c, q)):
        t = numerator / denominator  # infinite or NaN where there is no such root
        if 0.0 < t < 1.0:
            value = scale * (((a * t + b) * t + c) * t + d)
            low, high = min(low, value), max(high, value)
    return low, high


@compiled
def _extents(control: Array) -> tuple[Array, Array]:
    shape = (len(control), control.shape[2])
    low, high = np.empty(shape), np.empty(shape)
    for s in range(len(control)):
        for d in range(control.shape[2]):
            low[s, d], high[s, d] = coordinate_extent(
                control[s, 0, d], control[s, 1, d], control[s, 2, d], control[s, 3, d]
            )
    return low, high


def extent(control: ArrayLike) -> tuple[Array, Array]:
    """Least and greatest value of each coordinate along the segments: 2 x (*batch, D) [m].

    Example:
        >>> low, high = extent([[0, 0], [9, 0], [9, 9], [9, -9]])
        >>> low.tolist(), high.tolist()
        ([0.0, 0.0], [9.0, 2.25])
    """
    control = as_control(control)
    low, high = _extents(np.ascontiguousarray(control.reshape(-1, *control.shape[-2:])))
    shape = (*control.shape[:-2], control.shape[-1])
    return low.reshape(shape), high.reshape(shape)
