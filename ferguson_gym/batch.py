"""The batched core: flights of many vehicles, each through its own field, compiled.

The scalar environment is its batch of one, the vector environment drives it as a whole.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.actions import Action, decode_into
from ferguson_gym.arrays import Array
from ferguson_gym.bank import World
from ferguson_gym.compilation import compiled, compiled_without_lock
from ferguson_gym.crew import CLAIMED, DONE, Counters, add, borrowed, get, put
from ferguson_gym.feasibility import FLYING, first_failure
from ferguson_gym.limits import Numbers
from ferguson_gym.observations import Sight, look
from ferguson_gym.outcome import Outcome
from ferguson_gym.rewards import Prices, gain
from ferguson_gym.segments import Scratch, borrowed_scratch, make_scratch

Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]

GOAL_REACHED, OUT_OF_SEGMENTS = Outcome.GOAL_REACHED.code, Outcome.OUT_OF_SEGMENTS.code

DISABLED, NEXT_STEP, SAME_STEP = 0, 1, 2
"""What happens when a flight ends: nothing; reset in place of the next step; reset at once."""

CHUNK = 16
"""Vehicles that one thread takes at a time."""


class Flights(NamedTuple):
    """Where N vehicles are."""

    slot: Integers
    """(N,) field being flown."""
    position: Array
    """(N, 2) [m]."""
    derivative: Array
    """(N, 2) [m per unit t]."""
    segments: Integers
    """(N,) flown so far."""
    outcome: Integers
    """(N,) code."""
    path_length: Array
    """(N,) [m]."""
    clearance: Array
    """(N,) least so far [m]."""
    paths: Array
    """(N, segments + 1, 4, 2) segments flown, then the last one asked for."""
    queue: Integers
    """(N, B) slots of the fields that later resets will fly."""
    next: Integers
    """(N,) the queue's first that is not used up."""


class Report(NamedTuple):
    """What a step returns of N vehicles, beside what they see; the last five are infos."""

    reward: Array
    terminated: Flags
    truncated: Flags
    is_success: Flags
    outcome: Integers
    path_length: Array
    clearance: Array
    segments: Integers


def new_flights(number: int, segments: int, block: int) -> Flights:
    """Memory for a number of vehicles; none of them flies yet."""
    return Flights(
        slot=np.zeros(number, np.int64),
        position=np.zeros((number, 2)),
        derivative=np.zeros((number, 2)),
        segments=np.zeros(number, np.int64),
        outcome=np.zeros(number, np.int64),
        path_length=np.zeros(number),
        clearance=np.zeros(number),
        paths=np.zeros((number, segments + 1, 4, 2)),
        queue=np.zeros((number, block), np.int64),
        next=np.full(number, block, np.int64),
    )


def new_report(number: int) -> Report:
    """Memory for what a step returns."""
    return Report(
        reward=np.zeros(number),
        terminated=np.zeros(number, np.bool_),
        truncated=np.zeros(number, np.bool_),
        is_success=np.zeros(number, np.bool_),
        outcome=np.zeros(number, np.int64),
        path_length=np.zeros(number),
        clearance=np.zeros(number),
        segments=np.zeros(number, np.int64),
    )


@compiled
def _begin(flights: Flights, i: int, world: World) -> None:
    slot = flights.slot[i]
    flights.segments[i], flights.outcome[i], flights.path_length[i] = 0, FLYING, 0.0
    clearance = np.inf
    x, y = world.start[slot, 0], world.start[slot, 1]
    for k in range(world.radii.shape[1]):
        along, across = world.columns[slot, 0, k] - x, world.columns[slot, 1, k] - y
        distance = np.sqrt(along * along + across * across) - world.radii[slot, k]
        clearance = min(clearance, distance)
    flights.clearance[i] = clearance
    for d in range(2):
        flights.position[i, d] = world.start[slot, d]
        flights.derivative[i, d] = world.departure[slot, d]


@compiled
def _to_goal(flights: Flights, i: int, goal: Array) -> float:
    x, y = goal[0] - flights.position[i, 0], goal[1] - flights.position[i, 1]
    return float(np.sqrt(x * x + y * y))


@compiled
def _fly(
    flights: Flights,
    i: int,
    world: World,
    action: Action,
    limits: Numbers,
    prices: Prices,
    scratch: Scratch,
) -> float:
    """Fly one action; returns the reward."""
    slot = flights.slot[i]
    goal = world.goal[slot]
    control = flights.paths[i, flights.segments[i]]
    decode_into(control, action, flights.position[i], flights.derivative[i], goal, limits.gate)
    outcome, length, clearance = first_failure(
        control,
        world.bounds[slot],
        world.columns[slot],
        world.radii[slot],
        limits,
        flights.clearance[i],
        scratch,
    )
    reward = 0.0
    if outcome == FLYING:
        before = _to_goal(flights, i, goal)
        for d in range(2):
            flights.position[i, d], flights.derivative[i, d] = control[1, d], control[3, d]
        flights.segments[i] += 1
        flights.path_length[i] += length
        flights.clearance[i] = clearance
        reward = gain(before, _to_goal(flights, i, goal), length, world.distance[slot], prices)
        if control[1, 0] == goal[0] and control[1, 1] == goal[1]:
            outcome = GOAL_REACHED
        elif flights.segments[i] >= limits.segments:
            outcome = OUT_OF_SEGMENTS
    flights.outcome[i] = outcome
    if outcome not in (FLYING, GOAL_REACHED):
        reward -= prices.failure
    return reward


