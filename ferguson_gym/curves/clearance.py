"""Certified clearance of whole Ferguson segments from obstacles, and their minimum of |X'(t)|.

Every bound returned is proved for the whole curve, rounding included: the computed distance is
reduced by a margin of 2e-10 of the scale (the largest distance between a Bézier point and the
disc's centre) plus 1e-15 of the largest coordinate, and by about four times as much beside
obstacles of another shape. For a flight in the paper's field that is below 1e-7 m. Numbers below
1e-150, whose squares underflow, count as zero.

Reference:
    The paper, section III-C3, samples 29 points of a segment; a curve can cut into a disc between
    the samples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.curves import certified_kernels, obstacle_kernels
from ferguson_gym.curves.convex_core import Cores
from ferguson_gym.curves.splines import as_control
from ferguson_gym.runtime.arrays import Array, finite


def _checked(
    control: ArrayLike, centers: ArrayLike, radii: ArrayLike
) -> tuple[Array, Array, Array]:
    control = as_control(control)
    centers = finite("centers", centers, (None, control.shape[-1]))
    radii = finite("radii", radii, (len(centers),))
    return control, centers, radii


def _flat(control: Array) -> Array:
    return np.ascontiguousarray(control.reshape(-1, *control.shape[-2:]))


def _axes(control: Array) -> tuple[int, ...]:
    return tuple(range(control.shape[-1]))


_DISCS = Cores(np.empty((2, 0)), np.empty(0, np.int64), np.empty(0))
"""Of obstacles that are all discs."""


def closest(
    control: ArrayLike, centers: ArrayLike, radii: ArrayLike, cores: Cores = _DISCS
) -> tuple[Array, Array]:
    """Certified clearance of each segment from each obstacle, and where it is attained.

    Args:
        control: (*batch, 4, D) segments.
        centers: (n, D) centres of discs (balls), or of the balls around other obstacles [m].
        radii: (n,) radii of these [m].
        cores: of obstacles that are not all discs.

    Returns:
        Clearance (*batch, n) [m], a lower bound that differs from the true minimum over the whole
        curve by at most 3e-10 times the scale, for a disc, and 1e-9 times the scale for other
        obstacles; negative inside an obstacle; and its parameter, alike.

    Raises:
        ValueError: mismatched shapes, NaN or infinity.
    """
    control, centers, radii = _checked(control, centers, radii)
    columns = np.ascontiguousarray(centers.T)
    clear, where = obstacle_kernels.closest(_flat(control), columns, radii, cores, _axes(control))
    shape = (*control.shape[:-2], len(radii))
    return clear.reshape(shape), where.reshape(shape)


def clearance(control: ArrayLike, centers: ArrayLike, radii: ArrayLike) -> Array:
    """Certified clearance of each segment from all discs: (*batch,) [m].

    As `closest`, but only for the nearest disc, which is faster; infinite without discs.

    Example:
        >>> bend = [[0, 0], [9, 3], [9, 0], [9, 6]]
        >>> round(float(clearance(bend, centers=[[5, 3]], radii=[1])), 6)
        0.927364
    """
    return obstacle_clearance(control, centers, radii, _DISCS)


def obstacle_clearance(
    control: ArrayLike,
    centers: ArrayLike,
    radii: ArrayLike,
    cores: Cores,
    cutoff: float = np.inf,
) -> Array:
    """As `clearance`, from obstacles as `closest` takes them, or `cutoff` [m] if that is less."""
    control, centers, radii = _checked(control, centers, radii)
    columns = np.ascontiguousarray(centers.T)
    clear = obstacle_kernels.clearance(
        _flat(control), columns, radii, cores, cutoff, _axes(control)
    )
    return clear.reshape(control.shape[:-2])


def is_clear(
    control: ArrayLike, centers: ArrayLike, radii: ArrayLike, least: float = 0.0
) -> NDArray[np.bool_]:
    """Whether each segment keeps at least `least` [m] from all discs: (*batch,) of bool.

    Faster than comparing `clearance`. True is proved. If the clearance exceeds `least` by less than
    3e-10 of the scale, the answer may be False. Errors are those of `closest`.

    Example:
        >>> is_clear([[0, 0], [9, 3], [9, 0], [9, 6]], [[5, 3]], [1], least=0.9).item()
        True
    """
    finite("least", least, ())
    clear = obstacle_clearance(control, centers, radii, _DISCS, float(least))
    return np.asarray(clear >= least)


def least_speed(control: ArrayLike) -> tuple[Array, Array]:
    """Certified least |X'(t)| of each segment [m per unit t] and its parameter: 2 x (*batch,)."""
    control = as_control(control)
    speed, where = certified_kernels.least_speed(_flat(control), _axes(control))
    return speed.reshape(control.shape[:-2]), where.reshape(control.shape[:-2])
