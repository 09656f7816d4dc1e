"""One step of a flight: from a state and an action to the next state and its outcome."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.runtime.arrays import Array, finite
from ferguson_gym.world.actions import check_actions, decode, decode_into, encode
from ferguson_gym.world.feasibility import Inspection, inspect
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS, Limits
from ferguson_gym.world.outcome import Outcome


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Where the vehicle is. Kept apart from an action's end: a disturbance can come between."""

    position: Array
    """(2,) [m]."""
    derivative: Array
    """(2,) [m per unit t]; the next segment leaves with it."""
    segments: int = 0
    """Segments flown so far."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Step:
    """What one action did."""

    control: Array
    """The segment (4, 2) that the action meant."""
    inspection: Inspection
    """What certification found along it."""
    state: State
    """The state after it; the state before it if the segment is not feasible."""
    outcome: Outcome
    """FLYING while the flight goes on."""

    @property
    def flown(self) -> bool:
        """Whether the segment was feasible; a segment that is not is refused."""
        return self.outcome in FLOWN


FLOWN = (Outcome.FLYING, Outcome.GOAL_REACHED, Outcome.OUT_OF_SEGMENTS)
"""Outcomes of segments that were flown."""


class Follow(Protocol):
    """How a vehicle flies a segment that was planned."""

    def __call__(self, field: Field, state: State, segment: ArrayLike, limits: Limits) -> Step:
        """Fly to the end of a segment (4, 2) from a state; refuse it if it is not feasible."""


def initial_state(field: Field) -> State:
    """The state at the start of a field.

    Raises:
        ValueError: a field that is not planar; actions are.
    """
    if len(field.start) != 2:
        raise ValueError(
            f"flights are planar, field {field.name} has {len(field.start)} dimensions"
        )
    return State(field.start, field.departure)


def advance(field: Field, state: State, action: ArrayLike, limits: Limits = PAPER_LIMITS) -> Step:
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
    control = decode(action, state.position, state.derivative, field.goal, limits.gate)
    return _step(field, state, control, inspect(control, field), limits)


def advance_all(
    field: Field, states: Sequence[State], actions: ArrayLike, limits: Limits = PAPER_LIMITS
) -> list[Step]:
    """As `advance`, from n states in one field at once, which takes less time.

    Args:
        field: that all of them fly.
        states: n.
        actions: (n, 4) in [-1, 1].
        limits: of their segments.

    Raises:
        ValueError: actions of another shape, not finite or outside [-1, 1].
    """
    given = check_actions(actions, len(states))
    control = np.empty((len(states), 4, 2))
    for one, action, state in zip(control, given, states, strict=True):
        decode_into(one, action, state.position, state.derivative, field.goal, limits.gate)
    found = inspect(control, field)
    columns = (found.length, found.clearance, found.room, found.speed)
    return [
        _step(
            field,
            state,
            one,
            Inspection(length=length, clearance=clearance, room=room, speed=speed),
            limits,
        )
        for state, one, length, clearance, room, speed in zip(
            states, control, *columns, strict=True
        )
    ]


def _step(
    field: Field, state: State, control: Array, inspection: Inspection, limits: Limits
) -> Step:
    """The step that a segment (4, 2) is, after what certification found along it."""
    outcome = inspection.outcome(limits)
    if outcome is Outcome.FLYING:
        state = State(control[1], control[3], state.segments + 1)
        if np.array_equal(control[1], field.goal):
            outcome = Outcome.GOAL_REACHED
        elif state.segments >= limits.segments:
            outcome = Outcome.OUT_OF_SEGMENTS
    return Step(control=control, inspection=inspection, state=state, outcome=outcome)


def fly_segment(
    field: Field, state: State, segment: ArrayLike, limits: Limits = PAPER_LIMITS
) -> Step:
    """Fly to the end of a segment as an action does it, rounded to float32.

    Planners commit to segments through this function, so that a planned flight and the
    same flight in the environment are equal bit for bit.

    Raises:
        ValueError: no action expresses the segment.
    """
    action = encode(segment, state.position, state.derivative)
    return advance(field, state, action, limits)


def follow_exactly(
    field: Field, state: State, segment: ArrayLike, limits: Limits = PAPER_LIMITS
) -> Step:
    """Fly to the end of a segment as it is: what `follow` does, but for rounding to an action.

    For limits whose segments no action reaches. The environment does not fly them; they are
    snapped to the goal and certified as all others.
    """
    control = finite("segment", segment, (4, 2)).copy()
    control[0], control[2] = state.position, state.derivative
    if np.linalg.norm(control[1] - field.goal) <= limits.gate:
        control[1] = field.goal
    return _step(field, state, control, inspect(control, field), limits)
