"""The one encoding of segments as actions, shared by environment, optimiser and agents.

An action (4,) in [-1, 1] names the end point and end derivative of a planar segment, in the
frame that is turned with the vehicle (first axis forward, second to the left):

- end point: `REACH` times the Möbius translation (q + z) / (1 + q z) of z = a[0] + i a[1].
  The unit disc is mapped onto itself, smoothly, so every end point within 15.001 m has
  exactly one action, and z = 0 is 9 m ahead (q = 9 / 15.001).
- end derivative: `STEEPEST` sinh(4 w) / sinh(4) in each coordinate, fine near zero and
  coarse far out; forward w = (p + a[2]) / (1 + p a[2]), sideways w = a[3], and zero is a
  derivative of 9 m per unit t, straight ahead.

A feasible segment of 15 m has derivatives below 4.3904 x 15 m = 65.86 m per unit t (the
greatest value at an end of a quadratic polynomial whose absolute value has integral one),
so the encoding reaches them all.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.arrays import Array, finite

Action: TypeAlias = NDArray[np.float32]

REACH = 15.001
"""Distance of the farthest end point [m]: the longest segment, the tolerance, and some."""
STEEPEST = 66.0
"""Largest coordinate of an end derivative [m per unit t]."""
AHEAD = 9.0
"""Distance [m] and derivative [m per unit t] of the zero action, straight ahead."""
_SHARE = AHEAD / REACH
_FINENESS = 4.0
_SPREAD = STEEPEST / np.sinh(_FINENESS)
_OFFSET = float(np.arcsinh(AHEAD / _SPREAD) / _FINENESS)


def _shift(value: Any, share: float) -> Any:
    """Möbius translation of the unit interval or disc; the inverse has -share."""
    return (share + value) / (1.0 + share * value)


def _heading(derivative: Array) -> complex:
    forward = complex(derivative[0], derivative[1])
    size = abs(forward)
    return forward / size if size > 0.0 else 1.0 + 0.0j


def decode(
    action: ArrayLike, position: Array, derivative: Array, goal: Array, gate: float
) -> Array:
    """The segment (4, 2) that an action means for a vehicle's position and derivative.

    An end point within the gate of the goal is moved onto the goal.

    Args:
        action: (4,) in [-1, 1].
        position: (2,) where the vehicle is [m].
        derivative: (2,) its derivative [m per unit t].
        goal: (2,) [m].
        gate: [m].

    Raises:
        ValueError: another shape, not finite, or outside [-1, 1].
    """
    ahead, left, along, across = finite("action", action, (4,))
    if max(abs(ahead), abs(left), abs(along), abs(across)) > 1.0:
        raise ValueError(
            f"an action lies in [-1, 1], got {np.asarray(action).tolist()}; "
            "clip it, or encode a segment"
        )
    heading = _heading(derivative)
    step = REACH * _shift(complex(ahead, left), _SHARE) * heading
    slope = (
        _SPREAD
        * heading
        * complex(np.sinh(_FINENESS * _shift(along, _OFFSET)), np.sinh(_FINENESS * across))
    )
    end = position + np.array([step.real, step.imag])
    if np.linalg.norm(end - goal) <= gate:
        end = goal
    return np.array([position, end, derivative, (slope.real, slope.imag)])


def encode(segment: ArrayLike, position: Array, derivative: Array) -> Action:
    """The action that makes a vehicle fly to a segment's end: the inverse of `decode`.

    Only the end rows of the segment are used; start and heading are the vehicle's own, so
    errors of earlier steps do not add up.

    Args:
        segment: (4, 2) control array.
        position: (2,) where the vehicle is [m].
        derivative: (2,) its derivative [m per unit t].

    Returns:
        (4,) float32. `decode` gives the end back to a rounding of float32: 4e-6 m, and
        3e-5 m per unit t at the steepest derivative.

    Raises:
        ValueError: no action reaches the segment's end or end derivative.
    """
    control = finite("segment", segment, (4, 2))
    heading = _heading(derivative).conjugate()
    offset = control[1] - position
    step = complex(offset[0], offset[1]) * heading / REACH
    slope = complex(control[3, 0], control[3, 1]) * heading / _SPREAD
    forward, across = np.arcsinh([slope.real, slope.imag]) / _FINENESS
    # the inverse maps have their poles there, beyond all that an action reaches
    if inside := abs(step) < 1.0 / _SHARE and abs(forward) < 1.0 / _OFFSET:
        there, along = _shift(step, -_SHARE), _shift(forward, -_OFFSET)
        action = np.array([there.real, there.imag, along, across])
        inside = bool(np.abs(action).max() <= 1.0 + 1e-9)
    if not inside:
        raise ValueError(
            f"no action reaches a segment that ends {abs(step) * REACH:.6g} m away with "
            f"derivative {np.linalg.norm(control[3]):.6g} m per unit t; feasible segments "
            f"stay within {REACH} m and {STEEPEST} m per unit t"
        )
    single: Action = np.clip(action, -1.0, 1.0).astype(np.float32)
    return single
