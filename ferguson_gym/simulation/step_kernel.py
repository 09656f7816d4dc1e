"""The batched core: flights of many vehicles, each through its own field, compiled.

The scalar environment is its batch of one, the vector environment drives it as a whole.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.certified_kernels import Scratch, borrowed_scratch, make_scratch
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.helper_threads import CLAIMED, DONE, Counters, add, get, put
from ferguson_gym.runtime.jit import (
    compiled,
    compiled_in_place,
    compiled_without_lock,
    prefetch,
    unowned,
)
from ferguson_gym.simulation.field_store import FieldArrays
from ferguson_gym.simulation.observations import Layout, Single, write_observation
from ferguson_gym.simulation.reward import Prices, gain
from ferguson_gym.world.actions import Action, decode_into
from ferguson_gym.world.feasibility import FLYING, first_failure
from ferguson_gym.world.limits import LimitValues
from ferguson_gym.world.outcome import Outcome

Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]
Records = NDArray[np.void]

GOAL_REACHED, OUT_OF_SEGMENTS = Outcome.GOAL_REACHED.code, Outcome.OUT_OF_SEGMENTS.code

DISABLED, NEXT_STEP, SAME_STEP = 0, 1, 2
"""What happens when a flight ends: nothing; reset in place of the next step; reset at once."""

CHUNK = 8
"""Vehicles that one thread takes at a time."""
FROM_FRONT, FROM_BACK = 1, 2**32
"""What a thread adds to the counter of claimed chunks: two threads come from two sides, so that
each has mostly the vehicles that it had in the last step, and what they need near at hand."""
LINE = 64
"""Bytes of memory that come at once."""


INFOS = ("is_success", "outcome", "path_length", "clearance", "segments")
"""Keys of `info`."""

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
    ]
)
"""A vehicle: the slot of its field, position [m], derivative [m per unit t], segments flown,
code of the outcome, length flown and least clearance so far [m], and which of its queue of
later fields comes next."""

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
    ]
)
"""What a step returns beside the observation; the last five are infos."""


class StepBuffers(NamedTuple):
    """Everything that a step of N vehicles needs, and where its results go.

    Records and few arrays: the compiler's time grows with their number.
    """

    flights: Records
    """(N,) of FLIGHT; changed by each step."""
    paths: Array
    """(N, segments + 1, 4, 2) segments flown, then the last one asked for."""
    queue: Integers
    """(N, B) slots of the fields that later resets will fly."""
    world: FieldArrays
    actions: Action
    """(N, 4) in [-1, 1]."""
    limits: LimitValues
    prices: Prices
    layout: Layout
    mode: int
    """DISABLED, NEXT_STEP or SAME_STEP."""
    seen: Single
    """(N n,) observations after the step, or after the reset that it became; entry after entry."""
    reports: Records
    """(N,) of REPORT; infos, too, are of after a reset."""
    last_seen: Single
    """SAME_STEP: what was seen last, for flights that ended."""
    last_reports: Records
    """SAME_STEP: infos of flights that ended."""


Bare: TypeAlias = tuple[Any, ...]
"""A job, as `bare` makes it."""


@compiled_in_place
def _begin(job: StepBuffers, i: int) -> None:
    flight, world = job.flights[i], job.world
    place = world.places[flight.slot]
    flight.segments, flight.outcome, flight.path_length = 0, FLYING, 0.0
    flight.clearance = place.clearance
    for d in range(2):
        flight.position[d] = place.start[d]
        flight.derivative[d] = place.departure[d]


@compiled
def _distance(position: Array, goal: Array) -> float:
    x, y = goal[0] - position[0], goal[1] - position[1]
    return float(np.sqrt(x * x + y * y))


@compiled_in_place
def _fly(job: StepBuffers, i: int, scratch: Scratch) -> float:
    """Fly one action; returns the reward."""
    flight, world, limits = job.flights[i], job.world, job.limits
    slot = flight.slot
    place = world.places[slot]
    goal, position = place.goal, flight.position
    control = job.paths[i, flight.segments]
    decode_into(control, job.actions[i], position, flight.derivative, goal, limits.gate)
    outcome, length, clearance = first_failure(
        control,
        place.bounds,
        world.discs[slot, :2],
        world.discs[slot, 2],
        limits,
        flight.clearance,
        scratch,
    )
    reward = 0.0
    if outcome == FLYING:
        before = _distance(position, goal)
        for d in range(2):
            position[d], flight.derivative[d] = control[1, d], control[3, d]
        flight.segments += 1
        flight.path_length += length
        flight.clearance = clearance
        reward = gain(before, _distance(position, goal), length, place.distance, job.prices)
        if control[1, 0] == goal[0] and control[1, 1] == goal[1]:
            outcome = GOAL_REACHED
        elif flight.segments >= limits.segments:
            outcome = OUT_OF_SEGMENTS
    flight.outcome = outcome
    if outcome not in (FLYING, GOAL_REACHED):
        reward -= job.prices.failure
    return reward


@compiled_in_place
def _observe(
    job: StepBuffers, i: int, seen: Single, report: Any, work: Array, found: Integers
) -> None:
    """Write what a vehicle sees, and its infos."""
    flight, world = job.flights[i], job.world
    slot = flight.slot
    place = world.places[slot]
    write_observation(
        seen,
        i,
        len(job.flights),
        job.layout,
        flight.position,
        flight.derivative,
        1.0 - flight.segments / job.limits.segments,
        place.goal,
        place.bounds,
        world.discs[slot, :2],
        world.discs[slot, 2],
        work,
        found,
    )
    report.is_success = flight.outcome == GOAL_REACHED
    report.outcome = flight.outcome
    report.path_length = flight.path_length
    report.clearance = flight.clearance
    report.segments = flight.segments


@compiled_in_place
def _advance(job: StepBuffers, i: int, scratch: Scratch) -> None:
    flight, report = job.flights[i], job.reports[i]
    report.reward = 0.0
    report.terminated = False
    report.truncated = False
    begins = job.mode == NEXT_STEP and flight.outcome != FLYING
    again = False
    if not begins:
        report.reward = _fly(job, i, scratch)
        if flight.outcome != FLYING:
            report.truncated = flight.outcome == OUT_OF_SEGMENTS
            report.terminated = flight.outcome != OUT_OF_SEGMENTS
            again = job.mode == SAME_STEP
    seen, infos = (job.last_seen, job.last_reports[i]) if again else (job.seen, report)
    while True:  # in place, so that what is long is compiled once
        if begins:
            flight.slot = job.queue[i, flight.next]
            flight.next += 1
            _begin(job, i)
        _observe(job, i, seen, infos, scratch.work, scratch.found)
        if not again:
            break
        begins, again = True, False
        seen, infos = job.seen, report


@compiled_in_place
def _fetch(job: StepBuffers, i: int) -> None:
    """Have brought near what a vehicle's step will read: its field, or the next one."""
    flight, world = job.flights[i], job.world
    slot = flight.slot
    if job.mode == NEXT_STEP and flight.outcome != FLYING:
        slot = job.queue[i, flight.next]
    discs = world.discs[slot]
    for byte in range(0, discs.size * discs.itemsize, LINE):
        prefetch(discs, byte)
    place = world.places[slot : slot + 1]
    prefetch(place, 0)
    prefetch(place, LINE)
    prefetch(job.paths[i, flight.segments], 0)


