"""One step of many vehicles, each through its own field, as compiled code.

The scalar environment is a batch of one; the vector environment steps N vehicles at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ferguson_gym.curves.certified_kernels import Scratch, make_scratch
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.helper_threads import CLAIMED, DONE, Counters, add, get, put
from ferguson_gym.runtime.jit import (
    compiled,
    compiled_in_place,
    compiled_without_lock,
    prefetch,
    unowned,
)
from ferguson_gym.simulation.field_store import cores_of
from ferguson_gym.simulation.observations import FlatObservation, write_observation
from ferguson_gym.simulation.reward import segment_reward
from ferguson_gym.simulation.step_buffers import (
    NEXT_STEP,
    SAME_STEP,
    Flags,
    Integers,
    PlainTuple,
    Records,
    StepBuffers,
    as_buffers,
)
from ferguson_gym.world.actions import Action, decode_into
from ferguson_gym.world.feasibility import FLYING, first_failure
from ferguson_gym.world.limits import PAPER_LONGEST, LimitValues
from ferguson_gym.world.outcome import Outcome

GOAL_REACHED, OUT_OF_SEGMENTS = Outcome.GOAL_REACHED.code, Outcome.OUT_OF_SEGMENTS.code

CHUNK = 8
"""Vehicles that a thread claims at a time."""
FROM_FRONT, FROM_BACK = 1, 2**32
"""What a thread adds to the counter of claimed chunks. Two threads claim from the two ends, so
that each steps mostly the vehicles that it stepped last, whose data are in its cache."""
CACHE_LINE = 64
"""Bytes that the processor loads at once."""


@compiled_in_place
def _reset_vehicle(buffers: StepBuffers, i: int) -> None:
    flight, fields, rules = buffers.flights[i], buffers.fields, buffers.rules[i]
    field = fields.records[flight.slot]
    flight.gate = field.gate if np.isnan(rules.gate) else rules.gate
    flight.most = rules.most if rules.most > 0 else field.segments
    flight.detour, flight.failure = rules.detour, rules.failure
    flight.segments, flight.outcome, flight.path_length = 0, FLYING, 0.0
    flight.clearance = field.clearance
    for d in range(2):
        flight.position[d] = field.start[d]
        flight.derivative[d] = field.start_derivative[d]


@compiled_in_place
def limits_of(field: Any, flight: Any) -> LimitValues:
    """Limits of a flight (FLIGHT) in a field (FIELD_RECORD); gate and segments are its own."""
    return LimitValues(
        field.shortest, field.longest, field.slowest, flight.gate, field.tolerance, flight.most
    )


@compiled
def _distance(position: Array, goal: Array) -> float:
    x, y = goal[0] - position[0], goal[1] - position[1]
    return float(np.sqrt(x * x + y * y))


@compiled_in_place
def _fly_action(buffers: StepBuffers, i: int, scratch: Scratch) -> float:
    """Fly one action; returns the reward."""
    flight, fields = buffers.flights[i], buffers.fields
    slot = flight.slot
    field = fields.records[slot]
    goal, position = field.goal, flight.position
    control = buffers.paths[i, flight.segments]
    limits = limits_of(field, flight)
    unit = limits.longest / PAPER_LONGEST
    decode_into(control, buffers.actions[i], position, flight.derivative, goal, flight.gate, unit)
    outcome, length, clearance = first_failure(
        control,
        field.bounds,
        fields.discs[slot, :2],
        fields.discs[slot, 2],
        cores_of(fields, slot),
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
        reward = segment_reward(
            before, _distance(position, goal), length, field.distance, flight.detour
        )
        if control[1, 0] == goal[0] and control[1, 1] == goal[1]:
            outcome = GOAL_REACHED
        elif flight.segments >= flight.most:
            outcome = OUT_OF_SEGMENTS
    flight.outcome = outcome
    if outcome not in (FLYING, GOAL_REACHED):
        reward -= flight.failure
    return reward


@compiled_in_place
def _observe(
    buffers: StepBuffers,
    i: int,
    observations: FlatObservation,
    report: Any,
    work: Array,
    found: Integers,
) -> None:
    """Write a vehicle's observation and its infos."""
    flight, fields = buffers.flights[i], buffers.fields
    slot = flight.slot
    field = fields.records[slot]
    write_observation(
        observations,
        i,
        len(buffers.flights),
        buffers.layout,
        flight.position,
        flight.derivative,
        1.0 - flight.segments / flight.most,
        field.longest / PAPER_LONGEST,
        field.goal,
        field.bounds,
        fields.discs[slot, :2],
        fields.discs[slot, 2],
        cores_of(fields, slot),
        work,
        found,
    )
    report.is_success = flight.outcome == GOAL_REACHED
    report.outcome = flight.outcome
    report.path_length = flight.path_length
    report.clearance = flight.clearance
    report.segments = flight.segments


