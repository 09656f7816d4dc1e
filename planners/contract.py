"""A check, for your own tests, that a planner keeps the contract of `planners.interface.Planner`.

    from ferguson_gym import get_field
    from planners.contract import check_planner

    def test_my_planner():
        check_planner(MyPlanner(), get_field("sparse/train:0"))

A broken promise raises an AssertionError that names it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ferguson_gym.world import Field, fly_segment, is_feasible
from planners.interface import Knowledge, Plan, Planner, Replanner, State, initial_state


def check_planner(planner: Planner, field: Field, seed: int = 0) -> Plan:
    """Check a planner in one field. Choose a field that it solves: most rules concern solved plans.

    - A plan is a feasible chain from the given state, and a solved plan ends on the goal.
    - The same seed gives the same plan: randomness comes from (seed, step) alone.
    - Planning from a state on the way gives the rest of the plan.
    - Planning works from a state without a flown path, and from a vehicle at rest.
    - At the goal, the plan is solved and has no segments.
    - The first segment that a replanner decides is the first of its plan.
    - Planning changes neither the field nor the state.
    - What the planner states that it knows, if anything, is a `Knowledge`.

    Returns:
        The plan from the start of the field.

    Raises:
        AssertionError: the planner broke a promise.
    """
    known = isinstance(getattr(planner, "knows", Knowledge.WHOLE_FIELD), Knowledge)
    assert known, "the attribute knows is Knowledge.WHOLE_FIELD or Knowledge.NEARBY"
    state = initial_state(field)
    before = _numbers(field, state)
    plan = planner.plan(field, state, seed)
    _check_plan(plan, field, state)
    again = planner.plan(field, state, seed)
    assert np.array_equal(again.control, plan.control), "the same seed gives the same plan"
    if isinstance(planner, Replanner):
        _check_decision(planner, field, state, seed, plan)
    if plan.success:
        middle = len(plan.control) // 2
        rest = planner.plan(field, plan.states[middle], seed).control
        same = np.array_equal(rest, plan.control[middle:])
        assert same, "planning from a state on the way gives the rest of the plan"
        on_goal = planner.plan(field, plan.states[-1], seed)
        arrived = on_goal.success and len(on_goal.control) == 0
        assert arrived, "a flight on the goal is solved without a segment"
        vehicle = plan.states[middle].vehicle
        for odd in (State(vehicle), State(replace(vehicle, derivative=0.0 * vehicle.derivative))):
            _check_plan(planner.plan(field, odd, seed), field, odd)
    assert _numbers(field, state) == before, "planning changes neither the field nor the state"
    return plan


def _check_plan(plan: Plan, field: Field, state: State) -> None:
    """Check that a plan is a feasible chain from a state, and that it ends as it reports."""
    control = plan.control
    assert control.shape[1:] == (4, 2), f"segments have shape (n, 4, 2), got {control.shape}"
    assert len(plan.states) == len(control) + 1, "a plan has one state more than segments"
    assert is_feasible(control, field).all(), "every segment of a plan is feasible"
    if len(control):
        start = np.stack([state.vehicle.position, state.vehicle.derivative])
        assert np.array_equal(control[0, [0, 2]], start), "a plan leaves from the given state"
        joined = np.array_equal(control[1:, [0, 2]], control[:-1, [1, 3]])
        assert joined, "each segment starts with the point and the derivative of the last one's end"
    if plan.certificates is not None:
        assert len(plan.certificates) == len(control), "one certificate for each segment"
    end = plan.states[-1].vehicle
    assert end.segments <= field.limits.segments, (
        "a plan has no more segments than the limits allow"
    )
    if plan.success:
        assert np.array_equal(end.position, field.goal), "a solved plan ends on the goal"


def _check_decision(planner: Replanner, field: Field, state: State, seed: int, plan: Plan) -> None:
    """Check that the first segment decided, as it is flown, is the first of the plan."""
    decision = planner.decide(field, state, seed)
    if decision.chain is None:
        assert len(plan.control) == 0, "if decide finds no segment, plan returns none"
        return
    vehicle, first = state.vehicle, decision.chain[0]
    step = decision.first_step or fly_segment(field, vehicle, first)
    same = np.array_equal(step.control[None] if step.flown else [], plan.control[:1])
    assert same, "the first segment that a replanner decides is the first of its plan"


def _numbers(field: Field, state: State) -> list[list[float]]:
    """Values that reveal a change of the field or the state."""
    ends = np.stack([field.start, field.goal])
    arrays = (ends, field.bounds, field.departure, field.obstacles.signed_distance(ends))
    vehicle = (state.vehicle.position, state.vehicle.derivative, state.tail, state.flown)
    return [array.ravel().tolist() for array in (*arrays, *vehicle)]
