"""A whole plan from a planner that decides one segment at a time."""

from __future__ import annotations

import numpy as np

from ferguson_gym.fields import Field
from ferguson_gym.flight import Step, follow
from ferguson_gym.outcome import Outcome
from planners.interface import Decision, Plan, Replanner, State, Status


def successor(decision: Decision, step: Step) -> State:
    """The state after flying the first segment of a decision."""
    assert decision.chain is not None
    return State(step.state, decision.chain[1:])


def roll_out(planner: Replanner, field: Field, state: State, seed: int) -> Plan:
    """Decide, fly, decide again until the flight ends.

    Segments are flown as the environment flies them, rounded to float32 actions, so that
    the plan and its flight are equal bit for bit.
    """
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
        state = successor(decision, step)
        states.append(state)
        flown.append(step.control)
        if step.outcome is Outcome.GOAL_REACHED:
            status = Status.SOLVED
            break
        if step.outcome is Outcome.OUT_OF_SEGMENTS:
            status = Status.OUT_OF_SEGMENTS
            break
    return Plan(status, np.array(flown).reshape(-1, 4, 2), states, decisions)
