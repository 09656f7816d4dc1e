"""One step of a flight: from a state and an action to the next state and its outcome."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.actions import check_actions, decode, decode_into, encode
from ferguson_gym.world.feasibility import Inspection, inspect
from ferguson_gym.world.field import Field
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
    return _step(field, state, control, inspect(control, field))


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
    return [
        _step(
            field,
            state,
            one,
            Inspection(length=length, clearance=clearance, bounds_margin=margin, speed=speed),
        )
        for state, one, length, clearance, margin, speed in zip(
            states, control, *columns, strict=True
        )
    ]


def _step(field: Field, state: State, control: Array, inspection: Inspection) -> Step:
    """The step along a segment (4, 2) with these certified properties."""
    outcome = inspection.outcome(field.limits)
    if outcome is Outcome.FLYING:
        state = State(control[1], control[3], state.segments + 1)
        if np.array_equal(control[1], field.goal):
            outcome = Outcome.GOAL_REACHED
        elif state.segments >= field.limits.segments:
            outcome = Outcome.OUT_OF_SEGMENTS
    return Step(control=control, inspection=inspection, state=state, outcome=outcome)


def fly_segment(field: Field, state: State, segment: ArrayLike) -> Step:
    """Fly to the end of a segment through its action, which is rounded to float32.

    Planners commit to segments through this function, so that a planned flight and the same
    flight in the environment are equal bit for bit.

    Raises:
        ValueError: no action expresses the segment.
    """
    action = encode(segment, state.position, state.derivative, field.limits.unit)
    return advance(field, state, action)
