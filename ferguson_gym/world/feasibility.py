"""Feasibility of segments, certified along their whole length, for all of the project.

`inspect` certifies arrays of segments, and `is_feasible` tells which of them keep the limits. For
compiled functions there are `first_failure`, the same test of one segment, `segment_is_feasible`
and `inspect_segment`. A minimum turn radius is not part of it: see
`ferguson_gym.world.turn_radius`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.curves.arc_length import length, segment_length
from ferguson_gym.curves.certified_kernels import (
    Scratch,
    bounds_margins,
    make_scratch,
    segment_bounds_margin,
    segment_speed,
)
from ferguson_gym.curves.clearance import least_speed
from ferguson_gym.curves.convex_core import Cores, most_corners
from ferguson_gym.curves.nearest_point import Rows
from ferguson_gym.curves.obstacle_kernels import segment_clearance
from ferguson_gym.curves.splines import as_control
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits, LimitValues
from ferguson_gym.world.obstacles import MANY
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


class FieldValues(NamedTuple):
    """What decides in a field whether a segment is feasible, for compiled functions."""

    goal: Array
    """(D,) [m]."""
    bounds: Array
    """(2, D) [m]."""
    columns: Array
    """(D, n) centres of the balls that bound the obstacles [m]."""
    radii: Array
    """(n,) of the balls [m]."""
    cores: Cores
    """Of the obstacles."""
    limits: LimitValues


PlainValues = tuple[Array, Array, Array, Array, tuple[Any, ...], tuple[Any, ...]]
"""`FieldValues` as plain tuples, which are passed to compiled functions in a quarter of the time;
there, `as_values` names them."""


@lru_cache(maxsize=8)
def field_values(field: Field) -> PlainValues:
    """The values of a field, cached for the last fields (by identity)."""
    centers, radii = field.obstacles.balls
    columns, cores = np.array(centers.T, order="C"), field.obstacles.cores
    limits = tuple(field.limits.numbers())
    return field.goal.copy(), field.bounds.copy(), columns, radii.copy(), tuple(cores), limits


@compiled
def as_values(plain: PlainValues) -> FieldValues:
    """The values that plain tuples hold."""
    goal, bounds, columns, radii, (corners, first, grown), limits = plain
    shortest, longest, slowest, gate, tolerance, segments = limits
    named = LimitValues(shortest, longest, slowest, gate, tolerance, segments)
    return FieldValues(goal, bounds, columns, radii, Cores(corners, first, grown), named)


@compiled
def scratch_for(values: FieldValues, axes: Rows) -> Scratch:
    """Scratch memory for segments in a field; axes are (0, ..., D - 1)."""
    return make_scratch(axes, len(values.radii), most_corners(values.cores))


@compiled
def segment_is_feasible(
    control: Array, values: FieldValues, tolerance: float, scratch: Scratch
) -> bool:
    """Whether one segment (4, D) is feasible up to a tolerance [m]."""
    limits = values.limits
    allowed = LimitValues(
        limits.shortest, limits.longest, limits.slowest, limits.gate, tolerance, limits.segments
    )
    # obstacles farther than 0 m do not matter
    outcome, _, _ = first_failure(
        control, values.bounds, values.columns, values.radii, values.cores, allowed, 0.0, scratch
    )
    return outcome == FLYING


@compiled
def _are_feasible(
    control: Array, plain: PlainValues, tolerance: float, axes: Rows
) -> NDArray[np.bool_]:
    """Whether segments (n, 4, D) are feasible: (n,)."""
    values = as_values(plain)
    feasible, scratch = np.empty(len(control), np.bool_), scratch_for(values, axes)
    for s in range(len(control)):
        feasible[s] = segment_is_feasible(control[s], values, tolerance, scratch)
    return feasible


@compiled
def inspect_segment(control: Array, values: FieldValues, found: Array, scratch: Scratch) -> int:
    """Inspect one segment (4, D); return the code of FLYING or of the first failure.

    Args:
        control: (4, D) segment.
        values: of the field.
        found: (4,), filled with length, clearance, bounds margin and speed, as in `Inspection`.
        scratch: memory, as of `scratch_for`.
    """
    speed, _ = segment_speed(control, np.inf, scratch)
    length = segment_length(control, scratch.pieces, scratch.widths, scratch.speed2, scratch.axes)
    margin = segment_bounds_margin(control, values.bounds, np.inf)
    columns, radii, cores = values.columns, values.radii, values.cores
    clearance = segment_clearance(control, columns, radii, cores, np.inf, scratch)
    found[0], found[1], found[2], found[3] = length, clearance, margin, speed
    limits = values.limits
    slack = -limits.tolerance
    if not speed - limits.slowest >= slack:
        return NOT_REGULAR
    if not length - limits.shortest >= slack:
        return TOO_SHORT
    if not limits.longest - length >= slack:
        return TOO_LONG
    if not margin >= slack:
        return LEFT_BOUNDS
    return FLYING if clearance >= slack else COLLISION


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
    control = _in_dimensions_of(field, control)
    flat = np.ascontiguousarray(control.reshape(-1, *control.shape[-2:]))
    speed, _ = least_speed(control)
    return Inspection(
        length=length(control),
        clearance=field.obstacles.clearance(control),
        bounds_margin=bounds_margins(flat, field.bounds).reshape(control.shape[:-2]),
        speed=speed,
    )


def _in_dimensions_of(field: Field, control: ArrayLike) -> Array:
    control = as_control(control)
    if control.shape[-1] != len(field.start):
        raise ValueError(
            f"field {field.name} has {len(field.start)} dimensions, "
            f"the control array {control.shape[-1]}"
        )
    return control


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
    control = _in_dimensions_of(field, control)
    if len(field.obstacles) > MANY:  # looked up by coordinates
        return np.asarray((inspect(control, field).slack(field.limits) >= -allowed).all(axis=-1))
    flat, axes = control.reshape(-1, *control.shape[-2:]), tuple(range(control.shape[-1]))
    return _are_feasible(flat, field_values(field), allowed, axes).reshape(control.shape[:-2])
