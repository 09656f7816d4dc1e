"""The one encoding of segments as actions, shared by environment, optimiser and agents.

An action (4,) in [-1, 1] encodes the end point and end derivative of a planar segment, in the
vehicle's frame (first axis forward, second to the left). Below, a unit u is that of the field's
limits, a fifteenth of the longest segment (1 m in the paper's fields), so that a flight scaled with
its field has the same actions.

- end point: `REACH` times the Möbius translation (q + z) / (1 + q z) of z = a[0] + i a[1].
  The unit disc is mapped onto itself, smoothly, so every end point within 15.001 u has
  exactly one action, and z = 0 is 9 u ahead (q = 9 / 15.001).
- end derivative: `STEEPEST` sinh(4 w) / sinh(4) in each coordinate, fine near zero and coarse far
  out; along w = (p + a[2]) / (1 + p a[2]), across w = a[3], and zero is a derivative of 9 u per
  unit t. Its axes are rotated by 2 y / (9 u), with y the end point's offset to the left. To first
  order this is the heading at which a circular arc reaches the end point, so that actions with a[2]
  = a[3] = 0 give smooth curves.

A feasible segment of 15 u has derivatives below 4.3904 x 15 u = 65.86 u per unit t (the greatest
value at an end of a quadratic polynomial whose absolute value has integral one), so the encoding
reaches them all.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.runtime.arrays import Array, finite
from ferguson_gym.runtime.jit import compiled

Action: TypeAlias = NDArray[np.float32]

REACH = 15.001
"""Distance of the farthest end point [u]: the longest segment plus a little over the tolerance."""
STEEPEST = 66.0
"""Largest coordinate of an end derivative [u per unit t]."""
AHEAD = 9.0
"""Distance [u] and derivative [u per unit t] of the zero action, straight ahead."""
SHARE = AHEAD / REACH
"""Parameter q of the end point's translation."""
FINENESS = 4.0
"""Factor in sinh: the larger it is, the finer is the encoding of small derivatives."""
SPREAD = float(STEEPEST / np.sinh(FINENESS))
"""Derivative [u per unit t] by which sinh is multiplied."""
OFFSET = float(np.arcsinh(AHEAD / SPREAD) / FINENESS)
"""Parameter p of the translation of the end derivative's first coordinate."""
_TINY = 1e-140
"""Length [m per unit t] below which a derivative is scaled before it is squared."""
BEND = 2.0 * REACH / AHEAD
"""Rotation of the end derivative's axes [rad] for an end point `REACH` to the left."""


@compiled
def heading(along: float, across: float) -> complex:
    """Direction of a derivative as a complex number of modulus 1; the first axis for zero."""
    size = np.sqrt(along * along + across * across)
    if size < _TINY:  # the squares would underflow
        scale = max(abs(along), abs(across))
        if scale == 0.0:
            return 1.0 + 0.0j
        along, across = along / scale, across / scale
        size = np.sqrt(along * along + across * across)
    return complex(along / size, across / size)


@compiled
def share_of_steepest(slope: float) -> float:
    """Coordinate of a derivative [u per unit t] on the scale of actions: 1 at `STEEPEST`."""
    return float(np.arcsinh(slope / SPREAD) / FINENESS)


@compiled
def end_point(ahead: float, left: float) -> complex:
    """End point for two entries of an action, in the vehicle's frame, in units of `REACH`."""
    below = complex(1.0 + SHARE * ahead, -SHARE * left)
    square = below.real * below.real + below.imag * below.imag
    above = complex(SHARE + ahead, left) * below
    return complex(above.real / square, above.imag / square)


@compiled
def _arrival(end: complex) -> complex:
    turn = BEND * end.imag
    return complex(np.cos(turn), np.sin(turn))


