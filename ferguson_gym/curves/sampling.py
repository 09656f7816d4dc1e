"""Points along a chain of segments, evenly spaced in arc length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import basis, curvature, derivative, evaluate
from ferguson_gym.runtime.arrays import Array, frozen

MOST = 1_000_000
"""Upper limit of the number of points."""
_STEPS = 60
"""Upper limit of steps towards a parameter; bisection alone would need no more."""
_PRECISION = 1e-12
"""Error of arc lengths that ends the search for a parameter, relative to the segment's length."""
_REST = 1e-9
"""Speed that counts as standing still, relative to the segment's length."""
_ASIDE = 1e-6
"""Change of the parameter after which a vehicle that stands still has a direction."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PathSamples:
    """Points of a path at even distances along it, from its start to its end."""

    distance: Array
    """(n,) arc length from the start of the path [m]."""
    position: Array
    """(n, D) [m]."""
    direction: Array
    """(n, D) unit vectors along the path."""
    curvature: Array
    """(n,) [1/m]: in the plane positive where the path turns left, otherwise never negative;
    infinite at a cusp."""

    def __post_init__(self) -> None:
        for name in ("distance", "position", "direction", "curvature"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.distance)

    @property
    def heading(self) -> Array:
        """(n,) angle of the direction from the x axis [rad], counterclockwise, in [-pi, pi].

        Raises:
            ValueError: a path that is not planar.
        """
        if self.direction.shape[1] != 2:
            raise ValueError(
                f"only a planar path has headings, this one has {self.direction.shape[1]} "
                "dimensions: use direction"
            )
        angles: Array = np.arctan2(self.direction[:, 1], self.direction[:, 0])
        return angles


def sample(control: Array, number: int) -> PathSamples:
    """Points at even distances along a chain of segments (m, 4, D), both of its ends included.

    Raises:
        ValueError: a number of points below 2 or above `MOST`, or a chain of length zero.
    """
    if not 2 <= number <= MOST:
        raise ValueError(f"a path is sampled at 2 to {MOST} points, got {number}")
    lengths = length(control)
    control, lengths = control[lengths > 0.0], lengths[lengths > 0.0]
    if len(lengths) == 0:
        raise ValueError("a path of length 0 has no directions to sample")
    ends = np.cumsum(lengths)
    distance = np.linspace(0.0, ends[-1], number)
    index = np.minimum(np.searchsorted(ends, distance, side="right"), len(ends) - 1)
    along = np.clip(distance - (ends - lengths)[index], 0.0, lengths[index])
    t = _parameters(control[index], lengths[index], along)
    t[[0, -1]] = 0.0, 1.0  # the ends themselves, without rounding
    position = np.empty((number, control.shape[-1]))
    direction, bend = np.empty_like(position), np.empty(number)
    for k in np.unique(index):
        here = index == k
        position[here] = evaluate(control[k], t[here])
        direction[here], bend[here] = _tangents(control[k], float(lengths[k]), t[here])
    return PathSamples(distance=distance, position=position, direction=direction, curvature=bend)


def _parameters(rows: Array, lengths: Array, along: Array) -> Array:
    """Parameters (n,) up to which segments (n, 4, D) of given lengths are `along` [m] long.

    Newton's method, safeguarded by bisection: the derivative of the arc length is the speed.
    """
    low, high, t = np.zeros(len(rows)), np.ones(len(rows)), along / lengths
    for _ in range(_STEPS):
        point = np.einsum("pk,pkd->pd", basis(t), rows)
        slope = np.einsum("pk,pkd->pd", basis(t, 1), rows)
        before = np.stack([rows[:, 0], point, t[:, None] * rows[:, 2], t[:, None] * slope], axis=1)
        excess = length(before) - along
        if (np.abs(excess) <= _PRECISION * lengths).all():
            break
        low, high = np.where(excess < 0.0, t, low), np.where(excess < 0.0, high, t)
        speed = np.linalg.norm(slope, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = t - excess / speed
        t = np.where((low < step) & (step < high), step, 0.5 * (low + high))
    return t


def _tangents(control: Array, size: float, t: Array) -> tuple[Array, Array]:
    """Unit tangents (n, D) and curvatures (n,) of a segment (4, D) of length `size` [m] at t.

    Where the vehicle stands still the tangent is that of the path after it, or before its end.
    """
    velocity = derivative(control, t)
    resting = np.linalg.norm(velocity, axis=1) <= _REST * size
    aside = np.where(t < 0.5, t + _ASIDE, t - _ASIDE)
    velocity[resting] = derivative(control, aside[resting])
    bend = curvature(control, t)
    if control.shape[-1] == 2:
        (x, y), (ax, ay) = velocity.T, derivative(control, t, 2).T
        bend = np.copysign(bend, x * ay - y * ax)
    return velocity / np.linalg.norm(velocity, axis=1, keepdims=True), bend
