"""What a pilot sees: numbers in [-1, 1], in a frame that is turned with the vehicle."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.actions import STEEPEST
from ferguson_gym.arrays import Array
from ferguson_gym.fields import Field
from ferguson_gym.flight import State
from ferguson_gym.limits import Limits
from ferguson_gym.obstacles import Discs

Observation: TypeAlias = dict[str, NDArray[np.float32]]

SHAPES: dict[str, int] = {"vehicle": 6, "goal": 3}
"""Lengths of the entries whose shape is fixed; see `observe` for what they hold."""
COLUMNS = 4
"""Numbers an obstacle is described by."""


def observe(field: Field, state: State, limits: Limits, nearest: int) -> Observation:
    """The observation of a state.

    Lengths are parts of the look-ahead (three times the longest segment, 45 m) unless said
    otherwise; what lies farther is clipped to 1.

    Args:
        field: whose obstacles are discs in the plane.
        state: of the vehicle.
        limits: of the flight.
        nearest: K, the number of obstacles described.

    Returns:
        vehicle (6,): position within the bounds, x and y from -1 to 1; heading, cosine and
            sine; speed, part of the greatest derivative, 66 m per unit t; segments left,
            part of all.
        goal (3,): distance, part of the bounds' diagonal; direction forward and to the
            left, a unit vector.
        obstacles (K, 4): nearest first, centre forward and to the left; radius; distance
            from the surface. Rows of zeros where there are fewer.
        mask (K,): 1 where a row of obstacles is one, 0 where it is padding.

    Raises:
        TypeError: obstacles other than discs.
    """
    if not isinstance(field.obstacles, Discs):
        raise TypeError(f"observations know discs only, not {type(field.obstacles).__name__}")
    look_ahead = 3.0 * limits.longest
    low, high = field.bounds
    speed = float(np.linalg.norm(state.derivative))
    forward = state.derivative / speed if speed > 0.0 else np.array([1.0, 0.0])
    turn = np.array([forward, [-forward[1], forward[0]]])

    place = 2.0 * (state.position - low) / (high - low) - 1.0
    left = 1.0 - state.segments / limits.segments
    to_goal = field.goal - state.position
    distance = float(np.linalg.norm(to_goal))
    bearing = turn @ to_goal / distance if distance > 0.0 else np.array([1.0, 0.0])

    rows, mask = np.zeros((nearest, COLUMNS)), np.zeros(nearest)
    if len(field.obstacles):
        clear = field.obstacles.signed_distance(state.position)
        order = np.argsort(clear, kind="stable")[:nearest]
        offset = (field.obstacles.centers[order] - state.position) @ turn.T
        count = len(order)
        rows[:count, :2] = offset / look_ahead
        rows[:count, 2] = field.obstacles.radii[order] / look_ahead
        rows[:count, 3] = clear[order] / look_ahead
        mask[:count] = 1.0
    return {
        "vehicle": _single(np.array([*place, *forward, speed / STEEPEST, left])),
        "goal": _single(np.array([distance / np.linalg.norm(high - low), *bearing])),
        "obstacles": _single(rows),
        "mask": _single(mask),
    }


def _single(values: Array) -> NDArray[np.float32]:
    return np.clip(values, -1.0, 1.0).astype(np.float32)