@compiled
def decode_into(
    control: Array,
    action: NDArray[np.floating[Any]],
    position: Array,
    derivative: Array,
    goal: Array,
    gate: float,
    unit: float,
) -> None:
    """`decode` into a control array (4, 2), without its checks."""
    forward = heading(derivative[0], derivative[1])
    end = end_point(float(action[0]), float(action[1]))
    step = unit * REACH * end * forward
    share = float(action[2])
    along = np.sinh(FINENESS * ((OFFSET + share) / (1.0 + OFFSET * share)))
    across = np.sinh(FINENESS * float(action[3]))
    slope = unit * SPREAD * forward * _arrival(end) * complex(along, across)
    control[0, 0], control[0, 1] = position[0], position[1]
    control[1, 0], control[1, 1] = position[0] + step.real, position[1] + step.imag
    control[2, 0], control[2, 1] = derivative[0], derivative[1]
    control[3, 0], control[3, 1] = slope.real, slope.imag
    x, y = control[1, 0] - goal[0], control[1, 1] - goal[1]
    if np.sqrt(x * x + y * y) <= gate:
        control[1, 0], control[1, 1] = goal[0], goal[1]


@compiled
def encode_into(
    action: Action, segment: Array, position: Array, derivative: Array, unit: float
) -> bool:
    """`encode` into an action (4,), without its checks; False if no action reaches the end."""
    turn = heading(derivative[0], derivative[1]).conjugate()
    offset = complex(segment[1, 0] - position[0], segment[1, 1] - position[1])
    step = offset * turn / (unit * REACH)
    slope = complex(segment[3, 0], segment[3, 1]) * turn / (unit * SPREAD)
    # poles of the inverse maps lie outside the reachable set
    if not abs(step) < 1.0 / SHARE:
        return False
    there = (step - SHARE) / (1.0 - SHARE * step)
    action[0] = min(max(there.real, -1.0), 1.0)
    action[1] = min(max(there.imag, -1.0), 1.0)
    # the axes are turned as the rounded action will turn them
    slope *= _arrival(end_point(float(action[0]), float(action[1]))).conjugate()
    along, across = np.arcsinh(slope.real) / FINENESS, np.arcsinh(slope.imag) / FINENESS
    if not abs(along) < 1.0 / OFFSET:
        return False
    along = (along - OFFSET) / (1.0 - OFFSET * along)
    action[2], action[3] = min(max(along, -1.0), 1.0), min(max(across, -1.0), 1.0)
    largest = max(abs(there.real), abs(there.imag), abs(along), abs(across))
    return bool(largest <= 1.0 + 1e-9)


def check_action(action: ArrayLike, where: str = "") -> Array:
    """Return an action (4,) in double precision.

    Raises:
        ValueError: another shape, not finite, or outside [-1, 1]; the message includes `where`.
    """
    return _within_box(finite(f"action{where}", action, (4,)), action, where)


def check_actions(actions: ArrayLike, number: int) -> Array:
    """Return actions (number, 4) in double precision.

    Raises:
        ValueError: another shape, not finite, or outside [-1, 1].
    """
    return _within_box(finite("actions", actions, (number, 4)), actions, "")


def _within_box(given: Array, action: ArrayLike, where: str) -> Array:
    if given.size and np.abs(given).max() > 1.0:
        raise ValueError(
            f"an action lies in [-1, 1], got {np.asarray(action).tolist()}{where}; "
            "clip it, or encode a segment"
        )
    return given


def _unshifted(value: Any, share: float) -> Any:
    """Inverse of the translation of the unit interval or disc by `share`."""
    return (value - share) / (1.0 - share * value)


def decode(
    action: ArrayLike,
    position: Array,
    derivative: Array,
    goal: Array,
    gate: float,
    unit: float = 1.0,
) -> Array:
    """The segment (4, 2) that an action encodes, for a vehicle's position and derivative.

    An end point within the gate of the goal is moved onto the goal.

    Args:
        action: (4,) in [-1, 1].
        position: (2,) of the vehicle [m].
        derivative: (2,) of the vehicle [m per unit t].
        goal: (2,) [m].
        gate: [m].
        unit: of the field's limits, `Limits.unit` [m].

    Raises:
        ValueError: another shape, not finite, or an action outside [-1, 1].

    Example:
        >>> here, ahead, goal = np.zeros(2), np.array([9.0, 0.0]), np.array([100.0, 100.0])
        >>> decode([0, 0, 0, 0], here, ahead, goal, gate=1.0).round(6).tolist()
        [[0.0, 0.0], [9.0, 0.0], [9.0, 0.0], [9.0, 0.0]]
    """
    given = check_action(action)
    here, ahead = finite("position", position, (2,)), finite("derivative", derivative, (2,))
    control = np.empty((4, 2))
    decode_into(control, given, here, ahead, finite("goal", goal, (2,)), gate, unit)
    return control


