"""Whether a segment may be flown: the one test that environment, planners and evaluation use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.arc_length import length
from ferguson_gym.arrays import Array
from ferguson_gym.clearance import least_speed
from ferguson_gym.fields import Field
from ferguson_gym.limits import PAPER_LIMITS, Limits
from ferguson_gym.outcome import Outcome
from ferguson_gym.splines import as_control, extent


@dataclass(frozen=True, slots=True, kw_only=True)
class Inspection:
    """What certification found along whole segments; every array has their batch shape."""

    length: Array
    """Arc length [m]."""
    clearance: Array
    """Least clearance from all obstacles [m]; infinite without obstacles."""
    room: Array
    """Least distance inside the field's bounds [m]; negative outside."""
    speed: Array
    """Least |X'(t)| [m per unit t]."""

    def slack(self, limits: Limits) -> Array:
        """By how much each test is passed [m]: (*batch, 5), feasible where >= -tolerance.

        In the order in which a failure is named: regular, long enough, short enough,
        inside the bounds, clear of obstacles.
        """
        return np.stack(
            [
                self.speed - limits.slowest,
                self.length - limits.shortest,
                limits.longest - self.length,
                self.room,
                self.clearance,
            ],
            axis=-1,
        )

    def outcome(self, limits: Limits = PAPER_LIMITS) -> Outcome:
        """FLYING if the (single) segment is feasible, else why it is not."""
        failed = np.flatnonzero(~(self.slack(limits) >= -limits.tolerance))
        return _FAILURES[failed[0]] if len(failed) else Outcome.FLYING


_ROUNDING = 1e-13
"""Outward margin of `room`, part of the largest number in the control array."""

_FAILURES = (
    Outcome.NOT_REGULAR,
    Outcome.TOO_SHORT,
    Outcome.TOO_LONG,
    Outcome.LEFT_BOUNDS,
    Outcome.COLLISION,
)


def inspect(control: ArrayLike, field: Field) -> Inspection:
    """Certify segments (*batch, 4, D) in a field, along their whole length.

    Raises:
        ValueError: a control array of the wrong shape or not finite.
    """
    control = as_control(control)
    if control.shape[-1] != len(field.start):
        raise ValueError(
            f"field {field.name} has {len(field.start)} dimensions, "
            f"the control array {control.shape[-1]}"
        )
    low, high = extent(control)
    room = np.minimum(low - field.bounds[0], field.bounds[1] - high).min(axis=-1)
    room = room - _ROUNDING * np.abs(control).max(axis=(-2, -1))
    speed, _ = least_speed(control)
    return Inspection(
        length=length(control),
        clearance=field.obstacles.clearance(control),
        room=room,
        speed=speed,
    )


def is_feasible(
    control: ArrayLike,
    field: Field,
    limits: Limits = PAPER_LIMITS,
    tolerance: float | None = None,
) -> NDArray[np.bool_]:
    """Whether each segment is feasible: (*batch,) of bool.

    Args:
        control: (*batch, 4, D) segments.
        field: where they are flown.
        limits: what a segment may be.
        tolerance: instead of the limits' own [m]; planners aim for less.
    """
    allowed = limits.tolerance if tolerance is None else tolerance
    return np.asarray((inspect(control, field).slack(limits) >= -allowed).all(axis=-1))
