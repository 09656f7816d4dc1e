"""The arrays that a step of N vehicles reads and writes, allocated in one place.

To add an array, add an attribute to `StepBuffers` and allocate it in `make_buffers`.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.simulation.field_store import FieldArrays
from ferguson_gym.simulation.observations import FlatObservation, Layout
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.world.actions import Action

Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]
Records = NDArray[np.void]

DISABLED, NEXT_STEP, SAME_STEP = 0, 1, 2
"""Autoreset modes: a flight that ends is not reset; reset by the next step; reset at once."""

RULES = np.dtype(
    [
        ("gate", np.float64),
        ("most", np.int64),
        ("detour", np.float64),
        ("failure", np.float64),
    ]
)
"""How a flight is judged: gate [m] and maximum number of segments, NaN and 0 for those of the
field, and penalties in the reward for length beyond progress and for an end anywhere but on the
goal."""

FLIGHT = np.dtype(
    [
        ("slot", np.int64),
        ("position", np.float64, 2),
        ("derivative", np.float64, 2),
        ("segments", np.int64),
        ("outcome", np.int64),
        ("path_length", np.float64),
        ("clearance", np.float64),
        ("next", np.int64),
        *RULES.descr,
    ]
)
"""A vehicle: the slot of its field, position [m], derivative [m per unit t], segments flown,
code of the outcome, length flown and least clearance so far [m], the index in its queue of the
field that it flies next, and the rules of this flight."""

REPORT = np.dtype(
    [
        ("reward", np.float64),
        ("terminated", np.bool_),
        ("truncated", np.bool_),
        ("is_success", np.bool_),
        ("outcome", np.int64),
        ("path_length", np.float64),
        ("clearance", np.float64),
        ("segments", np.int64),
        ("shortest", np.float64),
    ]
)
"""What a step returns beside the observation; the last six are infos, of which the compiled step
leaves the last one alone."""


class StepBuffers(NamedTuple):
    """Everything that a step of N vehicles reads, and where it writes its results.

    Records and few arrays, since compilation time grows with their number. Named tuples come
    first; see `as_buffers`.
    """

    fields: FieldArrays
    layout: Layout
    mode: int
    """DISABLED, NEXT_STEP or SAME_STEP."""
    flights: Records
    """(N,) of FLIGHT; changed by each step."""
    rules: Records
    """(N,) of RULES, for flights that start; those under way keep theirs."""
    paths: Array
    """(N, S, 4, 2) segments flown, then the last one that was refused."""
    queue: Integers
    """(N, B) slots of the fields that later resets will fly."""
    actions: Action
    """(N, 4) in [-1, 1]."""
    observations: FlatObservation
    """(N n,) after the step, or after the reset in its place; entry after entry."""
    reports: Records
    """(N,) of REPORT; infos, too, are those after a reset."""
    final_observations: FlatObservation
    """SAME_STEP: the last observations of flights that ended."""
    final_reports: Records
    """SAME_STEP: infos of flights that ended, zeros for the others."""


def make_buffers(
    settings: Settings,
    number: int,
    fields: FieldArrays,
    mode: int,
    queue: int = 1,
    longest: int = 0,
) -> StepBuffers:
    """Buffers of so many vehicles, zero throughout but for the rules of their flights.

    Args:
        settings: of the environment.
        number: N.
        fields: where vehicles fly.
        mode: DISABLED, NEXT_STEP or SAME_STEP.
        queue: fields B that each vehicle's queue holds.
        longest: segments for which there is room, if more than those of the settings.
    """
    layout, rules = settings.layout, np.zeros(number, RULES)
    write_rules(rules, settings)
    values, ended = sum(layout.entries().values()), number if mode == SAME_STEP else 0
    return StepBuffers(
        fields=fields,
        layout=layout,
        mode=mode,
        flights=np.zeros(number, FLIGHT),
        rules=rules,
        paths=np.zeros((number, max(longest, settings.max_segments) + 1, 4, 2)),
        queue=np.zeros((number, queue), np.int64),
        actions=np.zeros((number, 4), np.float32),
        observations=np.zeros(number * values, np.float32),
        reports=np.zeros(number, REPORT),
        final_observations=np.zeros(ended * values, np.float32),
        final_reports=np.zeros(ended, REPORT),
    )


def write_rules(rules: Records, settings: Settings) -> None:
    """Write the rules that some settings make into records of RULES."""
    rules["gate"] = np.nan if settings.gate is None else settings.gate
    rules["most"] = settings.segments or 0
    rules["detour"], rules["failure"] = settings.detour, settings.failure


PlainTuple: TypeAlias = tuple[Any, ...]
"""Step buffers as `as_plain_tuple` makes them."""


def as_plain_tuple(buffers: Any) -> PlainTuple:
    """Buffers as tuples without names: compiled code is called with them in a third of the time."""
    return tuple(as_plain_tuple(part) if isinstance(part, tuple) else part for part in buffers)


@compiled
def as_buffers(given: PlainTuple) -> StepBuffers:
    """The inverse of `as_plain_tuple`, in compiled code."""
    return StepBuffers(
        FieldArrays(*given[0]),
        Layout(*given[1]),
        *given[2:],
    )