def encode(segment: ArrayLike, position: Array, derivative: Array, unit: float = 1.0) -> Action:
    """The action by which a vehicle flies to a segment's end: the inverse of `decode`.

    Only the end rows of the segment are used; start and heading are the vehicle's own, so
    errors of earlier steps do not add up.

    Args:
        segment: (4, 2) control array.
        position: (2,) of the vehicle [m].
        derivative: (2,) of the vehicle [m per unit t].
        unit: of the field's limits, `Limits.unit` [m].

    Returns:
        (4,) float32. `decode` gives the end back to a rounding of float32: 4e-6 units, and
        3e-5 units per unit t at the steepest derivative.

    Raises:
        ValueError: no action reaches the segment's end or end derivative; another shape, or
            not finite.

    Example:
        >>> here, ahead, goal = np.zeros(2), np.array([9.0, 0.0]), np.array([100.0, 100.0])
        >>> action = encode([[0, 0], [9, 3], [9, 0], [9, 6]], here, ahead)
        >>> decode(action, here, ahead, goal, gate=1.0).round(5).tolist()
        [[0.0, 0.0], [9.0, 3.0], [9.0, 0.0], [9.0, 6.0]]
    """
    control = finite("segment", segment, (4, 2))
    here, ahead = finite("position", position, (2,)), finite("derivative", derivative, (2,))
    action = np.empty(4, np.float32)
    if not encode_into(action, control, here, ahead, unit):
        offset = control[1] - here
        raise ValueError(
            f"no action reaches a segment that ends {np.hypot(*offset):.6g} m away with "
            f"derivative {np.linalg.norm(control[3]):.6g} m per unit t; feasible segments "
            f"stay within {unit * REACH:g} m and {unit * STEEPEST:g} m per unit t"
        )
    return action


def encode_ends(
    ends: Array, slopes: Array, derivatives: Array, units: Array
) -> tuple[Action, NDArray[np.bool_]]:
    """As `encode`, for many segments from vehicles in the origin.

    Args:
        ends: (m, 2) end points, from the vehicles' positions [m].
        slopes: (m, 2) end derivatives [m per unit t].
        derivatives: (m, 2) of the vehicles [m per unit t].
        units: (m,) of the fields' limits [m].

    Returns:
        Actions (m, 4), and which of them reach their segments' ends (m,).
    """
    turns = np.array([heading(along, across).conjugate() for along, across in derivatives])
    steps = (ends[:, 0] + 1j * ends[:, 1]) * turns / (units * REACH)
    inside = np.abs(steps) < 1.0 / SHARE
    there = _unshifted(np.where(inside, steps, 0.0), SHARE)
    point = np.clip([there.real, there.imag], -1.0, 1.0).astype(np.float32)
    arrivals = np.array([_arrival(end_point(float(x), float(y))) for x, y in point.T])
    turned = (slopes[:, 0] + 1j * slopes[:, 1]) * turns * arrivals.conj() / (units * SPREAD)
    along, across = np.arcsinh([turned.real, turned.imag]) / FINENESS
    inside &= np.abs(along) < 1.0 / OFFSET
    along = _unshifted(np.where(inside, along, 0.0), OFFSET)
    actions = np.stack([there.real, there.imag, along, across], axis=1)
    inside &= np.abs(actions).max(axis=1) <= 1.0 + 1e-9
    return np.clip(actions, -1.0, 1.0).astype(np.float32), inside
