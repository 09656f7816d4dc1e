"""The batched core: flights of many vehicles, each through its own field, compiled.

The scalar environment is its batch of one, the vector environment drives it as a whole.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.actions import Action, decode_into
from ferguson_gym.arrays import Array
from ferguson_gym.bank import World
from ferguson_gym.compilation import (
    borrowed,
    compiled,
    compiled_in_place,
    compiled_without_lock,
)
from ferguson_gym.crew import CLAIMED, DONE, Counters, add, get, put
from ferguson_gym.feasibility import FLYING, first_failure
from ferguson_gym.limits import Numbers
from ferguson_gym.observations import Layout, Single, look
from ferguson_gym.outcome import Outcome
from ferguson_gym.rewards import Prices, gain
from ferguson_gym.segments import Scratch, borrowed_scratch, make_scratch

Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]
Records = NDArray[np.void]

GOAL_REACHED, OUT_OF_SEGMENTS = Outcome.GOAL_REACHED.code, Outcome.OUT_OF_SEGMENTS.code

DISABLED, NEXT_STEP, SAME_STEP = 0, 1, 2
"""What happens when a flight ends: nothing; reset in place of the next step; reset at once."""

CHUNK = 16
"""Vehicles that one thread takes at a time."""


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


class Job(NamedTuple):
    """Everything that a step of N vehicles needs, and where its results go.

    Records and few arrays: the compiler's time grows with their number.
    """

    flights: Records
    """(N,) of FLIGHT; changed by each step."""
    paths: Array
    """(N, segments + 1, 4, 2) segments flown, then the last one asked for."""
    queue: Integers
    """(N, B) slots of the fields that later resets will fly."""
    world: World
    actions: Action
    """(N, 4) in [-1, 1]."""
    limits: Numbers
    prices: Prices
    layout: Layout
    mode: int
    """DISABLED, NEXT_STEP or SAME_STEP."""
    seen: Single
    """(N, n) flat observations after the step, or after the reset that it became."""
    reports: Records
    """(N,) of REPORT; infos, too, are of after a reset."""
    last_seen: Single
    """SAME_STEP: what was seen last, for flights that ended."""
    last_reports: Records
    """SAME_STEP: infos of flights that ended."""


@compiled_in_place
def _begin(job: Job, i: int) -> None:
    flight, world = job.flights[i], job.world
    slot = flight.slot
    place, columns, radii = world.places[slot], world.columns[slot], world.radii[slot]
    flight.segments, flight.outcome, flight.path_length = 0, FLYING, 0.0
    clearance = np.inf
    for k in range(len(radii)):
        x, y = columns[0, k] - place.start[0], columns[1, k] - place.start[1]
        clearance = min(clearance, np.sqrt(x * x + y * y) - radii[k])
    flight.clearance = clearance
    for d in range(2):
        flight.position[d] = place.start[d]
        flight.derivative[d] = place.departure[d]


@compiled
def _distance(position: Array, goal: Array) -> float:
    x, y = goal[0] - position[0], goal[1] - position[1]
    return float(np.sqrt(x * x + y * y))


@compiled_in_place
def _fly(job: Job, i: int, scratch: Scratch) -> float:
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
        world.columns[slot],
        world.radii[slot],
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
def _observe(job: Job, i: int, row: Single, report: Any, work: Array) -> None:
    """Write what a vehicle sees, and its infos."""
    flight, world = job.flights[i], job.world
    slot = flight.slot
    place = world.places[slot]
    look(
        row,
        job.layout,
        flight.position,
        flight.derivative,
        1.0 - flight.segments / job.limits.segments,
        place.goal,
        place.bounds,
        world.columns[slot],
        world.radii[slot],
        work,
    )
    report.is_success = flight.outcome == GOAL_REACHED
    report.outcome = flight.outcome
    report.path_length = flight.path_length
    report.clearance = flight.clearance
    report.segments = flight.segments


@compiled_in_place
def _advance(job: Job, i: int, scratch: Scratch) -> None:
    flight, report = job.flights[i], job.reports[i]
    report.reward = 0.0
    report.terminated = False
    report.truncated = False
    begins = job.mode == NEXT_STEP and flight.outcome != FLYING
    if not begins:
        report.reward = _fly(job, i, scratch)
        if flight.outcome != FLYING:
            report.truncated = flight.outcome == OUT_OF_SEGMENTS
            report.terminated = flight.outcome != OUT_OF_SEGMENTS
            if job.mode == SAME_STEP:
                begins = True
                _observe(job, i, job.last_seen[i], job.last_reports[i], scratch.work)
    if begins:
        flight.slot = job.queue[i, flight.next]
        flight.next += 1
        _begin(job, i)
    _observe(job, i, job.seen[i], report, scratch.work)


@compiled
def _borrowed(job: Job) -> Job:
    world = job.world
    return Job(
        borrowed(job.flights),
        borrowed(job.paths),
        borrowed(job.queue),
        World(borrowed(world.places), borrowed(world.columns), borrowed(world.radii)),
        borrowed(job.actions),
        job.limits,
        job.prices,
        Layout(job.layout.nearest, borrowed(job.layout.ways), job.layout.focus),
        job.mode,
        borrowed(job.seen),
        borrowed(job.reports),
        borrowed(job.last_seen),
        borrowed(job.last_reports),
    )


@compiled_without_lock
def help_out(job: Job, counters: Counters, patience: int) -> None:
    """Step vehicles as long as any are left; return after so many looks in vain."""
    owned = make_scratch((0, 1), job.world.radii.shape[1])
    scratch, lent = borrowed_scratch(owned), _borrowed(job)
    number = len(job.actions)
    chunks = (number + CHUNK - 1) // CHUNK
    idle = 0
    while idle <= patience:
        idle += 1
        if get(counters, CLAIMED) < chunks:
            chunk = add(counters, CLAIMED, 1)
            if chunk < chunks:
                for i in range(chunk * CHUNK, min((chunk + 1) * CHUNK, number)):
                    _advance(lent, i, scratch)
                add(counters, DONE, 1)
                idle = 0
    owned.work[0, 0] = 0.0  # a last use: memory that was lent must live until here


@compiled_without_lock
def advance(job: Job, counters: Counters) -> None:
    """Step every vehicle, with the help of whoever calls `help_out` meanwhile."""
    put(counters, DONE, 0)
    put(counters, CLAIMED, 0)
    help_out(job, counters, 0)
    chunks = (len(job.actions) + CHUNK - 1) // CHUNK
    while get(counters, DONE) < chunks:
        pass


@compiled
def begin(job: Job, chosen: Flags) -> None:
    """Start the chosen flights (N,) in their slots, and look and report for all."""
    work = np.empty((3, job.world.radii.shape[1]))
    for i in range(len(chosen)):
        if chosen[i]:
            _begin(job, i)
        _observe(job, i, job.seen[i], job.reports[i], work)


@compiled
def first_bad(actions: Action) -> int:
    """The first row with an entry that is not in [-1, 1]; -1 if all are."""
    for i in range(len(actions)):
        for d in range(actions.shape[1]):
            if not abs(actions[i, d]) <= 1.0:
                return i
    return -1