def as_plain_tuple(job: Any) -> Bare:
    """A job as tuples without names: compiled code is called with them in a third of the time."""
    return tuple(as_plain_tuple(part) if isinstance(part, tuple) else part for part in job)


@compiled
def _job(given: Bare) -> StepBuffers:
    return StepBuffers(
        given[0],
        given[1],
        given[2],
        FieldArrays(*given[3]),
        given[4],
        LimitValues(*given[5]),
        Prices(*given[6]),
        Layout(*given[7]),
        given[8],
        given[9],
        given[10],
        given[11],
        given[12],
    )


@compiled
def _unowned(given: Bare) -> StepBuffers:
    job = _job(given)
    world = job.world
    return StepBuffers(
        unowned(job.flights),
        unowned(job.paths),
        unowned(job.queue),
        FieldArrays(unowned(world.places), unowned(world.discs)),
        unowned(job.actions),
        job.limits,
        job.prices,
        Layout(
            job.layout.nearest,
            unowned(job.layout.ways),
            job.layout.focus,
            job.layout.sight,
        ),
        job.mode,
        unowned(job.seen),
        unowned(job.reports),
        unowned(job.last_seen),
        unowned(job.last_reports),
    )


@compiled
def _claimed(counter: int) -> int:
    """Chunks that were claimed, from the front and from the back."""
    return counter % FROM_BACK + counter // FROM_BACK


@compiled_without_lock
def help_out(given: Bare, counters: Counters, claim: int, patience: int) -> None:
    """Step vehicles as long as any are left; return after so many looks in vain.

    Args:
        given: job of all vehicles.
        counters: of its chunks.
        claim: FROM_FRONT or FROM_BACK.
        patience: looks.
    """
    lent = _unowned(given)
    owned = make_scratch((0, 1), lent.world.discs.shape[2])
    scratch = borrowed_scratch(owned)
    number = len(lent.actions)
    chunks = (number + CHUNK - 1) // CHUNK
    idle = 0
    while idle <= patience:
        idle += 1
        if _claimed(get(counters, CLAIMED)) < chunks:
            before = add(counters, CLAIMED, claim)
            if _claimed(before) < chunks:
                front, back = before % FROM_BACK, before // FROM_BACK
                chunk = front if claim == FROM_FRONT else chunks - 1 - back
                last = min((chunk + 1) * CHUNK, number)
                for i in range(chunk * CHUNK, last):
                    if i + 1 < last:
                        _fetch(lent, i + 1)
                    _advance(lent, i, scratch)
                add(counters, DONE, 1)
                idle = 0
    owned.work[0, 0] = 0.0  # a last use: memory that was lent must live until here


@compiled_without_lock
def advance(given: Bare, counters: Counters) -> None:
    """Step every vehicle, with the help of whoever calls `help_out` meanwhile."""
    put(counters, DONE, 0)
    put(counters, CLAIMED, 0)
    help_out(given, counters, FROM_FRONT, 0)
    chunks = (len(_job(given).actions) + CHUNK - 1) // CHUNK
    while get(counters, DONE) < chunks:
        pass


@compiled
def begin(given: Bare, chosen: Flags) -> None:
    """Start the chosen flights (N,) in their slots, and look and report for all."""
    job = _job(given)
    discs = job.world.discs.shape[2]
    work, found = np.empty((2, discs)), np.empty(discs, np.int64)
    for i in range(len(chosen)):
        if chosen[i]:
            _begin(job, i)
        _observe(job, i, job.seen, job.reports[i], work, found)


@compiled
def used_up(flights: Records, length: int) -> int:
    """Number of vehicles that have no later field left in their queue of this length."""
    number = 0
    for i in range(len(flights)):
        number += flights[i].next >= length
    return number


@compiled
def first_bad(actions: Action) -> int:
    """The first row with an entry that is not in [-1, 1]; -1 if all are."""
    for i in range(len(actions)):
        for d in range(actions.shape[1]):
            if not abs(actions[i, d]) <= 1.0:
                return i
    return -1
