"""A whole plan from a planner that decides one segment at a time."""

from __future__ import annotations

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import Follow, fly_segment
from ferguson_gym.world.transition import State as Vehicle
from planners.interface import Plan, Replanner, State, Status
from planners.optimization.initial_guesses import shifted


def successor(state: State, chain: Array, vehicle: Vehicle) -> State:
    """The state after flying the first of some segments (n, 4, 2), and where that led."""
    before = state.vehicle
    segment = before.position, vehicle.position, before.derivative, vehicle.derivative
    return State(vehicle, chain[1:], np.concatenate([state.flown, np.stack(segment)[None]]))


def rest(field: Field, state: State, limits: Limits, follow: Follow = fly_segment) -> Array | None:
    """What is left of a plan (n, 4, 2), if anything is and it is feasible from the state flown."""
    if len(state.tail) == 0:
        return None
    chain = shifted(state.vehicle, state.tail, len(state.tail))
    # the tolerance covers the rounding of the segment flown last
    if not is_feasible(chain, field, limits).all():
        return None
    return chain if follow(field, state.vehicle, chain[0], limits).flown else None


def arriving(field: Field, state: State) -> bool:
    """Whether what is planned ends on the goal."""
    return len(state.tail) > 0 and np.array_equal(state.tail[-1, 1], field.goal)


def over(field: Field, state: State, limits: Limits) -> Plan | None:
    """The plan of a flight that is over: on the goal, or out of segments; None if it goes on."""
    if np.array_equal(state.vehicle.position, field.goal):
        return Plan(Status.SOLVED, np.empty((0, 4, 2)), [state], [])
    if state.vehicle.segments >= limits.segments:
        return Plan(Status.OUT_OF_SEGMENTS, np.empty((0, 4, 2)), [state], [])
    return None


def roll_out(
    planner: Replanner, field: Field, state: State, seed: int, follow: Follow = fly_segment
) -> Plan:
    """Decide, fly, decide again until the flight ends.

    Segments are flown as the environment flies them, rounded to float32 actions, so that
    the plan and its flight are equal bit for bit; unless `follow` flies them in another way.
    """
    if (ended := over(field, state, planner.limits)) is not None:
        return ended
    states, decisions, flown = [state], [], []
    status = Status.STUCK
    while True:
        decision = planner.decide(field, state, seed)
        decisions.append(decision)
        if decision.chain is None:
            break
        step = follow(field, state.vehicle, decision.chain[0], planner.limits)
        if not step.flown:
            break
        state = successor(state, decision.chain, step.state)
        states.append(state)
        flown.append(step.control)
        if step.outcome is Outcome.GOAL_REACHED:
            status = Status.SOLVED
            break
        if step.outcome is Outcome.OUT_OF_SEGMENTS:
            status = Status.OUT_OF_SEGMENTS
            break
    return Plan(status, np.array(flown).reshape(-1, 4, 2), states, decisions)


def fly(chain: Array, field: Field, state: State, limits: Limits) -> tuple[Array, list[State]]:
    """Fly segments (n, 4, 2) as far as they may be flown.

    Returns:
        The segments flown (m, 4, 2), as rounded to float32 actions, and the m + 1 states.
    """
    states, flown = [state], []
    for segment in chain:
        step = fly_segment(field, states[-1].vehicle, segment, limits)
        if not step.flown:
            break
        flown.append(step.control)
        states.append(successor(states[-1], chain[len(flown) - 1 :], step.state))
    return np.array(flown).reshape(-1, 4, 2), states