@compiled_in_place
def _step_vehicle(buffers: StepBuffers, i: int, scratch: Scratch) -> None:
    """Fly a vehicle's action or reset it, as the autoreset mode says, and report."""
    flight, report = buffers.flights[i], buffers.reports[i]
    report.reward = 0.0
    report.terminated = False
    report.truncated = False
    starts = buffers.mode == NEXT_STEP and flight.outcome != FLYING
    again = False
    if not starts:
        report.reward = _fly_action(buffers, i, scratch)
        if flight.outcome != FLYING:
            report.truncated = flight.outcome == OUT_OF_SEGMENTS
            report.terminated = flight.outcome != OUT_OF_SEGMENTS
            again = buffers.mode == SAME_STEP
    observations, infos = buffers.observations, report
    if buffers.mode == SAME_STEP:
        final = buffers.final_reports[i]
        if again:
            observations, infos = buffers.final_observations, final
        else:
            final.is_success, final.outcome, final.segments = False, 0, 0
            final.path_length, final.clearance = 0.0, 0.0
    while True:  # a loop, since two calls of `_observe` would be compiled in place twice
        if starts:
            flight.slot = buffers.queue[i, flight.next]
            flight.next += 1
            _reset_vehicle(buffers, i)
        _observe(buffers, i, observations, infos, scratch.work, scratch.found)
        if not again:
            break
        starts, again = True, False
        observations, infos = buffers.observations, report


@compiled_in_place
def _prefetch_vehicle(buffers: StepBuffers, i: int) -> None:
    """Prefetch what a vehicle's step will read: its path and its field, or its next field."""
    flight, fields = buffers.flights[i], buffers.fields
    slot = flight.slot
    if buffers.mode == NEXT_STEP and flight.outcome != FLYING:
        slot = buffers.queue[i, flight.next]
    discs = fields.discs[slot]
    for byte in range(0, discs.size * discs.itemsize, CACHE_LINE):
        prefetch(discs, byte)
    field = fields.records[slot : slot + 1]
    prefetch(field, 0)
    prefetch(field, CACHE_LINE)
    prefetch(field, 2 * CACHE_LINE)
    prefetch(buffers.paths[i, flight.segments], 0)


@compiled
def _claimed(counter: int) -> int:
    """Number of chunks claimed, from the front and from the back."""
    return counter % FROM_BACK + counter // FROM_BACK


@compiled_without_lock
def advance(given: PlainTuple, counters: Counters, claim: int, patience: int) -> None:
    """Step every vehicle. The thread that leads claims FROM_FRONT, those that help FROM_BACK.

    The leading thread returns when every vehicle was stepped; helping ones return when they have
    polled the counter `patience` times in a row without a chunk to claim. Both are one function,
    since each function that contains the step takes seconds to compile.
    """
    leads = claim == FROM_FRONT
    if leads:
        put(counters, DONE, 0)
        put(counters, CLAIMED, 0)
    buffers = unowned(as_buffers(given))  # the caller holds them
    owned = make_scratch((0, 1), buffers.fields.discs.shape[2], buffers.fields.corners.shape[2])
    scratch = unowned(owned)
    number = len(buffers.actions)
    chunks = (number + CHUNK - 1) // CHUNK
    idle = 0
    while idle <= patience:
        idle += 1
        if _claimed(get(counters, CLAIMED)) < chunks:
            before = add(counters, CLAIMED, claim)
            if _claimed(before) < chunks:
                front, back = before % FROM_BACK, before // FROM_BACK
                chunk = front if leads else chunks - 1 - back
                last = min((chunk + 1) * CHUNK, number)
                for i in range(chunk * CHUNK, last):
                    if i + 1 < last:
                        _prefetch_vehicle(buffers, i + 1)
                    _step_vehicle(buffers, i, scratch)
                add(counters, DONE, 1)
                idle = 0
    owned.work[0, 0] = 0.0  # a last use, which keeps the memory of `scratch` alive until here
    while leads and get(counters, DONE) < chunks:
        pass


@compiled
def reset(given: PlainTuple, chosen: Flags) -> None:
    """Reset the chosen vehicles (N,) in their slots; write observations and infos of all."""
    buffers = as_buffers(given)
    discs = buffers.fields.discs.shape[2]
    work, found = np.empty((2, discs)), np.empty(discs, np.int64)
    for i in range(len(chosen)):
        if chosen[i]:
            _reset_vehicle(buffers, i)
        _observe(buffers, i, buffers.observations, buffers.reports[i], work, found)


@compiled
def used_up(flights: Records, length: int) -> int:
    """Number of vehicles that have no field left in their queue of this length."""
    number = 0
    for i in range(len(flights)):
        number += flights[i].next >= length
    return number


@compiled
def first_invalid(actions: Action) -> int:
    """The first row with an entry that is not in [-1, 1]; -1 if there is no such row."""
    for i in range(len(actions)):
        for d in range(actions.shape[1]):
            if not abs(actions[i, d]) <= 1.0:
                return i
    return -1