@compiled
def _look(sight: Sight, job: Job, i: int, work: Array) -> None:
    flights, world = job.flights, job.world
    slot = flights.slot[i]
    look(
        sight,
        i,
        flights.position[i],
        flights.derivative[i],
        1.0 - flights.segments[i] / job.limits.segments,
        world.goal[slot],
        world.bounds[slot],
        world.columns[slot],
        world.radii[slot],
        job.focus,
        work,
    )


@compiled
def _inform(report: Report, flights: Flights, i: int) -> None:
    report.is_success[i] = flights.outcome[i] == GOAL_REACHED
    report.outcome[i] = flights.outcome[i]
    report.path_length[i] = flights.path_length[i]
    report.clearance[i] = flights.clearance[i]
    report.segments[i] = flights.segments[i]


class Job(NamedTuple):
    """Everything that a step of N vehicles needs, and where its results go."""

    flights: Flights
    """Changed by each step."""
    world: World
    actions: Action
    """(N, 4) in [-1, 1]."""
    limits: Numbers
    prices: Prices
    focus: float
    """See `ferguson_gym.observations.look`."""
    mode: int
    """DISABLED, NEXT_STEP or SAME_STEP."""
    sight: Sight
    """What is seen after the step, or after the reset that it became."""
    report: Report
    """What the step returns; infos, too, are of after a reset."""
    last_sight: Sight
    """SAME_STEP: what was seen last, for flights that ended."""
    last_report: Report
    """SAME_STEP: infos of flights that ended."""


@compiled
def _advance(job: Job, i: int, scratch: Scratch) -> None:
    flights, report, mode = job.flights, job.report, job.mode
    report.reward[i] = 0.0
    report.terminated[i] = False
    report.truncated[i] = False
    begins = mode == NEXT_STEP and flights.outcome[i] != FLYING
    if not begins:
        report.reward[i] = _fly(
            flights, i, job.world, job.actions[i], job.limits, job.prices, scratch
        )
        if flights.outcome[i] != FLYING:
            cut = flights.outcome[i] == OUT_OF_SEGMENTS
            report.truncated[i] = cut
            report.terminated[i] = not cut
            if mode == SAME_STEP:
                begins = True
                _look(job.last_sight, job, i, scratch.work)
                _inform(job.last_report, flights, i)
    if begins:
        flights.slot[i] = flights.queue[i, flights.next[i]]
        flights.next[i] += 1
        _begin(flights, i, job.world)
    _look(job.sight, job, i, scratch.work)
    _inform(report, flights, i)


@compiled
def _borrowed(job: Job) -> Job:
    flights, world = job.flights, job.world
    return Job(
        Flights(
            borrowed(flights.slot),
            borrowed(flights.position),
            borrowed(flights.derivative),
            borrowed(flights.segments),
            borrowed(flights.outcome),
            borrowed(flights.path_length),
            borrowed(flights.clearance),
            borrowed(flights.paths),
            borrowed(flights.queue),
            borrowed(flights.next),
        ),
        World(
            borrowed(world.columns),
            borrowed(world.radii),
            borrowed(world.start),
            borrowed(world.departure),
            borrowed(world.goal),
            borrowed(world.bounds),
            borrowed(world.distance),
        ),
        borrowed(job.actions),
        job.limits,
        job.prices,
        job.focus,
        job.mode,
        _borrowed_sight(job.sight),
        _borrowed_report(job.report),
        _borrowed_sight(job.last_sight),
        _borrowed_report(job.last_report),
    )


@compiled
def _borrowed_sight(sight: Sight) -> Sight:
    return Sight(
        borrowed(sight.vehicle),
        borrowed(sight.goal),
        borrowed(sight.obstacles),
        borrowed(sight.mask),
        borrowed(sight.rays),
    )


@compiled
def _borrowed_report(report: Report) -> Report:
    return Report(
        borrowed(report.reward),
        borrowed(report.terminated),
        borrowed(report.truncated),
        borrowed(report.is_success),
        borrowed(report.outcome),
        borrowed(report.path_length),
        borrowed(report.clearance),
        borrowed(report.segments),
    )


@compiled_without_lock
def help_out(job: Job, counters: Counters, patience: int) -> None:
    """Step vehicles as long as any are left; return after so many looks in vain."""
    owned = make_scratch((0, 1), max(job.world.radii.shape[1], job.sight.mask.shape[1]))
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
    work = np.empty((3, max(job.world.radii.shape[1], job.sight.mask.shape[1])))
    for i in range(len(chosen)):
        if chosen[i]:
            _begin(job.flights, i, job.world)
        _look(job.sight, job, i, work)
        _inform(job.report, job.flights, i)


@compiled
def first_bad(actions: Action) -> int:
    """The first row with an entry that is not in [-1, 1]; -1 if all are."""
    for i in range(len(actions)):
        for d in range(actions.shape[1]):
            if not abs(actions[i, d]) <= 1.0:
                return i
    return -1
