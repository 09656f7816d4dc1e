"""Rollout: a whole plan from a planner that decides one segment at a time."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, Outcome, is_feasible
from ferguson_gym.world.transition import State as Vehicle
from ferguson_gym.world.transition import Step, fly_segment
from planners.interface import Decision, Plan, Replanner, State, Status
from planners.optimization.initial_guesses import shifted

_STATUS = {status.outcome: status for status in (Status.SOLVED, Status.OUT_OF_SEGMENTS)}
"""Any other outcome becomes `Status.STUCK`."""


class StepByStep:
    """Plans whole flights by deciding one segment after another."""

    __slots__ = ()

    def plan(self: Replanner, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal, with the errors that `decide` raises."""
        return roll_out(self, field, state, seed)


def successor(state: State, chain: Array, vehicle: Vehicle) -> State:
    """The state after the first segment of a chain (n, 4, 2) was flown and ended at `vehicle`."""
    before = state.vehicle
    segment = before.position, vehicle.position, before.derivative, vehicle.derivative
    return State(vehicle, chain[1:], np.concatenate([state.flown, np.stack(segment)[None]]))


def remaining_plan(field: Field, state: State) -> tuple[Array, Step] | None:
    """The segments (n, 4, 2) of an earlier plan still to be flown, and the first one as flown.

    None if nothing is left, or if it is infeasible from the state reached. All segments are
    certified again: the flown segment was rounded to a float32 action, so its end differs from the
    plan, and the field may have changed, as it does under limited sensing.
    """
    if len(state.tail) == 0:
        return None
    chain = shifted(state.vehicle, state.tail, len(state.tail))
    # with the full tolerance, since rounding may have moved the start
    if not is_feasible(chain, field).all():
        return None
    step = fly_segment(field, state.vehicle, chain[0])
    return (chain, step) if step.flown else None


def ends_on_goal(field: Field, state: State) -> bool:
    """Whether the part of a plan still to be flown ends on the goal."""
    return len(state.tail) > 0 and np.array_equal(state.tail[-1, 1], field.goal)


def terminal_plan(field: Field, state: State) -> Plan | None:
    """The empty plan of a flight on the goal or out of segments; None for any other flight."""
    if np.array_equal(state.vehicle.position, field.goal):
        return flight_plan(field, Status.SOLVED, [], [state])
    if state.vehicle.segments >= field.limits.segments:
        return flight_plan(field, Status.OUT_OF_SEGMENTS, [], [state])
    return None


def flight_plan(
    field: Field, status: Status, steps: Sequence[Step], states: Sequence[State]
) -> Plan:
    """A plan, without its decisions, of steps flown between states; it keeps their certificates."""
    control = np.array([step.control for step in steps]).reshape(-1, 4, 2)
    certificates = [step.inspection for step in steps]
    return Plan(status, control, states, [], certificates=certificates, field=field)


def roll_out(
    planner: Replanner, field: Field, state: State, seed: int, until: float = math.inf
) -> Plan:
    """Decide and fly one segment after another until the flight ends.

    Segments are flown as the environment does it, rounded to float32 actions, so that the plan and
    its flight are equal bit for bit. Once `time.perf_counter()` has reached `until`, nothing more
    is decided (`planners.deadline`).
    """
    if (ended := terminal_plan(field, state)) is not None:
        return ended
    states, decisions, steps = [state], list[Decision](), list[Step]()
    outcome = Outcome.FLYING
    while outcome is Outcome.FLYING and time.perf_counter() < until:
        decision = planner.decide(field, state, seed)
        decisions.append(decision)
        if decision.chain is None:
            break
        chain, step = decision.chain, decision.first_step
        # `first_step` is certified; it is missing if the planner used only a part of the field, or
        # an image of it at another scale
        step = step or fly_segment(field, state.vehicle, chain[0])
        if not step.flown:
            break
        state, outcome = successor(state, chain, step.state), step.outcome
        states.append(state)
        steps.append(step)
    status = _STATUS.get(outcome, Status.STUCK)
    if outcome is Outcome.FLYING and time.perf_counter() >= until:
        status = Status.OUT_OF_TIME
    return replace(flight_plan(field, status, steps, states), decisions=decisions)


def fly_chain(chain: Array, field: Field, state: State) -> tuple[list[Step], list[State]]:
    """Fly segments (n, 4, 2) up to the first infeasible one: the m steps and the m + 1 states.

    Each is certified again as it is flown, since rounding to float32 actions changes it.
    """
    states, steps = [state], []
    for k, segment in enumerate(chain):
        step = fly_segment(field, states[-1].vehicle, segment)
        if not step.flown:
            break
        steps.append(step)
        states.append(successor(states[-1], chain[k:], step.state))
    return steps, states
