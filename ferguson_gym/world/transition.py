"""One step of a flight: from a state and an action to the next state and its outcome."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.curves.certified_kernels import Scratch
from ferguson_gym.curves.nearest_point import Rows
from ferguson_gym.runtime.arrays import Array, finite
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.world.actions import check_actions, decode, decode_into, encode, encode_into
from ferguson_gym.world.feasibility import (
    FieldValues,
    Inspection,
    PlainValues,
    as_values,
    field_values,
    inspect,
    inspect_segment,
    scratch_for,
)
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LONGEST
from ferguson_gym.world.obstacles import MANY
from ferguson_gym.world.outcome import Outcome


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """State of a vehicle; not always the end of its last segment: a caller may set another."""

    position: Array
    """(2,) [m]."""
    derivative: Array
    """(2,) [m per unit t], the start derivative of the next segment."""
    segments: int = 0
    """Segments flown so far."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Step:
    """Result of one action."""

    control: Array
    """The segment (4, 2) that the action encodes."""
    inspection: Inspection
    """Its certified properties."""
    state: State
    """The state after it; the state before it if the segment is not feasible."""
    outcome: Outcome
    """FLYING while the flight goes on."""

    @property
    def flown(self) -> bool:
        """Whether the segment was feasible and therefore flown; other segments are refused."""
        return self.outcome in FLOWN


FLOWN = (Outcome.FLYING, Outcome.GOAL_REACHED, Outcome.OUT_OF_SEGMENTS)
"""Outcomes of segments that were flown."""


def initial_state(field: Field) -> State:
    """The state at the start of a field.

    Raises:
        ValueError: the field is not planar (actions are planar).
    """
    if len(field.start) != 2:
        raise ValueError(
            f"flights are planar, field {field.name} has {len(field.start)} dimensions"
        )
    return State(field.start, field.departure)


def advance(field: Field, state: State, action: ArrayLike) -> Step:
    """Fly one action from a state: decode, snap to the goal, certify.

    Raises:
        ValueError: an action of another shape, not finite or outside [-1, 1].

    Example:
        >>> from ferguson_gym.world.field_names import get_field
        >>> field = get_field("sparse/train:0")
        >>> step = advance(field, initial_state(field), np.zeros(4))  # 9 m straight ahead
        >>> step.outcome.sentence, step.state.position.round(3).tolist()
        ('still on its way', [6.364, 6.364])
    """
    limits = field.limits
    control = decode(action, state.position, state.derivative, field.goal, limits.gate, limits.unit)
    found = inspect(control, field)
    return _step(field, state, control, found, found.outcome(field.limits))


def advance_all(field: Field, states: Sequence[State], actions: ArrayLike) -> list[Step]:
    """`advance` for n states and actions (n, 4) in one field in a single call, which is faster.

    Raises:
        ValueError: actions of another shape, not finite or outside [-1, 1].
    """
    given = check_actions(actions, len(states))
    control = np.empty((len(states), 4, 2))
    gate, unit = field.limits.gate, field.limits.unit
    for one, action, state in zip(control, given, states, strict=True):
        decode_into(one, action, state.position, state.derivative, field.goal, gate, unit)
    found = inspect(control, field)
    columns = (found.length, found.clearance, found.bounds_margin, found.speed)
    steps = []
    for state, one, *values in zip(states, control, *columns, strict=True):
        certified = _inspection(*values)
        steps.append(_step(field, state, one, certified, certified.outcome(field.limits)))
    return steps


def _inspection(length: Any, clearance: Any, margin: Any, speed: Any) -> Inspection:
    return Inspection(length=length, clearance=clearance, bounds_margin=margin, speed=speed)


def _step(
    field: Field, state: State, control: Array, inspection: Inspection, outcome: Outcome
) -> Step:
    """The step along a segment (4, 2) with these certified properties, which say its outcome."""
    if outcome is Outcome.FLYING:
        state = State(control[1], control[3], state.segments + 1)
        if (control[1] == field.goal).all():
            outcome = Outcome.GOAL_REACHED
        elif state.segments >= field.limits.segments:
            outcome = Outcome.OUT_OF_SEGMENTS
    return Step(control=control, inspection=inspection, state=state, outcome=outcome)


INEXPRESSIBLE = -1
"""Result of `fly_into` for a segment that no action expresses."""
_OUTCOMES = {outcome.code: outcome for outcome in Outcome}


@compiled
def fly_into(
    control: Array,
    segment: Array,
    position: Array,
    derivative: Array,
    values: FieldValues,
    found: Array,
    scratch: Scratch,
) -> int:
    """`fly_segment` for compiled functions, without its checks.

    Args:
        control: (4, 2), filled with the segment as flown.
        segment: (4, 2) to be flown.
        position: (2,) of the vehicle [m].
        derivative: (2,) of the vehicle [m per unit t].
        values: of the field.
        found: (4,), filled with what `inspect_segment` finds.
        scratch: memory, as of `ferguson_gym.world.feasibility.scratch_for`.

    Returns:
        The code of FLYING, also where the flight ends, or of the first failure; INEXPRESSIBLE if
        no action expresses the segment.
    """
    limits = values.limits
    unit, action = limits.longest / PAPER_LONGEST, np.empty(4, np.float32)
    if not encode_into(action, segment, position, derivative, unit):
        return INEXPRESSIBLE
    decode_into(control, action, position, derivative, values.goal, limits.gate, unit)
    return inspect_segment(control, values, found, scratch)


@compiled
def _fly(
    segment: Array, position: Array, derivative: Array, plain: PlainValues, axes: Rows
) -> tuple[int, Array, Array]:
    """As `fly_into`: the code, the segment as flown, and what is found about it."""
    values = as_values(plain)
    control, found = np.empty((4, 2)), np.empty(4)
    scratch = scratch_for(values, axes)
    code = fly_into(control, segment, position, derivative, values, found, scratch)
    return code, control, found


def fly_segment(field: Field, state: State, segment: ArrayLike) -> Step:
    """Fly to the end of a segment through its action, which is rounded to float32.

    Planners commit to segments through this function, so that a planned flight and the same
    flight in the environment are equal bit for bit.

    Raises:
        ValueError: no action expresses the segment.
    """
    control = finite("segment", segment, (4, 2))
    # copies, since a field's start is read-only, which kernels would be compiled for once more
    position, derivative = np.array(state.position), np.array(state.derivative)
    if len(field.obstacles) > MANY:  # looked up by coordinates
        return advance(field, state, encode(control, position, derivative, field.limits.unit))
    code, flown, found = _fly(control, position, derivative, field_values(field), (0, 1))
    if code == INEXPRESSIBLE:
        encode(control, position, derivative, field.limits.unit)  # says why
    return _step(field, state, flown, _inspection(*found), _OUTCOMES[code])
