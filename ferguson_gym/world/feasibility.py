"""Feasibility of segments, certified along their whole length, for all of the project.

`inspect` certifies arrays of segments, and `is_feasible` compares the result with the limits.
`first_failure` is the same test of one segment, compiled for the environment. A minimum turn radius
is not part of it: see `ferguson_gym.world.turn_radius`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.curves.arc_length import length, segment_length
from ferguson_gym.curves.certified_kernels import (
    Scratch,
    bounds_margins,
    segment_bounds_margin,
    segment_speed,
)
from ferguson_gym.curves.clearance import least_speed
from ferguson_gym.curves.convex_core import Cores
from ferguson_gym.curves.obstacle_kernels import segment_clearance
from ferguson_gym.curves.splines import as_control
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled_in_place
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits, LimitValues
from ferguson_gym.world.outcome import Outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class Inspection:
    """Certified properties of whole segments; every array has their batch shape."""

    length: Array
    """Arc length [m]."""
    clearance: Array
    """Least clearance from all obstacles [m]; infinite without obstacles."""
    bounds_margin: Array
    """Least distance inside the field's bounds [m]; negative outside."""
    speed: Array
    """Least |X'(t)| [m per unit t]."""

    def slack(self, limits: Limits) -> Array:
        """Slack of each test [m]: (*batch, 5), feasible where all are >= -tolerance.

        Tests come in the order in which the first failure is reported: regular, long enough,
        short enough, inside the bounds, clear of obstacles.
        """
        return np.stack(
            [
                self.speed - limits.slowest,
                self.length - limits.shortest,
                limits.longest - self.length,
                self.bounds_margin,
                self.clearance,
            ],
            axis=-1,
        )

    def outcome(self, limits: Limits) -> Outcome:
        """FLYING if the (single) segment is feasible, otherwise its first failure."""
        failed = np.flatnonzero(~(self.slack(limits) >= -limits.tolerance))
        return _FAILURES[failed[0]] if len(failed) else Outcome.FLYING


FLYING, NOT_REGULAR, TOO_SHORT, TOO_LONG, LEFT_BOUNDS, COLLISION = (
    outcome.code
    for outcome in (
        Outcome.FLYING,
        Outcome.NOT_REGULAR,
        Outcome.TOO_SHORT,
        Outcome.TOO_LONG,
        Outcome.LEFT_BOUNDS,
        Outcome.COLLISION,
    )
)
"""Codes, for compiled functions."""

_FAILURES = (
    Outcome.NOT_REGULAR,
    Outcome.TOO_SHORT,
    Outcome.TOO_LONG,
    Outcome.LEFT_BOUNDS,
    Outcome.COLLISION,
)


@compiled_in_place
def first_failure(
    control: Array,
    bounds: Array,
    columns: Array,
    radii: Array,
    cores: Cores,
    limits: LimitValues,
    cutoff: float,
    scratch: Scratch,
) -> tuple[int, float, float]:
    """Feasibility of one segment, as `Inspection.outcome` decides it.

    Args:
        control: (4, D) segment.
        bounds: (2, D) of the field.
        columns: (D, n) centres of the balls that bound the obstacles.
        radii: (n,) of the balls.
        cores: of the obstacles, as `Cores` says.
        limits: of the flight.
        cutoff: the search ignores obstacles farther than this; see the result.
        scratch: memory, for n obstacles or more.

    Returns:
        The code of FLYING or of the first failure; length [m]; clearance [m], or `cutoff` if
        that is less. Length and clearance are zero for a segment that is not feasible.
    """
    slack = limits.tolerance
    # `not ... >=`, so that NaN fails every test
    if not segment_speed(control, limits.slowest, scratch)[0] - limits.slowest >= -slack:
        return NOT_REGULAR, 0.0, 0.0
    length = segment_length(control, scratch.pieces, scratch.widths, scratch.speed2, scratch.axes)
    if not length - limits.shortest >= -slack:
        return TOO_SHORT, 0.0, 0.0
    if not limits.longest - length >= -slack:
        return TOO_LONG, 0.0, 0.0
    if not segment_bounds_margin(control, bounds, -slack) >= -slack:
        return LEFT_BOUNDS, 0.0, 0.0
    clearance = segment_clearance(control, columns, radii, cores, cutoff, scratch)
    if not clearance >= -slack:
        return COLLISION, 0.0, 0.0
    return FLYING, length, clearance


def inspect(control: ArrayLike, field: Field) -> Inspection:
    """Certify segments (*batch, 4, D) in a field, along their whole length.

    Raises:
        ValueError: a control array of the wrong shape or not finite.

    Example:
        >>> from ferguson_gym.world.field_names import get_field
        >>> field = get_field("paper:2")
        >>> found = inspect([[0, 0], [9, 3], [9, 0], [9, 6]], field)
        >>> found.outcome(field.limits).sentence
        'still on its way'
    """
    control = as_control(control)
    if control.shape[-1] != len(field.start):
        raise ValueError(
            f"field {field.name} has {len(field.start)} dimensions, "
            f"the control array {control.shape[-1]}"
        )
    flat = np.ascontiguousarray(control.reshape(-1, *control.shape[-2:]))
    speed, _ = least_speed(control)
    return Inspection(
        length=length(control),
        clearance=field.obstacles.clearance(control),
        bounds_margin=bounds_margins(flat, field.bounds).reshape(control.shape[:-2]),
        speed=speed,
    )


def is_feasible(
    control: ArrayLike,
    field: Field,
    tolerance: float | None = None,
) -> NDArray[np.bool_]:
    """Whether each segment is feasible: (*batch,) of bool.

    Args:
        control: (*batch, 4, D) segments.
        field: where they are flown, with the limits of segments.
        tolerance: [m], instead of that of the limits; planners use a smaller one.

    Example:
        >>> from ferguson_gym.world.field_names import get_field
        >>> bend, long = [[0, 0], [9, 3], [9, 0], [9, 6]], [[0, 0], [20, 0], [20, 0], [20, 0]]
        >>> is_feasible([bend, long], get_field("paper:2")).tolist()
        [True, False]
    """
    allowed = field.limits.tolerance if tolerance is None else tolerance
    return np.asarray((inspect(control, field).slack(field.limits) >= -allowed).all(axis=-1))
